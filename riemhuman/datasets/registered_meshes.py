"""Registered meshes in files: tables of files and labels, and one loader for all of them."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeAlias

import numpy as np
from tqdm import tqdm

from riemhuman.arrays import Array, Integers
from riemhuman.checks import (
    SCALES,
    UNITS,
    check_same_scale,
    checked,
    choice,
    flag,
    is_human_size,
    items_of,
    likely_units,
    longest_side,
    numbers_at,
)
from riemhuman.checks.labels import texts_of
from riemhuman.datasets.bodies import Bodies
from riemhuman.errors import ArgumentError, FileError, FileFormatError, warn
from riemhuman.io.files import convert_errors, file_path, natural_key, visible_files
from riemhuman.io.kinds_of_files import BY_MAP, YES, FileKind, reads
from riemhuman.io.label_tables import LABELS, read_label_rows, rows_of_files, without_ending
from riemhuman.io.mesh_arrays import face_difference
from riemhuman.io.mesh_seams import Seams, a_seam_choice, common_seams, find_seams
from riemhuman.io.meshes import WRITTEN_SUFFIXES, load_mesh, load_split_mesh
from riemhuman.representation import join_names
from riemhuman.surfaces.procrustes import AXES, make_upright, procrustes
from riemhuman.surfaces.template import Template

# Suffixes of mesh files; of one mesh in several formats, the first of these is read.
MESH_ENDINGS = (".ply", ".obj", ".off", ".stl", ".glb")

_FAUST_PEOPLE = _FAUST_POSES = 10
_FAUST_FOLDERS = (
    ".",
    "registrations",
    "training/registrations",
    "MPI-FAUST/training/registrations",
)

_COLUMNS = ("subject", "pose")

Names: TypeAlias = tuple[tuple[str, ...], Integers]
"""Names of people or of poses, and the number of that of each mesh."""


class RegisteredMeshes:
    """Registered surfaces in files, which are read on access and not kept.

    ``meshes[i]`` is a surface, shape (V, 3); ``meshes[i:j:k]`` are several, shape (n, V, 3). If the
    triangles of a file differ from those of the reference, or its unit clearly does,
    `FileFormatError` is raised.

    Parameters
    ----------
    files : sequence of path_like
        Mesh files, see `riemhuman.load_mesh`.
    reference : Template or path_like, optional
        The template, or a mesh file, whose triangles all files must have; by default the first
        file.
    scale : {"template"} or None
        With "template", a mesh that is more than eight times larger or smaller than the reference
        raises an error, because it must be in another unit.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the files, converted to metres; by default coordinates are not scaled.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up in the files, rotated to y; by default meshes are not rotated.
    seams : {"join", "keep"}
        Exporters of OBJ and GLB files duplicate vertices along seams. "join" joins copies that
        coincide in all files, for which all files are read at once. "keep" keeps the vertices of
        the files, and so does a reference that is a `Template`.

    Attributes
    ----------
    files : tuple of Path
    faces : array of int, shape (F, 3)
    reference : array, shape (V, 3)
        Vertices of the reference.
    seams : Seams or None
        The map from the vertices of the files to those of the surfaces, and back, if seams were
        joined.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> for name, points in zip("ab", bodies.points):
    ...     rh.save_mesh(f"{name}.ply", points, bodies.template.faces)
    >>> rh.datasets.RegisteredMeshes(["a.ply", "b.ply"])[:].shape
    (2, 1202, 3)
    """

    @checked(scale=choice(*SCALES), unit=choice(*UNITS), up=choice(*AXES), seams=a_seam_choice)
    def __init__(
        self,
        files: Sequence[str | os.PathLike[str]],
        reference: Template | str | os.PathLike[str] | None = None,
        scale: str | None = "template",
        *,
        unit: str | None = None,
        up: str | None = None,
        seams: str = "join",
    ) -> None:
        self._scale, self._unit, self._up = scale, unit, up
        self.seams: Seams | None = None
        places = items_of(files, "files", "a list of paths")
        self.files = tuple(file_path(file, f"files[{k}]") for k, file in enumerate(places))
        if not self.files:
            raise ArgumentError("files holds no mesh file; at least one is needed")
        if isinstance(reference, Template):
            self._name, self.reference = "the template", reference.vertices
            self.faces = reference.faces
        else:
            file = self.files[0] if reference is None else file_path(reference, "reference")
            vertices, self.faces = load_mesh(file)
            self._name, self.reference = str(file), make_upright(vertices, unit, up)
        if seams == "join" and not isinstance(reference, Template):
            self._join_seams()
        if scale is not None and unit is None:
            _warn_of_units(self._name, longest_side(self.reference))

    def __len__(self) -> int:
        return len(self.files)

    def __getitem__(self, index: int | slice[int | None, int | None, int | None]) -> Array:
        numbers = numbers_at(index, len(self), "a set of registered meshes", "mesh")
        if isinstance(numbers, int):
            return self._read(self.files[numbers])
        surfaces = [self._read(self.files[number]) for number in numbers]
        return np.array(surfaces).reshape(-1, *self.reference.shape)

    def _join_seams(self) -> None:
        """Join the vertices that coincide along seams of all files."""
        seams = find_seams(self.reference, self.faces)
        for file in self.files:
            if not seams:
                return
            seams = common_seams(seams, self._read(file), self.faces)
        if seams:
            self._file_faces, self.faces = self.faces, seams.faces
            self.reference, self.seams = seams.join(self.reference), seams

    def _read(self, file: Path) -> Array:
        n_vertices, expected = len(self.reference), self.faces
        if self.seams is not None:
            n_vertices, expected = len(self.seams.joined_vertices), self._file_faces
        vertices, faces = load_split_mesh(file, expected)
        vertices = make_upright(vertices, self._unit, self._up)
        if len(vertices) != n_vertices:
            difference = f"it has {len(vertices)} vertices, that one has {n_vertices}"
        else:
            difference = face_difference(faces, expected) or ""
        if difference:
            raise FileFormatError(
                f"{file} is not registered to {self._name}: {difference}; register it first: "
                f"riemhuman register {file} -o body.ply"
            )
        if self.seams is not None:
            vertices = self.seams.join(vertices)
        if self._scale is not None:
            names = str(file), self._name
            check_same_scale(vertices, longest_side(self.reference), *names, error=FileFormatError)
        return vertices


def _warn_of_units(name: str, size: float) -> None:
    """Warn if a surface has the size of a human body in another unit than metres."""
    if is_human_size(size) or not likely_units(size):
        return
    unit = " or ".join(likely_units(size))
    warn(
        f"{name} is {size:.4g} long, as a body in {unit} is; distances and measurements are in "
        f"that unit: unit={likely_units(size)[0]!r} (on the command line --unit) converts files to "
        "metres, and scale=None (--any-scale) accepts any size",
        UserWarning,
    )


def find_meshes(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the mesh files of a folder in natural order: body_2 comes before body_10.

    Subfolders and hidden files are ignored, and so are GLB files next to meshes of other formats.

    Parameters
    ----------
    folder : path_like

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body_1.ply", bodies[0], bodies.template.faces)
    >>> [file.name for file in rh.datasets.find_meshes(".")]
    ['body_1.ply']
    """
    root = existing_folder(folder)
    with convert_errors(root, "cannot be read"):
        files = visible_files(root, *MESH_ENDINGS)
    if not files:
        raise no_meshes(root)
    # Next to other meshes, a GLB file is their animation.
    files = [file for file in files if file.suffix.lower() != ".glb"] or files
    return sorted(files, key=lambda file: natural_key(file.name))


