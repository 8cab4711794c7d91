"""Motions in folders of meshes, a mesh for each frame."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from riemhuman.arrays import Array
from riemhuman.checks import checked_rate
from riemhuman.datasets.registered_meshes import (
    MESH_ENDINGS,
    RegisteredMeshes,
    existing_folder,
    find_meshes,
)
from riemhuman.errors import FileError
from riemhuman.io.files import natural_key, visible_files
from riemhuman.io.kinds_of_files import BY_MAP, YES, FileKind, reads
from riemhuman.mocap.motions import Motion, Motions


class MeshMotion(Motion):
    """A motion whose frames are the meshes of a folder, in the natural order of their names."""

    def __init__(self, folder: Path, rate: float, unit: str | None, up: str | None) -> None:
        self._meshes = RegisteredMeshes(find_meshes(folder), unit=unit, up=up)
        super().__init__("", folder.name, rate, len(self._meshes), self._meshes.faces)

    def _frames(self, numbers: range) -> Array:
        return np.stack([self._meshes[number] for number in numbers])


@reads(
    FileKind(
        "a folder of motions, each a folder of meshes",
        "datasets.load_mesh_motions",
        MESH_ENDINGS,
        registered=YES,
        measured=BY_MAP,
        is_motion=True,
        written=(".glb",),
    )
)
def load_mesh_motions(
    folder: str | os.PathLike[str],
    frames_per_second: float = 60.0,
    *,
    unit: str | None = None,
    up: str | None = None,
) -> Motions[MeshMotion]:
    """Return the motion in a folder of meshes, or the motions in its subfolders.

    Meshes are the frames, in the natural order of their names (frame_2 before frame_10), and are
    read on access. The sequence of a motion is the name of its folder.

    Parameters
    ----------
    folder : path_like
        A folder of meshes, or of folders of meshes.
    frames_per_second : float
        Frame rate, which mesh files do not contain.
    unit, up : str, optional
        Unit of the files, and the axis that points up, as for `load_bodies`.

    Examples
    --------
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> for k, frame in enumerate(knees[:4]):
    ...     rh.save_mesh(f"frame_{k:04d}.ply", frame, knees.faces)
    >>> rh.datasets.load_mesh_motions(".")
    <Motions: 1 of 1 people, 1 sequences>
    """
    rate = checked_rate(frames_per_second)
    root = existing_folder(folder)
    if _holds_meshes(root):
        folders = [root]
    else:
        places = [place for place in root.iterdir() if not place.name.startswith(".")]
        folders = [place for place in places if place.is_dir() and _holds_meshes(place)]
        folders.sort(key=lambda folder: natural_key(folder.name))
    if not folders:
        raise FileError(
            f"{root} holds no motion: neither .hdf5 files nor meshes, nor folders of meshes"
        )
    return Motions(MeshMotion(subfolder, rate, unit, up) for subfolder in folders)


def _holds_meshes(folder: Path) -> bool:
    return bool(visible_files(folder, *MESH_ENDINGS))
