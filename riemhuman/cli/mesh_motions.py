"""Motions as folders of registered meshes, one file a frame, read when they are asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from riemhuman.datasets.motions import Motion
from riemhuman.datasets.registered_meshes import (
    MESH_ENDINGS,
    RegisteredMeshes,
    existing_folder,
    find_meshes,
    natural_key,
)
from riemhuman.errors import FileError

# Files do not say; a basis counts frames, not seconds.
_FRAMES_PER_SECOND = 60.0


class MeshMotion(Motion):
    """A motion whose frames are the meshes of a folder, in natural order of their names.

    Parameters
    ----------
    folder : Path
        The folder.
    unit, up : str, optional
        Unit of the files, and the axis that points up, see `riemhuman.surfaces.upright`.

    Raises
    ------
    FileError
        If there is no such folder, or it holds no mesh.
    """

    def __init__(self, folder: Path, unit: str | None = None, up: str | None = None) -> None:
        self._meshes = RegisteredMeshes(find_meshes(folder), unit=unit, up=up)
        n_frames, faces = len(self._meshes), self._meshes.faces
        super().__init__("", folder.name, _FRAMES_PER_SECOND, n_frames, faces)

    def _frames(self, numbers: range) -> np.ndarray:
        return np.stack([self._meshes[number] for number in numbers])


def mesh_motions(folder: Path, unit: str | None = None, up: str | None = None) -> list[MeshMotion]:
    """Return the motions of a folder: itself, or every subfolder that holds meshes.

    Parameters
    ----------
    folder : Path
        A folder of meshes, or of folders of meshes.
    unit, up : str, optional
        Unit of the files, and the axis that points up, see `riemhuman.surfaces.upright`.

    Returns
    -------
    list of MeshMotion
        At least one.

    Raises
    ------
    FileError
        If there is no such folder, or no meshes are found.
    """
    root = existing_folder(folder)
    if _holds_meshes(root):
        return [MeshMotion(root, unit, up)]
    inner = sorted((each for each in root.iterdir() if each.is_dir()), key=_order)
    motions = [MeshMotion(each, unit, up) for each in inner if _holds_meshes(each)]
    if not motions:
        raise FileError(
            f"{root} holds no motion: neither .hdf5 files nor meshes, nor folders of meshes"
        )
    return motions


def _holds_meshes(folder: Path) -> bool:
    return any(
        each.suffix.lower() in MESH_ENDINGS and not each.name.startswith(".")
        for each in folder.iterdir()
    )


def _order(folder: Path) -> tuple[object, ...]:
    return natural_key(folder.name)
