"""Points of a scan ready for registration: evenly spread, with outward normals, no background."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import ndimage, sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.registration.scans import (
    FEWEST_POINTS,
    Scan,
    find_inward_triangles,
    oriented_alike,
)
from riemhuman.surfaces.measures import vertex_components

# A fit gains nothing from more points.
_MOST_POINTS = 20_000
_FIRST_POINTS = 80_000
# Only vertices are matched, so triangles of this size, such as those that close soles, are split;
# larger ones are floors or strays. Metres.
_LONG_EDGE, _LONGEST_EDGE = 0.05, 0.3

# Points farther from the median than this are strays.
_FAR_METRES = 10.0
# A loose point is sparse if its so-manieth neighbour is farther than this, and this multiple of the
# usual distance.
_N_CLOSE, _SPARSE_METRES, _SPARSE = 6, 0.03, 3.0
_CELL_METRES = 0.05
# Separate parts with a smaller share of the points count as strays.
_STRAY = 0.004
_FLOOR_METRES, _NEAR_FLOOR_METRES = 0.01, 0.02
_FLOOR_SHARE, _ABOVE_FLOOR = 0.04, 0.97
_N_PLANES = 200

_N_NEIGHBOURS = 14
_NORMAL_METRES = 0.03
# A mesh has no consistent side if more than this share of its edges join triangles that face
# different sides.
_MIXED = 0.05

# Number of bodies that are fitted at once.
N_THREADS = 2
# Distance in metres that counts as much as a rotation of the normal by a radian.
_MATCHED_NORMAL_METRES = 0.05
# Number of scan points in an average, against noise.
_N_MATCHED = 4
_BLUR_METRES = 0.008
# Number of points from which noise is estimated, and the median of |x| for a standard normal x.
_N_NOISE, _MEDIAN = 3000, 0.6745
# One unit of a coefficient counts as much as one point of the scan that lies so far off: the fewer
# points, the more the prior counts.
_PRIOR_METRES = 0.02


class Matches(NamedTuple):
    """The points of a scan that match the points of a body."""

    gaps: np.ndarray  # (n, 3) vectors from the points of the body to their matches, metres
    normals: np.ndarray  # (n, 3) normals of the scan at the matches
    weights: np.ndarray  # (n,) reliability of each match, between 0 and 1


@dataclass(frozen=True, eq=False)
class PreparedScan:
    """Evenly spread points of a scan, ready for registration."""

    points: np.ndarray
    normals: np.ndarray
    background: np.ndarray  # (N,) which points of the whole scan are floor or strays
    whole: Scan
    up: np.ndarray | None = None  # direction up, if it is known
    floor: tuple[np.ndarray, float] | None = None  # its upward normal, and its height along this
    estimated: bool = False  # whether the normals were estimated from the points alone
    parts: np.ndarray | None = None  # (n,) connected parts of a mesh that has several
    signed: bool = True  # whether the signs of the normals are known
    landmarks: Mapping[int, np.ndarray] = field(default_factory=dict)  # positions of joints

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(np.concatenate([self.points, _MATCHED_NORMAL_METRES * self.normals], axis=1))

    @property
    def prior_weight(self) -> float:
        """The weight of the prior, square metres."""
        return _PRIOR_METRES**2 / len(self.points)

    @cached_property
    def noise(self) -> float:
        """The standard deviation of the points along their normals, metres."""
        # On a circle, the chord between two points is perpendicular to the mean of their normals,
        # so what is left of it along this mean is noise.
        chosen = np.linspace(0, len(self.points) - 1, _N_NOISE).astype(int)
        near = self._tree.query(self._tree.data[chosen], k=5)[1][:, 1:]
        chords = self.points[near] - self.points[chosen, np.newaxis]
        means = 0.5 * (self.normals[near] + self.normals[chosen, np.newaxis])
        heights = np.einsum("nkx,nkx->nk", chords, means)
        return float(np.median(np.abs(heights))) / (_MEDIAN * np.sqrt(2.0))

    def match(self, points: np.ndarray, normals: np.ndarray, scale: float) -> Matches:
        """Match the points of a body; a match at distance `scale` has a quarter of the weight."""
        places = np.concatenate([points, _MATCHED_NORMAL_METRES * normals], axis=1)
        far, near = self._tree.query(places, k=_N_MATCHED, workers=N_THREADS)
        shares = np.exp(-0.5 * (far**2 - far[:, :1] ** 2) / _BLUR_METRES**2)
        shares /= shares.sum(axis=1, keepdims=True)
        gaps = np.einsum("nk,nkx->nx", shares, self.points[near]) - points
        mean_normals = unit_vectors(np.einsum("nk,nkx->nx", shares, self.normals[near]))
        cosines = np.einsum("nx,nx->n", mean_normals, normals)
        weights = (scale**2 / (np.sum(gaps**2, axis=1) + scale**2)) ** 2
        weights *= np.clip(cosines, 0.0, 1.0)
        if self.floor is not None:  # soles that it hides are at least not below it
            up, height = self.floor
            depths = height - points @ up
            below = depths > 0.0
            gaps[below], mean_normals[below] = depths[below, np.newaxis] * up, up
            weights[below] = 1.0
        return Matches(gaps, mean_normals, weights)


def prepare_scan(scan: Scan, *, surroundings: bool = True) -> PreparedScan:
    """Return the points of the body, spread evenly, with normals."""
    rng = np.random.default_rng(0)
    everything, faces, all_normals = scan.points, scan.faces, scan.normals
    numbers = np.arange(len(everything))
    estimated = all_normals is None
    if faces is not None:
        estimated = bool(np.sum(~oriented_alike(faces)[1]) > _MIXED * 3 * len(faces))
        everything, faces = _outward_fine_mesh(everything, faces)
        all_normals = vertex_normals(everything, faces)
        numbers = np.unique(faces)
    if len(numbers) > _FIRST_POINTS:
        numbers = np.sort(rng.choice(numbers, _FIRST_POINTS, replace=False))
    background = np.abs(everything - np.median(scan.points, axis=0)).max(axis=1) > _FAR_METRES
    numbers = numbers[~background[numbers]]
    numbers = numbers[thin_points(everything[numbers], _MOST_POINTS, rng)]
    points = everything[numbers]
    if all_normals is None or estimated:
        normals = estimate_normals(points)
    else:
        normals = smooth_normals(points, all_normals[numbers])
        if faces is None and np.sum((points - points.mean(axis=0)) * normals) < 0:
            normals = -normals
    if not surroundings:
        return PreparedScan(points, normals, background[: len(scan)], scan, estimated=estimated)
    floor = _find_floor(points, normals, rng)
    if floor is not None:
        background |= everything @ floor[0] < floor[1] + _NEAR_FLOOR_METRES
    if faces is None:
        background |= _find_sparse_points(everything, ~background)
    background |= _find_strays(everything, ~background)
    keep = ~background[numbers]
    if keep.sum() < FEWEST_POINTS:
        raise ArgumentError(
            f"scan has {int(keep.sum())} points without the floor and strays; at least "
            f"{FEWEST_POINTS} are needed"
        )
    points, normals = points[keep], normals[keep]
    parts = None
    if estimated and background.any():
        normals = estimate_normals(points)  # the background may have flipped signs
    elif faces is not None:
        parts = vertex_components(faces, len(everything))[numbers[keep]]
    up = None if floor is None else floor[0]
    return PreparedScan(points, normals, background[: len(scan)], scan, up, floor, estimated, parts)


def _outward_fine_mesh(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a mesh whose triangles face outward, and its large triangles split."""
    inward = find_inward_triangles(points, faces)
    faces = np.where(inward[:, np.newaxis], faces[:, ::-1], faces)
    while len(points) < _FIRST_POINTS:
        corners = points[faces]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        large = (longest > _LONG_EDGE) & (longest < _LONGEST_EDGE)
        if not large.any():
            break
        points, parts = split_triangles(points, faces[large])
        faces = np.concatenate([faces[~large], parts])
    return points, faces


