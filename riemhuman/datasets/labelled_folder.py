"""Registered meshes of a folder, with a table of their subjects and poses."""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from riemhuman.datasets.bodies import Bodies
from riemhuman.datasets.registered_meshes import (
    check_template,
    existing_folder,
    find_meshes,
    load_registered,
    natural_key,
    read_template,
)
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.files import file_path
from riemhuman.io.text_tables import read_text
from riemhuman.representation import join_names
from riemhuman.surfaces.procrustes import procrustes
from riemhuman.surfaces.template import Template

_LABELS = "labels.csv"
_COLUMNS = ("file", "subject", "pose")
_SEPARATORS = (",", ";", "\t")


def load_bodies(
    folder: str | os.PathLike[str],
    labels: str | os.PathLike[str] | None = None,
    template: Template | str | os.PathLike[str] | None = None,
    *,
    align: bool = True,
    scale: str | None = "template",
    unit: str | None = None,
    up: str | None = None,
    allow_missing: bool = False,
    progress: bool = False,
) -> Bodies:
    r"""Load the registered meshes of a folder with labels from a table.

    Parameters
    ----------
    folder : path_like
        The folder of the meshes (``.ply``, ``.obj`` or ``.off``), all with the same triangles.
        Subfolders are ignored.
    labels : path_like, optional
        The table: comma-, semicolon- or tab-separated text whose first line names the columns.
        ``file`` holds the name of a mesh file, with or without its suffix; ``subject`` and ``pose``
        hold any text; other columns are ignored. By default ``labels.csv`` in the folder.
    template : Template or path_like, optional
        The template, or a mesh file with it; its triangles must be those of the meshes. By
        default the first mesh is the template, because a mean of poses is not a body.
    align : bool
        Whether the meshes are rotated and translated (never scaled) onto the template.
    scale : {"template"} or None
        With "template", a mesh more than eight times as large or as small as the first or the
        template is refused, because it is evidently in another unit.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the files, converted to metres; by default coordinates are not scaled.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up in the files, rotated to y; by default meshes are not rotated.
    allow_missing : bool
        Whether to leave out meshes without a row and rows without a mesh.
    progress : bool
        Whether to show a progress bar over files.

    Returns
    -------
    bodies : Bodies
        The meshes in the natural order of their names (body_2 before body_10), with subjects and
        poses numbered in the natural order of their names.

    Raises
    ------
    FileError
        If the folder contains no meshes, the table does not exist, or a file cannot be read.
    FileFormatError
        If the table lacks a column or an entry or names a file twice, meshes have no row or rows no
        mesh, or a mesh is damaged or differs from the first in its triangles or evidently in its
        unit.
    DegenerateSurfaceError
        If a triangle of the template has no area.
    ArgumentError
        If the template has other triangles, another number of vertices or another unit than the
        meshes.
    ArgumentTypeError
        If an argument has the wrong type.

    Examples
    --------
    >>> import os
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> os.mkdir("scans")
    >>> for name, f in zip(["anna_sits", "anna_stands"], bodies.points):
    ...     rh.save_mesh(f"scans/{name}.ply", f, bodies.template.faces)
    >>> with open("labels.csv", "w") as table:
    ...     print("file,subject,pose", file=table)
    ...     print("anna_sits.ply,anna,sits", "anna_stands.ply,anna,stands", sep="\n", file=table)
    >>> rh.datasets.load_bodies("scans", labels="labels.csv").pose_names
    ('sits', 'stands')
    """
    files = find_meshes(folder)
    table = existing_folder(folder) / _LABELS if labels is None else file_path(labels, "labels")
    if labels is None and not table.is_file():
        raise FileError(
            f"there is no table of labels {table}; write one with the columns "
            f"{', '.join(_COLUMNS)}, or give its path"
        )
    matched = _matched(files, _read_rows(table), table, allow_missing)
    files, rows = list(matched), list(matched.values())
    units: dict[str, Any] = {"unit": unit, "up": up}
    reference = read_template(template, files[0], **units)
    points, faces = load_registered(files, scale=scale, progress=progress, **units)
    check_template(reference, points, faces, scale)
    if align:
        points = procrustes(points, to=reference.vertices, scale=None)
    subject, subject_names = _numbered([row.subject for row in rows])
    pose, pose_names = _numbered([row.pose for row in rows])
    return Bodies(
        points=points,
        subject=subject,
        pose=pose,
        template=reference,
        subject_names=subject_names,
        pose_names=pose_names,
        ids=tuple(file.stem for file in files),
    )


