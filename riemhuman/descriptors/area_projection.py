"""The multiscale area projection transform, and its histograms as a descriptor."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import rel_entr

from riemhuman.arrays import Array, Booleans, Triangles
from riemhuman.checks import checked, positive, real_array, whole
from riemhuman.descriptors.descriptor import Descriptor, histograms, pairwise, positive_numbers
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.representation import Record
from riemhuman.surfaces.measures import triangle_areas

# Metres: 0.03, 0.05, …, 0.15, from wrists to chests.
_RADII = tuple((0.03 + 0.02 * np.arange(7)).round(2).tolist())
# A grid of more takes gigabytes; surfaces in millimetres would need it.
_MAX_VOXELS = 50_000_000
# Offset of the rays from the voxels' centres, in voxels, so that no ray meets an edge exactly.
_BESIDE = np.array([7.5487767e-7, 5.6984029e-7])


@dataclass(frozen=True, eq=False, repr=False)
class ProjectedAreas(Record):
    """The multiscale area projection transform of one surface.

    Attributes
    ----------
    values : array, shape (n_radii, n_x, n_y, n_z)
        Transform for each radius: 1 at the centre of a sphere of that radius.
    inside : array of bool, shape (n_x, n_y, n_z)
        Whether the surface encloses each voxel.
    origin : array, shape (3,)
        Centre of the voxel (0, 0, 0), in metres.
    voxel_size : float
        Side of a voxel, in metres.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> transform = rh.descriptors.AreaProjectionTransform()
    >>> transform.transform(bodies[0], bodies.template.faces).values.shape[0]
    7
    """

    values: Array
    inside: Booleans
    origin: Array
    voxel_size: float

    @property
    def centers(self) -> Array:
        """Centres of all voxels, shape (n_x, n_y, n_z, 3), in metres."""
        numbers = np.moveaxis(np.indices(self.inside.shape), 0, -1)
        return self.origin + self.voxel_size * numbers


@checked(
    radii=positive_numbers,
    voxel_size=positive,
    ratio=positive,
    n_bins=whole(minimum=2),
    largest=positive,
)
@dataclass(frozen=True)
class AreaProjectionTransform(Descriptor):
    r"""Histograms of the multiscale area projection transform [1]_.

    Every point of the surface moves by a radius R along its inner normal. The transform at a point
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

    def transform(self, vertices: ArrayLike, faces: ArrayLike) -> ProjectedAreas:
        """Return the transform of one surface on a grid of voxels around it.

        Parameters
        ----------
        vertices, faces
            As for `describe`.
        """
        points, triangles = check_mesh(vertices, faces)
        lower, upper = points.min(axis=0), points.max(axis=0)
        margin = self.ratio * max(self.radii) + self.voxel_size
        counts = np.ceil((upper - lower + 2 * margin) / self.voxel_size) + 1
        if counts.prod() > _MAX_VOXELS:
            raise ArgumentError(
                f"a grid of voxels of {self.voxel_size:g} m around the mesh has "
                f"{counts.prod():.3g} of them; the limit is {_MAX_VOXELS:.0e}. Is the mesh in "
                "metres?"
            )
        origin = (lower + upper - self.voxel_size * (counts - 1)) / 2
        shape = tuple(counts.astype(int).tolist())
        # From here on, lengths are in voxels.
        points = (points - origin) / self.voxel_size
        if np.linalg.det(points[triangles] - points.mean(axis=0)).sum() < 0:  # six volumes
            triangles = triangles[:, ::-1]
        samples, normals, areas = _samples(points, triangles)
        values = np.empty((len(self.radii), *shape))
        for i, radius in enumerate(np.array(self.radii) / self.voxel_size):
            arrived = _deposit(samples - radius * normals, areas, shape)
            values[i] = _ball_sums(arrived, self.ratio * radius) / (4 * np.pi * radius**2)
        inside = _enclosed_voxels(points[triangles], shape)
        return ProjectedAreas(values, inside, origin, self.voxel_size)

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        areas = self.transform(vertices, faces)
        if not areas.inside.any():
            raise DegenerateSurfaceError(
                f"the mesh encloses no voxel of side {self.voxel_size:g} m: it is smaller, has "
                "large holes, or no consistent orientation"
            )
        values = areas.values[:, areas.inside]
        volumes = np.full(values.shape[1], self.voxel_size**3)
        return histograms(values, volumes, (0.0, self.largest), self.n_bins)

    def distances(self, vectors: ArrayLike) -> Array:
        shares = real_array(vectors, "vectors", ("n_vectors", "n_numbers"), batched=False)
        if shares.min(initial=0.0) < 0.0:
            raise ArgumentError(
                f"vectors must hold volumes, of at least 0; the smallest is {shares.min():g}"
            )
        return pairwise(shares, _jeffrey)


