"""Motions as folders of registered meshes, one file per frame, read on access."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from riemhuman.checks import real_number
from riemhuman.datasets.motions import Motion, Motions
from riemhuman.datasets.registered_meshes import (
    MESH_ENDINGS,
    RegisteredMeshes,
    existing_folder,
    find_meshes,
    natural_key,
)
from riemhuman.errors import FileError


class MeshMotion(Motion):
    """A motion whose frames are the meshes of a folder, in the natural order of their names.

    Parameters
    ----------
    folder : Path
        The folder.
    frames_per_second : float
        Frame rate, which mesh files do not hold.
    unit, up : str, optional
        Unit of the files, and the axis that points up, as for `load_bodies`.

    Raises
    ------
    FileError
        If the folder does not exist or has no meshes.
    """

    def __init__(
        self,
        folder: Path,
        frames_per_second: float = 60.0,
        *,
        unit: str | None = None,
        up: str | None = None,
    ) -> None:
        self._meshes = RegisteredMeshes(find_meshes(folder), unit=unit, up=up)
        n_frames, faces = len(self._meshes), self._meshes.faces
        super().__init__("", folder.name, frames_per_second, n_frames, faces)

    def _frames(self, numbers: range) -> np.ndarray:
        return np.stack([self._meshes[number] for number in numbers])


def load_mesh_motions(
    folder: str | os.PathLike[str],
    frames_per_second: float = 60.0,
    *,
    unit: str | None = None,
    up: str | None = None,
) -> Motions[MeshMotion]:
    """Return the motion in a folder of meshes, or the motions in its subfolders.

    Meshes are the frames, in the natural order of their names (frame_2 before frame_10), and are
    read on access.

    Parameters
    ----------
    folder : path_like
        A folder of meshes, or of folders of meshes.
    frames_per_second : float
        Frame rate, which mesh files do not hold.
    unit, up : str, optional
        Unit of the files, and the axis that points up, as for `load_bodies`.

    Returns
    -------
    Motions
        At least one. The sequence of each is the name of its folder.

    Raises
    ------
    FileError
        If the folder does not exist, or no meshes are found.

    Examples
    --------
    >>> import os
    >>> import riemhuman as rh
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> os.mkdir("knees")
    >>> for k, frame in enumerate(knees[:4]):
    ...     rh.save_mesh(f"knees/frame_{k:04d}.ply", frame, knees.faces)
    >>> rh.datasets.load_mesh_motions("knees")
    <Motions: 1 of 1 people, 1 sequences>
    """
    rate = real_number(frames_per_second, "frames_per_second", minimum=0.0, strict=True)
    root = existing_folder(folder)
    if _holds_meshes(root):
        return Motions([MeshMotion(root, rate, unit=unit, up=up)])
    inner = sorted((each for each in root.iterdir() if each.is_dir()), key=_order)
    motions = [MeshMotion(each, rate, unit=unit, up=up) for each in inner if _holds_meshes(each)]
    if not motions:
        raise FileError(
            f"{root} holds no motion: neither .hdf5 files nor meshes, nor folders of meshes"
        )
    return Motions(motions)


def _holds_meshes(folder: Path) -> bool:
    return any(
        each.suffix.lower() in MESH_ENDINGS and not each.name.startswith(".")
        for each in folder.iterdir()
    )


def _order(folder: Path) -> tuple[object, ...]:
    return natural_key(folder.name)
