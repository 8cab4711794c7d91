"""Bodies that SAM 3D Body finds in photographs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from riemhuman.arrays import Array, ArrayLike, Integers, Triangles
from riemhuman.checks import check_human_size, integer_array, items_of, one_of, real_array
from riemhuman.errors import FileFormatError, warn
from riemhuman.io.arrays import load_arrays
from riemhuman.io.files import file_path, format_errors, natural_key, visible_files
from riemhuman.io.kinds_of_files import AFTER, BY_MAP, FileKind, reads
from riemhuman.io.mesh_arrays import check_mesh, distinct_pairs
from riemhuman.io.meshes import WRITTEN_SUFFIXES, load_mesh
from riemhuman.kernels.surface import unit_vectors
from riemhuman.surfaces.measures import vertex_components
from riemhuman.surfaces.procrustes import AXES, make_upright

_VERTICES = "pred_vertices"
# Cosine of the direction from the feet to the middle of a body with an axis that surely points up.
_SURELY_UP = 0.3
# The same if all six axes are possible.
_STANDS = 0.8
_N_EXTREMITIES = 5
_TRANSLATION = "pred_cam_t"


@dataclass(frozen=True, eq=False)
class PhotographedBodies:
    """Bodies found in photographs, upright.

    Attributes
    ----------
    points : array, shape (n, V, 3)
        Surfaces, metres, y up. Their size is a guess of the method, because a photograph does not
        show it.
    faces : array of int, shape (F, 3)
    names : tuple of str
        The name of the file of each surface.
    translations : array, shape (n, 3), or None
        Positions in front of the camera, metres, in its axes: x right, y down, z forward; None if
        some file lacks them.
    up : str
        Axis of the files that points up.

    Examples
    --------
    >>> bodies = rh.datasets.load_photographed_bodies("a.npz", "face_mask.ply")  # doctest: +SKIP
    """

    points: Array
    faces: Triangles
    names: tuple[str, ...]
    translations: Array | None
    up: str = "-y"

    @property
    def places(self) -> Array:
        """Surfaces in the camera's view, metres, y up; those of `points` if it is unknown."""
        if self.translations is None:
            return self.points
        return self.points + turn_upright(self.translations, self.up)[:, np.newaxis]

    def __len__(self) -> int:
        return len(self.points)


@reads(
    FileKind(
        "bodies of SAM 3D Body, with `faces=`",
        "datasets.load_photographed_bodies",
        (".npz",),
        registered=BY_MAP,
        measured=AFTER,
        written=WRITTEN_SUFFIXES,
    )
)
def load_photographed_bodies(
    paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    faces: ArrayLike | os.PathLike[str],
    *,
    up: str | None = None,
) -> PhotographedBodies:
    """Read bodies of SAM 3D Body, and turn them upright.

    Parameters
    ----------
    paths : path_like or sequence of path_like
        ``.npz`` files with ``pred_vertices``, shape (V, 3) or (n, V, 3), metres. A folder means all
        ``.npz`` files in it.
    faces : array_like of int, shape (F, 3), or path_like
        Triangles, which the files lack: the output ``faces`` of the method, or a mesh file with the
        vertices in the same order, such as the one in the tools of its body model.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up. The method writes bodies with y down, but other tools turn them. By
        default, the feet show whether "-y" or "y" points up. If this is ambiguous, because people
        are lying, "-y" is assumed, and a warning says so.

    Raises
    ------
    FileFormatError
        If a file holds no such bodies, or if the bodies have another number of vertices, are not
        finite, or are mirrored.

    Examples
    --------
    >>> coarse = rh.datasets.load_open_bodies("coarse")
    >>> rh.io.save_arrays("photograph.npz", {"pred_vertices": coarse[0] * [1.0, -1.0, -1.0]})
    >>> faces = coarse.template.faces
    >>> rh.datasets.load_photographed_bodies("photograph.npz", faces).up
    '-y'
    """
    one_of(up, "up", (None, *AXES))
    files = _files(paths)
    triangles = _triangles(faces)
    arrays_of_files = [load_arrays(file, [_VERTICES], [_TRANSLATION]) for file in files]
    points: list[Array] = []
    names: list[str] = []
    n_vertices = int(triangles.max()) + 1
    for file, arrays in zip(files, arrays_of_files, strict=True):
        with format_errors(file, "bodies of SAM 3D Body"):
            surfaces = np.asarray(real_array(arrays[_VERTICES], _VERTICES, ("V", 3)), dtype=float)
            if surfaces.shape[-2] != n_vertices or surfaces.ndim > 3:
                raise FileFormatError(
                    f"{file}: {_VERTICES} has shape {surfaces.shape}; faces refer to "
                    f"{n_vertices:,} vertices, so (n, {n_vertices}, 3) is expected"
                )
            bodies = surfaces.reshape(-1, n_vertices, 3)
            check_mesh(bodies[0], triangles)
            for body in bodies:
                check_human_size(float(np.ptp(body, axis=0).max()), np.nan, _VERTICES)
            refuse_mirrored(bodies, triangles, str(file))
        points.append(bodies)
        names += [file.stem] * len(bodies)
    surfaces = np.concatenate(points)
    up = _upward_axis(surfaces, triangles, str(files[0])) if up is None else up
    return PhotographedBodies(
        points=turn_upright(surfaces, up=up),
        faces=triangles,
        names=tuple(names),
        translations=_translations(arrays_of_files),
        up=up,
    )


