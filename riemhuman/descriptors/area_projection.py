"""The multiscale area projection transform, and its histograms as a descriptor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft
from scipy.special import rel_entr

from riemhuman.checks import real_array, real_number, whole_number
from riemhuman.descriptors.descriptor import Descriptor, pairwise
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.representation import Record

_RADII = tuple((0.03 + 0.02 * np.arange(7)).round(2).tolist())
_MAX_VOXELS = 50_000_000
# Offset of the rays from the voxels' centres, in voxels, so that no ray meets an edge exactly.
_BESIDE = np.array([7.5487767e-7, 5.6984029e-7])


@dataclass(frozen=True, eq=False)
class VoxelGrid:
    """Cubes of equal size; voxel (i, j, k) has its centre at origin + spacing * (i, j, k)."""

    origin: np.ndarray
    spacing: float
    shape: tuple[int, int, int]

    @property
    def centers(self) -> np.ndarray:
        """Centres of all voxels, shape (*shape, 3), in metres."""
        return self.origin + self.spacing * np.stack(
            np.meshgrid(*map(np.arange, self.shape), indexing="ij"), axis=-1
        )


@dataclass(frozen=True, eq=False, repr=False)
class ProjectedAreas(Record):
    """The multiscale area projection transform of one surface.

    Attributes
    ----------
    values : array, shape (n_radii, n_x, n_y, n_z)
        Transform for each radius: 1 at the centre of a sphere of that radius.
    inside : array of bool, shape (n_x, n_y, n_z)
        Whether the surface encloses each voxel.
    grid : VoxelGrid
        Positions of the voxels.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> transform = rh.descriptors.AreaProjectionTransform()
    >>> transform.transform(bodies[0], bodies.template.faces).values.shape[0]
    7
    """

    values: np.ndarray
    inside: np.ndarray
    grid: VoxelGrid


@dataclass(frozen=True)
class AreaProjectionTransform(Descriptor):
    r"""Histograms of the multiscale area projection transform [1]_.

    Every point of the surface moves by a radius R along its inner normal. The transform at a place
    is the area of the surface that arrives within a distance σ = cR of it, divided by
    :math:`4\pi R^2`: 1 at the centre of a sphere of radius R, about c on the axis of a cylinder.
    For each radius, the descriptor has a histogram of the values at all enclosed voxels, in cubic
    metres. The distance of histograms p and q is the Jeffrey divergence [2]_
    :math:`\sum p \log(p/m) + q \log(q/m)` with m = (p + q) / 2. The surface may have holes.

    Parameters
    ----------
    radii : sequence of float
        Radii R > 0, in metres.
    voxel_size : float
        Side of a voxel, in metres.
    ratio : float
        The number c = σ / R.
    n_bins : int
        Number of bins of a histogram, of equal width.
    largest : float
        Upper end of the last bin, which also counts larger values.

    References
    ----------
    .. [1] Giachetti, Lovato, "Radial Symmetry Detection and Shape Characterization with the
       Multiscale Area Projection Transform", Computer Graphics Forum 31(5), 2012.
    .. [2] Puzicha, Hofmann, Buhmann, "Non-parametric similarity measures for unsupervised texture
       segmentation and image retrieval", CVPR 1997.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.descriptors.AreaProjectionTransform().describe_all(bodies[:1]).shape
    (1, 168)
    """

    radii: tuple[float, ...] = _RADII
    voxel_size: float = 0.02
    ratio: float = 0.5
    n_bins: int = 24
    largest: float = 1.2

    def __post_init__(self) -> None:
        radii = real_array(self.radii, "radii", ("n_radii",), batched=False)
        if radii.size == 0 or radii.min() <= 0:
            raise ArgumentError(f"radii must be positive numbers; found {radii.tolist()}")
        object.__setattr__(self, "radii", tuple(radii.tolist()))
        for name in ("voxel_size", "ratio", "largest"):
            real_number(getattr(self, name), name, minimum=0.0, strict=True)
        whole_number(self.n_bins, "n_bins", minimum=2)

    def transform(self, vertices: ArrayLike, faces: ArrayLike) -> ProjectedAreas:
        """Return the transform of one surface on a grid of voxels around it.

        Parameters
        ----------
        vertices, faces
            As for `describe`.
        """
        points, triangles = check_mesh(vertices, faces)
        corners = points[triangles]
        middle = points.mean(axis=0)
        if np.linalg.det(corners - middle).sum() < 0:  # six times the volume
            triangles = triangles[:, ::-1]
            corners = points[triangles]
        reach = self.ratio * max(self.radii)
        n_voxels = float(np.prod((np.ptp(points, axis=0) + 2 * reach) / self.voxel_size + 3))
        if n_voxels > _MAX_VOXELS:
            raise ArgumentError(
                f"a grid of voxels of {self.voxel_size:g} m around the mesh has {n_voxels:.3g} of "
                f"them; the limit is {_MAX_VOXELS:.0e}. Is the mesh in metres?"
            )
        grid = _grid_around(points, self.voxel_size, reach + self.voxel_size)

        samples, normals, areas = _samples(points, triangles, self.voxel_size)
        values = np.empty((len(self.radii), *grid.shape))
        for i, radius in enumerate(self.radii):
            arrived = _deposit(samples - radius * normals, areas, grid)
            nearby = _ball_sums(arrived, self.ratio * radius / self.voxel_size)
            values[i] = nearby / (4 * np.pi * radius**2)
        return ProjectedAreas(values, _enclosed_voxels(corners, grid), grid)

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> np.ndarray:
        areas = self.transform(vertices, faces)
        if not areas.inside.any():
            raise DegenerateSurfaceError(
                f"the mesh encloses no voxel of side {self.voxel_size:g} m: it is smaller, has "
                "large holes, or no consistent orientation"
            )
        values = areas.values[:, areas.inside]
        bins = np.clip(values * (self.n_bins / self.largest), 0, self.n_bins - 1).astype(np.int64)
        bins += self.n_bins * np.arange(len(bins))[:, np.newaxis]
        return np.bincount(bins.ravel(), minlength=len(bins) * self.n_bins) * self.voxel_size**3

    def distances(self, vectors: ArrayLike) -> np.ndarray:
        return pairwise(vectors, _jeffrey)


def _samples(
    points: np.ndarray, faces: np.ndarray, spacing: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Spread points over triangles; return them with unit normals and the area of each.

    Normals are interpolated from the vertices: with normals of triangles, the parallel surface
    would have gaps along the edges.
    """
    corners = points[faces]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    crosses = np.cross(opposite[:, 0], opposite[:, 1])
    areas = np.linalg.norm(crosses, axis=1) / 2
    if not areas.any():
        raise DegenerateSurfaceError("no triangle of the mesh has area")
    normals = np.stack(
        [np.bincount(faces.ravel(), np.repeat(column, 3), len(points)) for column in crosses.T],
        axis=1,
    )
    normals = _unit(normals)

    # The corner opposite the longest side comes first: slivers are cut along their length.
    lengths = np.linalg.norm(opposite, axis=2)
    apex = lengths.argmax(axis=1)
    faces = np.take_along_axis(faces, (apex[:, np.newaxis] + np.arange(3)) % 3, axis=1)
    longest = lengths.max(axis=1)
    kept = areas > 0
    faces, areas, longest = faces[kept], areas[kept], longest[kept]
    cuts = np.ceil(np.stack([longest, 2 * areas / longest], axis=1) / spacing).astype(np.int64)
    found = []
    for n_along, n_across in np.unique(cuts, axis=0).tolist():
        chosen = (cuts == (n_along, n_across)).all(axis=1)
        weights, shares = _centers_of_cells(n_along, n_across)
        found.append(
            (
                np.einsum("sc,fcx->fsx", weights, points[faces[chosen]]).reshape(-1, 3),
                np.einsum("sc,fcx->fsx", weights, normals[faces[chosen]]).reshape(-1, 3),
                np.outer(areas[chosen], shares).ravel(),
            )
        )
    places, directions, parts = (np.concatenate(column) for column in zip(*found, strict=True))
    return places, _unit(directions), parts