def split_triangles(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the surface with every triangle cut into four."""
    sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, numbers = np.unique(sides, axis=0, return_inverse=True)
    a, b, c = faces.T
    ab, bc, ca = (len(points) + numbers.reshape(-1, 3)).T
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    middles = points[edges].mean(axis=1)
    return np.concatenate([points, middles]), np.array(parts).transpose(2, 0, 1).reshape(-1, 3)


def _find_floor(
    points: np.ndarray, normals: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, float] | None:
    """Return the upward normal and the height of a wide plane with all other points above it."""
    best, support = None, _FLOOR_SHARE * len(points)
    for start in rng.choice(len(points), min(_N_PLANES, len(points)), replace=False):
        across = normals[start]
        heights = points @ across
        near = np.abs(heights - heights[start]) < _FLOOR_METRES
        near &= np.abs(normals @ across) > 0.9
        if near.sum() > support:
            best, support = start, near.sum()
    if best is None:
        return None
    up = normals[best]
    near = np.abs((points - points[best]) @ up) < _FLOOR_METRES
    centre = points[near].mean(axis=0)
    up = np.linalg.svd(points[near] - centre, full_matrices=False)[2][2]
    heights = (points - centre) @ up
    if np.median(heights[~near]) < 0:
        up, heights = -up, -heights
    above = heights[~near] > -_NEAR_FLOOR_METRES
    spread = points[near].std(axis=0)
    is_wide = np.sort(spread)[1] > 0.2
    if above.mean() < _ABOVE_FLOOR or not is_wide:
        return None
    return up, float(centre @ up)


def _find_sparse_points(points: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return which loose points are far from their neighbours: remnants of floors and stands."""
    sparse_points = np.zeros(len(points), dtype=bool)
    chosen = points[wanted]
    distances = cKDTree(chosen).query(chosen, k=min(_N_CLOSE + 1, len(chosen)))[0][:, -1]
    sparse_points[wanted] = distances > max(_SPARSE_METRES, _SPARSE * np.median(distances))
    return sparse_points


def _find_strays(points: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return which points belong to small separate parts."""
    strays = np.zeros(len(points), dtype=bool)
    chosen = points[wanted]
    if not len(chosen):
        return strays
    low, high = np.percentile(chosen, [0.5, 99.5], axis=0)
    low, high = low - 0.5, high + 0.5
    inside = ((chosen >= low) & (chosen <= high)).all(axis=1)
    cells = np.floor((chosen[inside] - low) / _CELL_METRES).astype(np.int64)
    grid = np.zeros(np.ceil((high - low) / _CELL_METRES).astype(int) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    labels, _ = ndimage.label(grid, structure=np.ones((3, 3, 3)))
    own = labels[tuple(cells.T)]
    sizes = np.bincount(own)
    is_stray = np.ones(len(chosen), dtype=bool)
    is_stray[inside] = sizes[own] < _STRAY * len(chosen)
    strays[wanted] = is_stray
    return strays


def estimate_normals(points: np.ndarray) -> np.ndarray:
    """Return outward normals of loose points on a surface."""
    n = len(points)
    neighbours = cKDTree(points).query(points, k=min(_N_NEIGHBOURS, n))[1]
    around = points[neighbours] - points[neighbours].mean(axis=1, keepdims=True)
    spread = np.einsum("nkx,nky->nxy", around, around)
    normals = np.linalg.eigh(spread)[1][:, :, 0]

    first = np.repeat(np.arange(n), neighbours.shape[1] - 1)
    second = neighbours[:, 1:].ravel()
    cosines = np.einsum("ex,ex->e", normals[first], normals[second])
    graph = sparse.csr_array((1.001 - np.abs(cosines), (first, second)), shape=(n, n))
    tree = csgraph.minimum_spanning_tree(graph.maximum(graph.T))
    tree = tree + tree.T
    n_parts, part = csgraph.connected_components(tree, directed=False)
    parents = np.arange(n)
    for number in range(n_parts):
        start = int(np.argmax(part == number))
        order, before = csgraph.breadth_first_order(tree, start, directed=False)
        parents[order[1:]] = before[order[1:]]
    # Each sign is relative to the parent, then to an ancestor twice as far in every round.
    signs = np.where(np.einsum("nx,nx->n", normals, normals[parents]) < 0, -1.0, 1.0)
    while np.any(parents != parents[parents]):
        signs, parents = signs * signs[parents], parents[parents]
    normals *= signs[:, np.newaxis]
    counts = np.bincount(part)
    means = np.stack([np.bincount(part, x) / counts for x in points.T], axis=1)
    outward = np.bincount(part, np.einsum("nx,nx->n", points - means[part], normals))
    return np.where(outward < 0, -1.0, 1.0)[part][:, np.newaxis] * normals


def smooth_normals(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return normals averaged over neighbours with similar normals."""
    places = np.concatenate([points, _NORMAL_METRES * normals], axis=1)
    neighbours = cKDTree(places).query(places, k=min(_N_NEIGHBOURS, len(points)))[1]
    return unit_vectors(normals[neighbours].mean(axis=1))


def thin_points(points: np.ndarray, n_points: int, rng: np.random.Generator) -> np.ndarray:
    """Return the numbers of about a given number of points, spread evenly, in ascending order."""
    # One in each cube of a grid, whose width is found by bisection.
    if len(points) <= n_points:
        return np.arange(len(points))
    order = rng.permutation(len(points))
    shuffled = points[order] - points.min(axis=0)
    low, high = 0.0, float(shuffled.max())
    # The first estimate assumes a surface, where the number of cubes grows as 1/width².
    width = high / np.sqrt(n_points)
    best: np.ndarray = order[:n_points]
    for _ in range(12):
        cubes = (shuffled / width).astype(np.int64)
        extent = cubes.max(axis=0) + 1
        keys = (cubes[:, 0] * extent[1] + cubes[:, 1]) * extent[2] + cubes[:, 2]
        first = np.unique(keys, return_index=True)[1]
        best = order[first]
        if abs(len(first) - n_points) <= 0.03 * n_points:
            break
        low, high = (low, width) if len(first) < n_points else (width, high)
        width = np.clip(width * np.sqrt(len(first) / n_points), 0.0, None)
        if not low < width < high:
            width = 0.5 * (low + high)
    return np.sort(best)