def turn_upright(points: Array, up: str) -> Array:
    """Return points y up; of people who look at a camera with y down, the front towards z."""
    return points * [1.0, -1.0, -1.0] if up == "-y" else make_upright(points, up=up)


def standing_axis(surface: Array, faces: Triangles) -> str:
    """Return the axis that points up in a body, away from its feet; "y" if it stands along none."""
    (upward,) = _away_from_feet(surface[np.newaxis], faces)
    number = int(np.abs(upward).argmax())
    if abs(upward[number]) < _STANDS:
        return "y"
    axis = "xyz"[number]
    return f"-{axis}" if upward[number] < 0 else axis


def _away_from_feet(surfaces: Array, faces: Triangles) -> Array:
    """Return the directions from the feet to the middle of bodies, shape (n, 3)."""
    body = _largest_part(faces, surfaces.shape[1])
    feet = _find_feet(surfaces[0], faces, body)
    return unit_vectors(surfaces[:, body].mean(axis=1) - surfaces[:, feet].mean(axis=1))


def _upward_axis(surfaces: Array, faces: Triangles, name: str) -> str:
    """Return which direction of y points up in most bodies: away from their feet."""
    cosine = float(np.median(_away_from_feet(surfaces, faces)[:, 1]))
    if abs(cosine) < _SURELY_UP:
        warn(
            f"{name}: -y was taken to point up, as in SAM 3D Body, but the people may be lying: "
            "pass up='-y', or the axis that points up",
            UserWarning,
        )
    return "y" if cosine > _SURELY_UP else "-y"


def _largest_part(faces: Triangles, n_vertices: int) -> Integers:
    """Return the vertices of the largest connected part, without eyes and teeth."""
    labels = vertex_components(faces, n_vertices)
    return np.flatnonzero(labels == np.bincount(labels).argmax())


def _find_feet(points: Array, faces: Triangles, body: Integers) -> Integers:
    """Return a vertex at the tip of each foot: extremities farthest, along edges, from others."""
    starts, ends = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    pairs, _, _ = distinct_pairs(np.sort(np.stack([starts, ends], axis=1), axis=1))
    lengths = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    graph = sparse.coo_array((lengths, tuple(pairs.T)), (len(points),) * 2).tocsr()
    nearest = dijkstra(graph, directed=False, indices=body[0])
    tips: list[int] = []
    rows = []
    for _ in range(_N_EXTREMITIES):
        tips.append(int(body[nearest[body].argmax()]))
        rows.append(dijkstra(graph, directed=False, indices=tips[-1]))
        nearest = np.min(rows, axis=0)
    sums = np.array(rows)[:, tips].sum(axis=1)
    return np.array(tips)[np.argsort(sums)[-2:]]


def _files(paths: str | os.PathLike[str] | Sequence[str | os.PathLike[str]]) -> list[Path]:
    several: Sequence[str | os.PathLike[str]] = (
        [paths]
        if isinstance(paths, (str, os.PathLike))
        else items_of(paths, "paths", "a path or a list of paths")
    )
    files: list[Path] = []
    for path in several:
        place = file_path(path, "paths")
        if not place.is_dir():
            files.append(place)
            continue
        contents = visible_files(place, ".npz")
        if not contents:
            raise FileFormatError(f"{place} holds no .npz file of SAM 3D Body")
        files += sorted(contents, key=lambda file: natural_key(file.name))
    if not files:
        raise FileFormatError("paths holds no file of SAM 3D Body; at least one is needed")
    return files


def _triangles(faces: ArrayLike | os.PathLike[str]) -> Triangles:
    if isinstance(faces, (str, os.PathLike)):
        return load_mesh(faces)[1]
    return np.asarray(integer_array(faces, "faces", ("F", 3)))


def refuse_mirrored(
    surfaces: Array, faces: Triangles, name: str, error: type[Exception] = FileFormatError
) -> None:
    """Raise an error if the triangles of a body, of shape (n, V, 3), look inward."""
    centred = surfaces - surfaces.mean(axis=1, keepdims=True)
    a, b, c = (centred[:, corner] for corner in faces.T)
    volumes = np.einsum("nfx,nfx->n", a, np.cross(b, c))  # six times the signed volumes
    if np.any(volumes < 0):
        raise error(
            f"{name}: the triangles of body {int(np.argmin(volumes))} look inward: it is mirrored, "
            "or faces belong to other vertices"
        )


def _translations(arrays_of_files: list[dict[str, Array]]) -> Array | None:
    """Return the translations of all bodies, shape (n, 3), if every file has them."""
    if any(_TRANSLATION not in arrays for arrays in arrays_of_files):
        return None
    parts = [real_array(arrays[_TRANSLATION], _TRANSLATION) for arrays in arrays_of_files]
    return np.concatenate([np.atleast_2d(part) for part in parts]).astype(float)