def _samples(points: Array, faces: Triangles) -> tuple[Array, Array, Array]:
    """Spread points over triangles, a voxel apart; return them with unit normals and areas."""
    # Normals are interpolated, because those of triangles would leave gaps along the edges.
    areas, normals = triangle_areas(points, faces), vertex_normals(points, faces)
    if not areas.any():
        raise DegenerateSurfaceError("no triangle of the mesh has area")
    # The corner opposite the longest side comes first: slivers are cut along their length.
    corners = points[faces]
    opposite = np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1)
    lengths = np.linalg.norm(opposite, axis=2)
    apex = lengths.argmax(axis=1)
    faces = np.take_along_axis(faces, (apex[:, np.newaxis] + np.arange(3)) % 3, axis=1)
    longest = lengths.max(axis=1)
    has_area = areas > 0
    faces, areas, longest = faces[has_area], areas[has_area], longest[has_area]
    # Numbers of cells along the longest side and across it, by the height of the triangle.
    cuts = np.ceil(np.stack([longest, 2 * areas / longest], axis=1)).astype(np.int64)
    sampled_points, sampled_normals, sampled_areas = [], [], []
    for n_along, n_across in np.unique(cuts, axis=0).tolist():
        is_cut_so = (cuts == (n_along, n_across)).all(axis=1)
        corners = faces[is_cut_so]
        weights, shares = _centers_of_cells(n_along, n_across)
        # Sums over the corners c, for each triangle f and each sample s.
        sampled_points.append(np.einsum("sc,fcx->fsx", weights, points[corners]).reshape(-1, 3))
        sampled_normals.append(np.einsum("sc,fcx->fsx", weights, normals[corners]).reshape(-1, 3))
        sampled_areas.append(np.outer(areas[is_cut_so], shares).ravel())
    return (
        np.concatenate(sampled_points),
        unit_vectors(np.concatenate(sampled_normals)),
        np.concatenate(sampled_areas),
    )


def _centers_of_cells(n_along: int, n_across: int) -> tuple[Array, Array]:
    """Return barycentric coordinates of points in rows along the last side, and area shares."""
    along = np.tile((np.arange(n_along) + 0.5) / n_along, n_across)
    across = np.repeat((np.arange(n_across) + 0.5) / n_across, n_along)
    weights = np.stack([across, (1 - across) * (1 - along), (1 - across) * along], axis=1)
    return weights, 2 * (1 - across) / (n_along * n_across)


def _deposit(places: Array, areas: Array, shape: tuple[int, ...]) -> Array:
    """Sum areas over the voxels where they arrive; areas outside the grid are dropped."""
    voxels = np.rint(places).astype(np.int64)
    is_inside = ((voxels >= 0) & (voxels < shape)).all(axis=1)
    numbers = np.ravel_multi_index(tuple(voxels[is_inside].T), shape)
    sums = np.bincount(numbers, areas[is_inside], minlength=math.prod(shape))
    return np.asarray(sums, dtype=np.float64).reshape(shape)


