"""Registered meshes in files: folders of meshes, FAUST and labelled folders, by one loader."""

from __future__ import annotations

import csv
import io
import itertools
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, overload

import numpy as np

from riemhuman.checks import SCALES, check_same_scale, one_of
from riemhuman.datasets.bodies import Bodies
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.io.files import file_path, read_text
from riemhuman.io.mesh_arrays import face_difference
from riemhuman.io.meshes import load_mesh
from riemhuman.progress import ProgressBar
from riemhuman.representation import join_names
from riemhuman.surfaces.procrustes import make_upright, procrustes
from riemhuman.surfaces.template import Template

# Suffixes of mesh files; of one mesh in several formats, the first of these is read.
MESH_ENDINGS = (".ply", ".obj", ".off", ".stl", ".glb")

_FAUST_SUBJECTS, _FAUST_POSES = 10, 10
_FAUST_FOLDERS = (
    ".",
    "registrations",
    "training/registrations",
    "MPI-FAUST/training/registrations",
)

_LABELS = "labels.csv"
_COLUMNS = ("file", "subject", "pose")
_SEPARATORS = (",", ";", "\t")


class RegisteredMeshes:
    """Registered surfaces in files, which are read on access and not kept.

    ``meshes[i]`` is a surface, shape (V, 3); ``meshes[i:j:k]`` are several, shape (n, V, 3).

    Parameters
    ----------
    files : sequence of path_like
        Mesh files, see `riemhuman.load_mesh`; at least one.
    reference : path_like, optional
        Mesh file whose number of vertices and triangles all files must have; by default the first.
    scale : {"template"} or None
        With "template", a mesh more than eight times as large or as small as the reference raises
        an error, because it is evidently in another unit.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the files, converted to metres; by default coordinates are not scaled.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up in the files, rotated to y; by default meshes are not rotated.

    Attributes
    ----------
    files : tuple of Path
        The files.
    faces : array of int, shape (F, 3)
        The common triangles.
    reference : array, shape (V, 3)
        Vertices of the reference.

    Raises
    ------
    FileError
        If the reference is missing or cannot be read.
    FileFormatError
        If the reference is damaged; on access, if a file is damaged, or differs from the reference
        in its triangles, its number of vertices or evidently in its unit.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> for name, points in zip("ab", bodies.points):
    ...     rh.save_mesh(f"{name}.ply", points, bodies.template.faces)
    >>> rh.datasets.RegisteredMeshes(["a.ply", "b.ply"])[:].shape
    (2, 1202, 3)
    """

    def __init__(
        self,
        files: Sequence[str | os.PathLike[str]],
        reference: str | os.PathLike[str] | None = None,
        scale: str | None = "template",
        *,
        unit: str | None = None,
        up: str | None = None,
    ) -> None:
        self._scale = one_of(scale, "scale", SCALES)
        self._unit, self._up = unit, up
        self.files = tuple(Path(file) for file in files)
        if not self.files:
            raise ArgumentError("files holds no mesh file; at least one is needed")
        self._reference = self.files[0] if reference is None else Path(reference)
        vertices, self.faces = load_mesh(self._reference)
        self.reference = make_upright(vertices, unit, up)

    def __len__(self) -> int:
        return len(self.files)

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> np.ndarray: ...
    def __getitem__(self, index: int | slice) -> np.ndarray:
        if isinstance(index, slice):
            files = self.files[index]
            surfaces = np.empty((len(files), *self.reference.shape))
            for number, file in enumerate(files):
                surfaces[number] = self._read(file)
            return surfaces
        return self._read(self.files[index])

    def _read(self, file: Path) -> np.ndarray:
        vertices, faces = load_mesh(file)
        vertices = make_upright(vertices, self._unit, self._up)
        if vertices.shape != self.reference.shape:
            difference = f"it has {len(vertices)} vertices, that one has {len(self.reference)}"
        else:
            difference = face_difference(faces, self.faces) or ""
        if difference:
            raise FileFormatError(
                f"{file} is not registered to {self._reference}: {difference}; register it first: "
                f"riemhuman register {file} -o body.ply"
            )
        if self._scale is not None:
            names = str(file), str(self._reference)
            check_same_scale(vertices, self.reference, *names, error=FileFormatError)
        return vertices