@reads(
    FileKind(
        "MPI FAUST",
        "datasets.load_faust",
        (".ply",),
        registered=YES,
        measured=BY_MAP,
        written=WRITTEN_SUFFIXES,
    )
)
@checked(align=flag, allow_missing=flag)
def load_faust(
    folder: str | os.PathLike[str],
    template: Template | str | os.PathLike[str] | None = None,
    *,
    align: bool = True,
    allow_missing: bool = False,
) -> Bodies:
    """Load the 100 training registrations of MPI FAUST: 10 people in 10 poses [1]_.

    The data set is available from its authors. Registration i shows subject i // 10 in pose i % 10.

    Parameters
    ----------
    folder : path_like
        The folder with the files ``tr_reg_000.ply`` to ``tr_reg_099.ply`` (or .obj, .off), or one
        of those above it.
    template : Template or path_like, optional
        The template, or a mesh file with it; by default the first registration.
    align : bool
        Whether the registrations are rotated and translated (never scaled) onto the template.
    allow_missing : bool
        Whether to load the other registrations when some of the 100 files are missing.

    References
    ----------
    .. [1] Bogo, Romero, Loper, Black, "FAUST: Dataset and evaluation for 3D mesh registration",
       CVPR 2014.

    Examples
    --------
    >>> bodies = rh.datasets.load_faust("MPI-FAUST")  # doctest: +SKIP
    """
    root = existing_folder(folder)
    files: dict[int, Path] = {}
    for name in _FAUST_FOLDERS:
        if not files and (root / name).is_dir():
            files = _faust_registrations(root / name)
    if not files:
        raise FileError(
            f"{root} holds no registrations: no file tr_reg_000.ply to tr_reg_099.ply (or .obj, "
            f".off) in it and its subfolders {', '.join(_FAUST_FOLDERS[1:])}"
        )
    n_bodies = _FAUST_PEOPLE * _FAUST_POSES
    missing = [f"tr_reg_{number:03d}" for number in range(n_bodies) if number not in files]
    if missing and not allow_missing:
        raise FileError(
            f"{next(iter(files.values())).parent}: {len(missing)} of {n_bodies} registrations are "
            f"missing: {join_names(missing, 5)}; allow_missing=True loads the others"
        )
    numbers = np.array(list(files))
    return _load(
        list(files.values()),
        (tuple(f"subject {i}" for i in range(_FAUST_PEOPLE)), numbers // _FAUST_POSES),
        (tuple(f"pose {i}" for i in range(_FAUST_POSES)), numbers % _FAUST_POSES),
        template,
        align=align,
    )


def _faust_registrations(folder: Path) -> dict[int, Path]:
    """Return the files of a folder of FAUST, tr_reg_000 to tr_reg_099, by their numbers."""
    registrations = [file for file in folder.iterdir() if re.fullmatch(r"tr_reg_0\d\d", file.stem)]
    return {int(file.stem.removeprefix("tr_reg_")): file for file in in_one_format(registrations)}


# More than eight arguments: each keyword states a fact that mesh files omit.
@reads(
    FileKind(
        "meshes of one topology other than the open model's",
        "datasets.load_bodies",
        MESH_ENDINGS,
        registered=YES,
        measured=BY_MAP,
        written=WRITTEN_SUFFIXES,
    )
)
@checked(align=flag, allow_missing=flag, progress=flag)
def load_bodies(
    folder: str | os.PathLike[str],
    labels: str | os.PathLike[str] | None = None,
    template: Template | str | os.PathLike[str] | None = None,
    *,
    align: bool = True,
    scale: str | None = "template",
    unit: str | None = None,
    up: str | None = None,
    seams: str = "join",
    allow_missing: bool = False,
    progress: bool = False,
) -> Bodies:
    r"""Load the registered meshes of a folder with labels from a table.

    Meshes, subjects and poses are in the natural order of their names (body_2 before body_10).

    Parameters
    ----------
    folder : path_like
        The folder of the meshes, all with the same triangles. Subfolders are ignored.
    labels : path_like, optional
        The table: comma-, semicolon- or tab-separated text whose first line names the columns.
        ``file`` holds the name of a mesh file, with or without its suffix; ``subject`` (or
        ``person``, or ``name``: the first of these that the table has) and ``pose`` hold any text,
        compared in one Unicode form; other columns are ignored. Every row is as long as the first.
        NA, NaN, None, null and empty cells are missing labels. By default ``labels.csv`` in the
        folder.
    template, align
        As for `load_faust`.
    scale, unit, up, seams
        As for `RegisteredMeshes`.
    allow_missing : bool
        Whether to leave out meshes without a row or with an empty cell for a label, and rows
        without a mesh; otherwise they raise errors, as missing labels always do, see
        `rh.retrieval.scores`.
    progress : bool

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("anna_sits.ply", bodies[0], bodies.template.faces)
    >>> with open("labels.csv", "w") as table:
    ...     print("file,subject,pose", "anna_sits,anna,sits", sep="\n", file=table)
    >>> rh.datasets.load_bodies(".").pose_names
    ('sits',)
    """
    files = find_meshes(folder)
    table = os.path.join(folder, LABELS) if labels is None else labels
    numbers, texts = read_labels(table, [file.name for file in files], allow_missing=allow_missing)
    return _load(
        [files[number] for number in numbers],
        _numbered(texts["subject"]),
        _numbered(texts["pose"]),
        template,
        align=align,
        scale=scale,
        unit=unit,
        up=up,
        seams=seams,
        progress=progress,
    )


@checked(names=texts_of, allow_missing=flag)
def read_labels(
    table: str | os.PathLike[str], names: Sequence[str], *, allow_missing: bool = False
) -> tuple[list[int], dict[str, list[str]]]:
    r"""Return the indices of files that have labels in a table, and their columns by name.

    Parameters
    ----------
    table : path_like
        As for `load_bodies`.
    names : sequence of str
        Names of the files.
    allow_missing : bool
        Whether to leave out names without a row or with an empty cell for a label, and rows
        without a name.

    Examples
    --------
    >>> with open("labels.csv", "w") as table:
    ...     print("file,subject,pose", "a.ply,anna,sits", sep="\n", file=table)
    >>> rh.datasets.read_labels("labels.csv", ["a.ply"])
    ([0], {'subject': ['anna'], 'pose': ['sits']})
    """
    file = file_path(table, "labels")
    rows = []
    for row in read_label_rows(file, _COLUMNS):
        empty = [column for column, text in row.texts.items() if not text]
        if empty and allow_missing:
            continue
        if empty:
            raise FileFormatError(
                f"{file}, line {row.line}: no {' and no '.join(empty)} given (NA, NaN, None and "
                "null count as empty)"
            )
        rows.append(row)
    row_of_file, others = rows_of_files(file, rows, names)
    numbers = sorted(row_of_file)
    unlabelled = [name for number, name in enumerate(names) if number not in row_of_file]
    if not numbers or ((others or unlabelled) and not allow_missing):
        problems = {
            "meshes without a row": unlabelled,
            "rows without a mesh": [row.file for row in others],
        }
        listed = [
            f"{problem}: {join_names(names_of_problem, 5)}"
            for problem, names_of_problem in problems.items()
            if names_of_problem
        ]
        raise FileFormatError(f"{file} does not match the meshes: {'; '.join(listed)}")
    columns = {
        column: [row_of_file[number].texts[column] for number in numbers] for column in _COLUMNS
    }
    return numbers, columns


def existing_folder(folder: str | os.PathLike[str]) -> Path:
    """Return the path of a folder; raise an error if there is none."""
    root = file_path(folder, "folder", "folder")
    if root.exists() and not root.is_dir():
        raise FileError(f"{root} is a file, not a folder")
    if not root.is_dir():
        raise FileError(f"there is no folder {root}")
    return root


def in_one_format(files: Iterable[Path]) -> list[Path]:
    """Return the meshes among files, each in the first of `MESH_ENDINGS`, in natural order."""
    meshes = [file for file in files if file.suffix.lower() in MESH_ENDINGS]
    # The best format comes last and replaces the others.
    meshes.sort(key=lambda file: MESH_ENDINGS.index(file.suffix.lower()), reverse=True)
    file_of_mesh = {file.with_suffix(""): file for file in meshes}
    return sorted(file_of_mesh.values(), key=lambda file: natural_key(str(file.with_suffix(""))))


def no_meshes(root: Path) -> FileError:
    """Return the error for a folder without mesh files."""
    return FileError(f"{root} holds no mesh: no file there ends in {', '.join(MESH_ENDINGS)}")


# More than eight arguments: those of `load_bodies`, passed on.
def _load(
    files: Sequence[Path],
    subjects: Names,
    poses: Names,
    template: Template | str | os.PathLike[str] | None,
    *,
    align: bool,
    scale: str | None = "template",
    unit: str | None = None,
    up: str | None = None,
    seams: str = "join",
    progress: bool = False,
) -> Bodies:
    """Load registered meshes with the names of people and of poses, and those of each mesh."""
    # By default the first body, because the mean of several poses has shrunken arms.
    reference = files[0] if template is None else template
    meshes = RegisteredMeshes(files, reference, scale, unit=unit, up=up, seams=seams)
    if isinstance(reference, Template):
        template = reference
    else:
        try:
            template = Template(meshes.reference, meshes.faces)
        except ArgumentError as error:
            raise type(error)(f"{os.fspath(reference)}: {error}") from error
    bar = tqdm(range(len(meshes)), "Meshes", unit="mesh", disable=not progress)
    points = np.stack([meshes[number] for number in bar])
    if align:
        points = procrustes(points, to=template.vertices, scale=None)
    ids = tuple(without_ending(file.name) for file in files)
    (subject_names, subject), (pose_names, pose) = subjects, poses
    return Bodies(
        points,
        subject,
        pose,
        template,
        subject_names=subject_names,
        pose_names=pose_names,
        ids=ids,
    )


def _numbered(cells: Sequence[str]) -> Names:
    """Return the different texts of a column, and the number of the text of each cell."""
    names = sorted(set(cells), key=natural_key)
    return tuple(names), np.array([names.index(text) for text in cells])
