"""The training registrations of MPI FAUST."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np

from riemhuman.datasets.bodies import Bodies
from riemhuman.datasets.registered_meshes import (
    MESH_ENDINGS,
    check_template,
    existing_folder,
    load_registered,
    read_template,
)
from riemhuman.errors import FileError
from riemhuman.representation import join_names
from riemhuman.surfaces.procrustes import procrustes
from riemhuman.surfaces.template import Template

_N_SUBJECTS = 10
_N_POSES = 10
_LEVELS = (".", "registrations", "training/registrations", "MPI-FAUST/training/registrations")


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
    ArgumentError
        If the template has other triangles or another number of vertices than the registrations.
    ArgumentTypeError
        If the folder or the template has the wrong type.

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
    files = _find_registrations(folder)
    if not allow_missing:
        _refuse_missing(files)
    numbers = np.array(sorted(files))
    reference = read_template(template, files[numbers[0]])
    points, faces = load_registered([files[number] for number in numbers])

    check_template(reference, points, faces)
    if align:
        points = procrustes(points, to=reference.vertices, scale=None)
    return Bodies(
        points=points,
        subject=numbers // _N_POSES,
        pose=numbers % _N_POSES,
        template=reference,
        subject_names=tuple(f"subject {i}" for i in range(_N_SUBJECTS)),
        pose_names=tuple(f"pose {i}" for i in range(_N_POSES)),
        ids=tuple(f"tr_reg_{number:03d}" for number in numbers),
    )


def _find_registrations(folder: str | os.PathLike[str]) -> dict[int, Path]:
    """Return the registration files by number, from the first level that holds any."""
    root = existing_folder(folder)
    for level in _LEVELS:
        if not (root / level).is_dir():
            continue
        found: dict[int, Path] = {}
        for file in (root / level).iterdir():
            match = re.fullmatch(r"tr_reg_(0\d\d)", file.stem)
            if match and file.suffix.lower() in MESH_ENDINGS:
                number = int(match[1])
                found[number] = min(found.get(number, file), file, key=_preference)
        if found:
            return found
    raise FileError(
        f"{root} holds no registrations: files named tr_reg_000.ply to tr_reg_099.ply (or .obj, "
        f".off) were looked for in it and in its subfolders {', '.join(_LEVELS[1:])}"
    )


def _preference(file: Path) -> tuple[int, str]:
    """Return a sorting key for files of one registration in several formats."""
    return MESH_ENDINGS.index(file.suffix.lower()), file.name


def _refuse_missing(files: dict[int, Path]) -> None:
    missing = sorted(set(range(_N_SUBJECTS * _N_POSES)) - set(files))
    if missing:
        names = join_names([f"tr_reg_{number:03d}" for number in missing], 5)
        folder = next(iter(files.values())).parent
        raise FileError(
            f"{folder}: {len(missing)} of {_N_SUBJECTS * _N_POSES} registrations are missing: "
            f"{names}; allow_missing=True loads the others"
        )