def find_meshes(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the mesh files of a folder in natural order: body_2 comes before body_10.

    Subfolders and hidden files are ignored.

    Parameters
    ----------
    folder : path_like
        The folder.

    Returns
    -------
    files : list of Path
        At least one.

    Raises
    ------
    FileError
        If the folder does not exist, cannot be read, or has no mesh files.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body_1.ply", bodies[0], bodies.template.faces)
    >>> [file.name for file in rh.datasets.find_meshes(".")]
    ['body_1.ply']
    """
    root = existing_folder(folder)
    try:
        files = [file for file in root.iterdir() if is_visible(file, MESH_ENDINGS)]
    except OSError as error:
        raise FileError(f"{root} cannot be read: {error.strerror}") from error
    if not files:
        raise FileError(f"{root} holds no mesh: no file there ends in {', '.join(MESH_ENDINGS)}")
    return sorted(files, key=lambda file: natural_key(file.name))


def load_faust(
    folder: str | os.PathLike[str],
    template: Template | str | os.PathLike[str] | None = None,
    *,
    align: bool = True,
    allow_missing: bool = False,
) -> Bodies:
    """Load the 100 training registrations of MPI FAUST: 10 people in 10 poses [1]_.

    The data set is not part of this library and is available from its authors on registration.

    Parameters
    ----------
    folder : path_like
        The folder ``registrations`` with the files ``tr_reg_000.ply`` to ``tr_reg_099.ply``, or
        a folder above it: ``training``, ``MPI-FAUST`` or the folder that contains it. Files may
        end in ``.ply``, ``.obj`` or ``.off``; of several formats, the first of these is read.
    template : Template or path_like, optional
        The template, or a mesh file with it; its triangles must be those of the registrations.
        By default the first registration is the template, because a mean of poses is not a body.
    align : bool
        Whether the registrations are rotated and translated (never scaled) onto the template.
    allow_missing : bool
        Whether to load the other registrations when some of the 100 files are missing.

    Returns
    -------
    bodies : Bodies
        The registrations in metres, in the order of their numbers i, with subject i // 10 and
        pose i % 10.

    Raises
    ------
    FileError
        If there are no registrations or some are missing, or a file cannot be read.
    FileFormatError
        If a file is damaged, or has other triangles or another number of vertices than the first.
    DegenerateSurfaceError
        If a triangle of the template has no area.

    References
    ----------
    .. [1] Bogo, Romero, Loper, Black, "FAUST: Dataset and evaluation for 3D mesh registration",
       CVPR 2014.

    Examples
    --------
    >>> import riemhuman as rh
    >>> try:
    ...     rh.datasets.load_faust("MPI-FAUST")
    ... except rh.RiemhumanError as error:
    ...     print(error)
    there is no folder MPI-FAUST
    """
    files = _find_faust(folder)
    n_bodies = _FAUST_SUBJECTS * _FAUST_POSES
    missing = [f"tr_reg_{number:03d}" for number in range(n_bodies) if number not in files]
    if missing and not allow_missing:
        raise FileError(
            f"{next(iter(files.values())).parent}: {len(missing)} of {n_bodies} registrations are "
            f"missing: {join_names(missing, 5)}; allow_missing=True loads the others"
        )
    numbers = np.array(sorted(files))
    points, reference = _load([files[number] for number in numbers], template, align=align)
    return Bodies(
        points=points,
        subject=numbers // _FAUST_POSES,
        pose=numbers % _FAUST_POSES,
        template=reference,
        subject_names=tuple(f"subject {i}" for i in range(_FAUST_SUBJECTS)),
        pose_names=tuple(f"pose {i}" for i in range(_FAUST_POSES)),
        ids=tuple(f"tr_reg_{number:03d}" for number in numbers),
    )


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
        template raises an error, because it is evidently in another unit.
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
    rows = _match_rows(files, _read_rows(table), table, allow_missing)
    files = list(rows)
    points, reference = _load(
        files, template, align=align, scale=scale, unit=unit, up=up, progress=progress
    )
    subject, subject_names = _number_labels([row.subject for row in rows.values()])
    pose, pose_names = _number_labels([row.pose for row in rows.values()])
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
        Whether to leave out names without a row and rows without a name.

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

    Examples
    --------
    >>> import riemhuman as rh
    >>> with open("labels.csv", "w") as table:
    ...     print("file,subject,pose", file=table)
    ...     print("a.ply,anna,sits", file=table)
    >>> rh.datasets.read_labels("labels.csv", ["a.ply"])
    ([0], {'subject': ['anna'], 'pose': ['sits']})
    """
    path = file_path(table, "labels")
    rows = _match_rows([Path(name) for name in names], _read_rows(path), path, allow_missing)
    numbers = [number for number, name in enumerate(names) if Path(name) in rows]
    columns = {name: [getattr(row, name) for row in rows.values()] for name in _COLUMNS[1:]}
    return numbers, columns


def existing_folder(folder: str | os.PathLike[str]) -> Path:
    """Return the path of a folder; raise an error if there is none."""
    root = file_path(folder, "folder", "folder")
    if not root.is_dir():
        raise FileError(
            f"{root} is a file, not a folder" if root.exists() else f"there is no folder {root}"
        )
    return root


def is_visible(file: Path, endings: tuple[str, ...]) -> bool:
    """Return whether a path has one of these suffixes and is not hidden."""
    return file.suffix.lower() in endings and not file.name.startswith(".")


def preferred_formats(files: Iterable[tuple[str, Path]]) -> dict[str, Path]:
    """Return one file for each key, the first in the order of `MESH_ENDINGS`."""
    chosen: dict[str, Path] = {}
    for key, file in files:
        several = (chosen.get(key, file), file)
        chosen[key] = min(several, key=lambda f: (MESH_ENDINGS.index(f.suffix.lower()), f.name))
    return chosen


def natural_key(name: str) -> tuple[object, ...]:
    """Return a sorting key that compares numbers within names as numbers."""
    # The key alternates text and numbers, so that text is compared with text.
    texts = re.split(r"[0-9]+", name.casefold())
    digits = [number.lstrip("0") for number in re.findall(r"[0-9]+", name)]
    # A number with more digits is larger; Python refuses to convert thousands of digits.
    numbers = [(len(number), number) for number in digits]
    return (*itertools.chain(*itertools.zip_longest(texts, numbers, fillvalue=(-1, ""))),), name


def _load(
    files: Sequence[Path],
    template: Template | str | os.PathLike[str] | None,
    *,
    align: bool,
    scale: str | None = "template",
    unit: str | None = None,
    up: str | None = None,
    progress: bool = False,
) -> tuple[np.ndarray, Template]:
    """Return the vertices of registered meshes, shape (n, V, 3), and their template.

    A template must be a body. The mean of the vertices is not a body if poses differ: its arms
    shrink, and their triangles lose their weight in every integral over the template. Unlike a
    medoid, the first body needs no computation and stays the same when bodies are added.
    """
    if not isinstance(template, Template):
        read = Template.from_file(files[0] if template is None else template)
        template = (
            Template(make_upright(read.vertices, unit, up), read.faces) if unit or up else read
        )
    meshes = RegisteredMeshes(files, scale=scale, unit=unit, up=up)
    numbers = ProgressBar(range(len(meshes)), desc="Meshes", unit="mesh", disable=not progress)
    points = np.empty((len(meshes), *meshes.reference.shape))
    for number in numbers:
        points[number] = meshes[number]
    if template.n_vertices != points.shape[1]:
        raise ArgumentError(
            f"template has {template.n_vertices} vertices; the meshes have {points.shape[1]}"
        )
    difference = face_difference(template.faces, meshes.faces)
    if difference:
        raise ArgumentError(f"template must have the triangles of the meshes: {difference}")
    if scale is not None:
        check_same_scale(points, template.vertices, "the mesh", "the template")
    if align:
        points = procrustes(points, to=template.vertices, scale=None)
    return points, template


def _find_faust(folder: str | os.PathLike[str]) -> dict[int, Path]:
    """Return the registration files by number, from the first folder that holds any."""
    root = existing_folder(folder)
    for level in _FAUST_FOLDERS:
        if (root / level).is_dir():
            files = preferred_formats(
                (file.stem, file)
                for file in (root / level).iterdir()
                if re.fullmatch(r"tr_reg_0\d\d", file.stem) and is_visible(file, MESH_ENDINGS)
            )
            if files:
                return {int(name[-3:]): file for name, file in files.items()}
    raise FileError(
        f"{root} holds no registrations: files named tr_reg_000.ply to tr_reg_099.ply (or .obj, "
        f".off) were looked for in it and in its subfolders {', '.join(_FAUST_FOLDERS[1:])}"
    )


class _Row(NamedTuple):
    """One line of a table of labels."""

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
        wanted = [entries[column] if column < len(entries) else "" for column in columns]
        empty = [name for name, entry in zip(_COLUMNS, wanted, strict=True) if not entry]
        if empty:
            raise FileFormatError(f"{table}, line {line}: no {' and no '.join(empty)} given")
        rows.append(_Row(line, *wanted))
    return rows


def _match_rows(
    files: Sequence[Path], rows: Sequence[_Row], table: Path, allow_missing: bool = False
) -> dict[Path, _Row]:
    """Return the row of every file; files and rows without the other are errors or left out."""
    names = {file.name: file for file in files}
    stems: dict[str, list[Path]] = {}
    for file in files:
        stems.setdefault(file.stem, []).append(file)
    row_of_file: dict[Path, _Row] = {}
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
        elif candidates[0] in row_of_file:
            raise FileFormatError(
                f"{table}, line {row.line}: {row.file[:60]} has a label already, on line "
                f"{row_of_file[candidates[0]].line}"
            )
        else:
            row_of_file[candidates[0]] = row
    unlabelled = [file.name for file in files if file not in row_of_file]
    if not row_of_file or ((unknown or unlabelled) and not allow_missing):
        problems = []
        if unlabelled:
            problems.append(f"meshes without a row: {join_names(unlabelled, 5)}")
        if unknown:
            problems.append(f"rows without a mesh: {join_names(unknown, 5)}")
        raise FileFormatError(f"{table} does not match the meshes: {'; '.join(problems)}")
    return {file: row_of_file[file] for file in files if file in row_of_file}


def _number_labels(labels: Sequence[str]) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the number of each label, and the labels by number."""
    names = sorted(set(labels), key=natural_key)
    numbers = {name: number for number, name in enumerate(names)}
    return np.array([numbers[label] for label in labels], dtype=np.int64), tuple(names)