def read_labels(
    table: str | os.PathLike[str], names: Sequence[str], *, allow_missing: bool = False
) -> tuple[list[int], dict[str, list[str]]]:
    """Read the subjects and poses of files from a table, as for `load_bodies`.

    Parameters
    ----------
    table : path_like
        The table.
    names : sequence of str
        Names of the files.
    allow_missing : bool
        Whether names without a row, and rows without a name, are left out instead of refused.

    Returns
    -------
    numbers : list of int
        Indices of the names that have labels, ascending.
    labels : dict of str to list of str
        The columns "subject" and "pose", with one entry for each of these names.

    Raises
    ------
    FileError
        If the table cannot be read.
    FileFormatError
        If it is damaged, or does not match the names.
    """
    path = file_path(table, "labels")
    found = _matched([Path(name) for name in names], _read_rows(path), path, allow_missing)
    numbers = [number for number, name in enumerate(names) if Path(name) in found]
    rows = found.values()
    return numbers, {"subject": [row.subject for row in rows], "pose": [row.pose for row in rows]}


class _Row(NamedTuple):
    """One line of the table."""

    line: int
    file: str
    subject: str
    pose: str


def _read_rows(table: Path) -> list[_Row]:
    """Return the rows of a table; errors name the line."""
    if table.is_dir():
        raise FileError(f"{table} is a folder; a table of labels was expected")
    if not table.exists():
        raise FileError(f"there is no table of labels {table}")
    text = read_text(table)
    heading = re.split(r"[\r\n]", text, maxsplit=1)[0]
    separator = max(_SEPARATORS, key=heading.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    lines: list[tuple[int, list[str]]] = []
    try:
        for entries in reader:
            if not lines or any(entries):
                lines.append((reader.line_num, [entry.strip() for entry in entries]))
    except csv.Error as error:
        raise FileFormatError(f"{table}, line {reader.line_num}: {error}") from error

    names = [name.lower() for name in lines[0][1]] if lines else []
    missing = [name for name in _COLUMNS if name not in names]
    if missing:
        raise FileFormatError(
            f"{table} lacks the columns {', '.join(missing)}; its first line must name "
            f"{', '.join(_COLUMNS)}; found {heading.strip()[:60]!r}"
        )
    columns = [names.index(name) for name in _COLUMNS]
    rows = []
    for line, entries in lines[1:]:
        if not any(entries):
            continue
        found = [entries[column] if column < len(entries) else "" for column in columns]
        empty = [name for name, entry in zip(_COLUMNS, found, strict=True) if not entry]
        if empty:
            raise FileFormatError(f"{table}, line {line}: no {' and no '.join(empty)} given")
        rows.append(_Row(line, *found))
    return rows


def _matched(
    files: Sequence[Path], rows: Sequence[_Row], table: Path, allow_missing: bool = False
) -> dict[Path, _Row]:
    """Return the row of every file; refuse or leave out files and rows without the other."""
    names = {file.name: file for file in files}
    stems: dict[str, list[Path]] = {}
    for file in files:
        stems.setdefault(file.stem, []).append(file)
    found: dict[Path, _Row] = {}
    unknown = []
    for row in rows:
        candidates = [names[row.file]] if row.file in names else stems.get(row.file, [])
        if len(candidates) > 1:
            several = join_names([file.name for file in candidates], 5)
            raise FileFormatError(
                f"{table}, line {row.line}: {row.file[:60]} may be {several}; name one"
            )
        if not candidates:
            unknown.append(row.file)
            continue
        file = candidates[0]
        if file in found:
            raise FileFormatError(
                f"{table}, line {row.line}: {row.file[:60]} has a label already, on line "
                f"{found[file].line}"
            )
        found[file] = row
    unlabelled = [file.name for file in files if file not in found]
    if not found or ((unknown or unlabelled) and not allow_missing):
        problems = []
        if unlabelled:
            problems.append(f"meshes without a row: {join_names(unlabelled, 5)}")
        if unknown:
            problems.append(f"rows without a mesh: {join_names(unknown, 5)}")
        raise FileFormatError(f"{table} does not match the meshes: {'; '.join(problems)}")
    return {file: found[file] for file in files if file in found}


def _numbered(labels: Sequence[str]) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the number of each label, and the labels by number."""
    names = sorted(set(labels), key=natural_key)
    numbers = {name: number for number, name in enumerate(names)}
    return np.array([numbers[label] for label in labels], dtype=np.int64), tuple(names)