def _centers_of_cells(n_along: int, n_across: int) -> tuple[np.ndarray, np.ndarray]:
    """Return barycentric coordinates of points spread over a triangle, and their area shares.

    Rows run parallel to the side between the second and the third corner.
    """
    along = np.tile((np.arange(n_along) + 0.5) / n_along, n_across)
    across = np.repeat((np.arange(n_across) + 0.5) / n_across, n_along)
    weights = np.stack([across, (1 - across) * (1 - along), (1 - across) * along], axis=1)
    return weights, 2 * (1 - across) / (n_along * n_across)


def _unit(vectors: np.ndarray) -> np.ndarray:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, where=lengths > 0, out=np.zeros_like(vectors))


def _deposit(places: np.ndarray, areas: np.ndarray, grid: VoxelGrid) -> np.ndarray:
    """Sum areas over the voxels where they arrive; areas outside the grid are dropped."""
    index = np.rint((places - grid.origin) / grid.spacing).astype(np.int64)
    kept = ((index >= 0) & (index < grid.shape)).all(axis=1)
    cell = np.ravel_multi_index(tuple(index[kept].T), grid.shape)
    return np.bincount(cell, areas[kept], minlength=int(np.prod(grid.shape))).reshape(grid.shape)


def _ball_sums(values: np.ndarray, radius: float) -> np.ndarray:
    """Sum values over the ball around every voxel, with the radius in voxels.

    Voxels on the rim count by their share inside the ball, to first order. Single precision is
    enough, since the size of the voxels limits the accuracy.
    """
    half = int(np.ceil(radius + 0.5))
    offsets = np.arange(-half, half + 1)
    squares = offsets**2
    distances = np.sqrt(squares[:, None, None] + squares[:, None] + squares)
    kernel = np.clip(radius + 0.5 - distances, 0.0, 1.0)
    padded = [fft.next_fast_len(length + half, real=True) for length in values.shape]
    spread = np.zeros(padded, dtype=np.float32)
    spread[np.ix_(*[offsets % length for length in padded])] = kernel
    product = fft.rfftn(values.astype(np.float32), padded) * fft.rfftn(spread)
    sums = fft.irfftn(product, padded)[tuple(slice(length) for length in values.shape)]
    return np.maximum(sums, 0.0)


