"""Bodies that SAM 3D Body finds in photographs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from riemhuman.checks import check_human_size, integer_array, real_array
from riemhuman.datasets.registered_meshes import natural_key
from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import load_arrays
from riemhuman.io.files import file_path, format_errors
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.io.meshes import load_mesh
from riemhuman.surfaces.procrustes import make_upright

_VERTICES = "pred_vertices"
_OPTIONAL = ("pred_cam_t", "pred_keypoints_3d", "shape_params")


@dataclass(frozen=True, eq=False)
class PhotographedBodies:
    """Bodies found in photographs, upright.

    Attributes
    ----------
    points : array, shape (n, V, 3)
        Surfaces, metres, y up. Their size is the method's guess: a photograph does not show it.
    faces : array of int, shape (F, 3)
    names : tuple of str
        The name of the file of each surface.
    keypoints : array, shape (n, K, 3), or None
        Positions of keypoints in the same axes.
    translations : array, shape (n, 3), or None
        Positions before the camera, metres, in its axes: x right, y down, z forward.
    shapes : array, shape (n, S), or None
        Shape parameters of the method's own model, which riemhuman does not use.
    missing : tuple of str
        Fields that some file lacks.

    Examples
    --------
    >>> bodies = rh.datasets.load_photographed_bodies("a.npz", "face_mask.ply")  # doctest: +SKIP
    """

    points: np.ndarray
    faces: np.ndarray
    names: tuple[str, ...]
    keypoints: np.ndarray | None
    translations: np.ndarray | None
    shapes: np.ndarray | None
    missing: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.points)


def load_photographed_bodies(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]], faces: Any
) -> PhotographedBodies:
    """Read bodies of SAM 3D Body, and turn them upright.

    Parameters
    ----------
    paths : path_like or sequence of path_like
        ``.npz`` files with ``pred_vertices``, shape (V, 3) or (n, V, 3): metres, y down. A folder
        stands for all its ``.npz`` files.
    faces : array_like of int, shape (F, 3), or path_like
        Triangles, which the files lack: the output ``faces`` of the method, or a mesh file with
        its vertices in their order, such as the one of the tools of its body model.

    Raises
    ------
    FileFormatError
        If a file holds no such bodies, if their number of vertices is another, if they are not
        finite, or if they are mirrored.

    Examples
    --------
    >>> coarse = rh.datasets.load_open_bodies("coarse")
    >>> rh.io.save_arrays("photograph.npz", {"pred_vertices": coarse[0] * [1.0, -1.0, -1.0]})
    >>> faces = coarse.template.faces
    >>> rh.datasets.load_photographed_bodies("photograph.npz", faces).missing
    ('pred_cam_t', 'pred_keypoints_3d', 'shape_params')
    """
    files = _files(paths)
    triangles = _triangles(faces)
    read = [load_arrays(file, [_VERTICES], _OPTIONAL) for file in files]
    points, names = [], []
    n_vertices = int(triangles.max()) + 1
    for file, arrays in zip(files, read, strict=True):
        with format_errors(file, "bodies of SAM 3D Body"):
            surfaces = np.asarray(real_array(arrays[_VERTICES], _VERTICES, ("V", 3)), dtype=float)
            if surfaces.shape[-2] != n_vertices or surfaces.ndim > 3:
                raise FileFormatError(
                    f"{file}: {_VERTICES} has shape {surfaces.shape}; faces number "
                    f"{n_vertices:,} vertices, so that (n, {n_vertices}, 3) is expected"
                )
            own = make_upright(surfaces.reshape(-1, n_vertices, 3), up="-y")
            check_mesh(own[0], triangles)
            for body in own:
                check_human_size(float(np.ptp(body, axis=0).max()), np.nan, _VERTICES)
            _refuse_mirrored(own, triangles, str(file))
        points.append(own)
        names += [file.stem] * len(own)
    missing = tuple(name for name in _OPTIONAL if any(name not in arrays for arrays in read))
    keypoints = _joined(read, "pred_keypoints_3d", 3)
    return PhotographedBodies(
        points=np.concatenate(points),
        faces=triangles,
        names=tuple(names),
        keypoints=None if keypoints is None else make_upright(keypoints, up="-y"),
        translations=_joined(read, "pred_cam_t", 2),
        shapes=_joined(read, "shape_params", 2),
        missing=missing,
    )


def _files(paths: Any) -> list[Any]:
    several = [paths] if isinstance(paths, (str, os.PathLike)) else list(paths)
    files = []
    for each in several:
        place = file_path(each)
        found = sorted(place.glob("*.npz"), key=lambda file: natural_key(file.name))
        if place.is_dir() and not found:
            raise FileFormatError(f"{place} holds no .npz file of SAM 3D Body")
        files += found if place.is_dir() else [place]
    if not files:
        raise FileFormatError("paths holds no file of SAM 3D Body; at least one is needed")
    return files


def _triangles(faces: Any) -> np.ndarray:
    if isinstance(faces, (str, os.PathLike)):
        return load_mesh(faces)[1]
    return np.asarray(integer_array(faces, "faces", ("F", 3)))


def _refuse_mirrored(surfaces: np.ndarray, faces: np.ndarray, name: str) -> None:
    centred = surfaces - surfaces.mean(axis=1, keepdims=True)
    one, two, three = (centred[:, corner] for corner in faces.T)
    volumes = np.einsum("nfx,nfx->n", one, np.cross(two, three))
    if np.any(volumes < 0):
        raise FileFormatError(
            f"{name}: the triangles of body {int(np.argmin(volumes))} look inward: it is mirrored, "
            "or faces belong to other vertices"
        )


def _joined(read: list[dict[str, np.ndarray]], name: str, axes: int) -> np.ndarray | None:
    """Return an array of all bodies, if every file has it."""
    if any(name not in arrays for arrays in read):
        return None
    parts = [np.asarray(real_array(arrays[name], name), dtype=float) for arrays in read]
    return np.concatenate([part if part.ndim == axes else part[np.newaxis] for part in parts])