def _ball_sums(values: Array, radius: float) -> Array:
    """Sum values over the ball around every voxel; the rim counts by its share, to first order."""
    from scipy.signal import fftconvolve  # takes long to import

    half = int(np.ceil(radius + 0.5))
    offsets = np.arange(-half, half + 1)
    squares = offsets**2
    distances = np.sqrt(squares[:, None, None] + squares[:, None] + squares)
    kernel = np.clip(radius + 0.5 - distances, 0.0, 1.0)
    # The size of the voxels limits the accuracy more than single precision.
    sums = fftconvolve(values.astype(np.float32), kernel.astype(np.float32), mode="same")
    positive: Array = np.maximum(sums, 0.0)  # in single precision
    return positive


def _jeffrey(p: Array, q: Array) -> float:
    mean = (p + q) / 2
    divergence = float(np.sum(rel_entr(p, mean) + rel_entr(q, mean)))
    return max(divergence, 0.0)  # rounding errors of equal histograms may be negative


def _enclosed_voxels(corners: Array, shape: tuple[int, ...]) -> Booleans:
    """Return which voxels are inside a mesh with corners (F, 3, 3), which may have small holes."""
    # Inside for rays along two of the three axes: a hole matters only if two axes see it.
    votes = np.zeros(shape, dtype=np.int8)
    for axis in range(3):
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        inside = _enclosed_along_last_axis(corners[:, :, order], [shape[i] for i in order])
        votes += np.transpose(inside, np.argsort(order))
    return votes >= 2


def _enclosed_along_last_axis(corners: Array, shape: list[int]) -> Booleans:
    """Return the voxels inside by the signed crossings of rays; corners are in voxels."""
    n_rows, n_columns, n_levels = shape
    # Crossings between a voxel of a ray and the one below it; the last are above all voxels.
    crossings = np.zeros((n_rows, n_columns, n_levels + 1))
    _count_crossings(np.ascontiguousarray(corners), _BESIDE, crossings)
    above = np.cumsum(crossings[:, :, ::-1], axis=2)[:, :, ::-1]
    return above[:, :, 1:] > 0.5


@compiled
def _count_crossings(corners: Array, beside: Array, crossings: Array) -> None:
    """Add, for every ray (row, column) and triangle that it crosses, the sign of the crossing."""
    n_rows, n_columns, n_levels = crossings.shape
    for triangle in corners:
        x, y = triangle[:, 0] - beside[0], triangle[:, 1] - beside[1]
        first_row, last_row = max(math.ceil(x.min()), 0), min(math.floor(x.max()), n_rows - 1)
        first, last = max(math.ceil(y.min()), 0), min(math.floor(y.max()), n_columns - 1)
        for row in range(first_row, last_row + 1):
            for column in range(first, last + 1):
                # Twice the signed areas that the ray spans with each side, opposite to a corner:
                # all have one sign if the ray crosses.
                of_0 = _spanned(x[1] - row, y[1] - column, x[2] - row, y[2] - column)
                of_1 = _spanned(x[2] - row, y[2] - column, x[0] - row, y[0] - column)
                of_2 = _spanned(x[0] - row, y[0] - column, x[1] - row, y[1] - column)
                if not (min(of_0, of_1, of_2) > 0.0 or max(of_0, of_1, of_2) < 0.0):
                    continue
                total = of_0 + of_1 + of_2
                z = triangle[:, 2]
                height = (of_0 * z[0] + of_1 * z[1] + of_2 * z[2]) / total
                level = min(max(math.ceil(height), 0), n_levels - 1)
                crossings[row, column, level] += math.copysign(1.0, total)


@compiled
def _spanned(x_a: float, y_a: float, x_b: float, y_b: float) -> float:
    """Return twice the signed area of a triangle with a corner at the origin."""
    return x_a * y_b - y_a * x_b