def _jeffrey(p: np.ndarray, q: np.ndarray) -> float:
    return max(float(np.sum(rel_entr(p, (p + q) / 2) + rel_entr(q, (p + q) / 2))), 0.0)


def _grid_around(vertices: np.ndarray, spacing: float, margin: float) -> VoxelGrid:
    """Return the grid that covers the bounding box of points (V, 3), with a margin in metres."""
    lower, upper = vertices.min(axis=0), vertices.max(axis=0)
    counts = np.ceil((upper - lower + 2 * margin) / spacing).astype(int) + 1
    origin = (lower + upper) / 2 - spacing * (counts - 1) / 2
    return VoxelGrid(origin, spacing, (int(counts[0]), int(counts[1]), int(counts[2])))


def _enclosed_voxels(corners: np.ndarray, grid: VoxelGrid) -> np.ndarray:
    """Return whether the centre of each voxel is inside a mesh, given by its corners (F, 3, 3).

    A centre is inside if rays along two of the three axes are, by the sum of signed crossings with
    triangles: a hole in the mesh has an effect only where it is seen along two axes.
    """
    positions = (corners - grid.origin) / grid.spacing
    votes = np.zeros(grid.shape, dtype=np.int8)
    for axis in range(3):
        across = [(axis + 1) % 3, (axis + 2) % 3]
        order = [*across, axis]
        inside = _enclosed_along_last_axis(positions[:, :, order], [grid.shape[i] for i in order])
        votes += np.transpose(inside, np.argsort(order))
    return votes >= 2


def _enclosed_along_last_axis(corners: np.ndarray, shape: list[int]) -> np.ndarray:
    """Return the voxels inside by the signed crossings of rays; corners are in voxels."""
    plane = corners[:, :, :2] - _BESIDE
    first = np.maximum(np.ceil(plane.min(axis=1)), 0).astype(np.int64)
    last = np.minimum(np.floor(plane.max(axis=1)), np.array(shape[:2]) - 1).astype(np.int64)
    widths = np.maximum(last - first + 1, 0)
    counts = widths.prod(axis=1)
    triangle = np.repeat(np.arange(len(corners)), counts)
    number = np.arange(len(triangle)) - np.repeat(np.cumsum(counts) - counts, counts)
    rows = first[triangle, 0] + number // np.maximum(widths[triangle, 1], 1)
    columns = first[triangle, 1] + number % np.maximum(widths[triangle, 1], 1)

    # Signed areas of a ray's triangles with each side: all have one sign if the ray crosses.
    to_corners = plane[triangle] - np.stack([rows, columns], axis=1)[:, np.newaxis]
    following = np.roll(to_corners, -1, axis=1)
    opposite = to_corners[:, :, 0] * following[:, :, 1] - to_corners[:, :, 1] * following[:, :, 0]
    total = opposite.sum(axis=1)
    crosses = ((opposite > 0).all(axis=1) | (opposite < 0).all(axis=1)) & (total != 0)
    # Side i lies opposite to corner i + 2.
    weights = np.roll(opposite[crosses], -1, axis=1) / total[crosses, np.newaxis]
    heights = np.sum(weights * corners[triangle[crosses], :, 2], axis=1)

    below = np.clip(np.ceil(heights).astype(np.int64), 0, shape[2])
    cell = (rows[crosses] * shape[1] + columns[crosses]) * (shape[2] + 1) + below
    crossings = np.bincount(
        cell, np.sign(total[crosses]), minlength=shape[0] * shape[1] * (shape[2] + 1)
    ).reshape(shape[0], shape[1], shape[2] + 1)
    above = np.cumsum(crossings[:, :, ::-1], axis=2)[:, :, ::-1]
    return above[:, :, 1:] > 0.5
