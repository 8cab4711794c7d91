"""Points of a scan ready for registration: evenly spread, with outward normals, no background.

In goes a `Scan` in metres; out comes a `PreparedScan`, which also finds the closest points.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import ConvexHull, cKDTree

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.registration._constants import (
    ABOVE_FLOOR,
    BLUR_METRES,
    CELL_QUANTILE,
    CROWDED,
    FEW_SPARSE,
    FEW_STRAYS,
    FIRST_POINTS,
    FLOOR_METRES,
    FLOOR_SHARE,
    IN_PLANE,
    LARGEST_STRAY,
    LEAST_OUTSIDE,
    LEAST_RESTING,
    LEAST_WIDTH,
    LONELY_METRES,
    LONG_EDGE,
    LONGEST_EDGE,
    MATCH_NORMAL_METRES,
    MATCHED_METRES,
    MIXED_TRIANGLES,
    MOST_PLANES,
    N_CLOSE,
    N_DENSE,
    N_MATCHED,
    N_NORMAL_NEIGHBOURS,
    N_PLANES,
    NEAR_CLOTHED_METRES,
    NEAR_FLOOR_METRES,
    NEAR_METRES,
    ON_LINE,
    OUTLINE_METRES,
    PRIOR_METRES,
    RESTING_METRES,
    SAME_WAY,
    SPARSE_METRES,
    SPARSE_SPACINGS,
    SPARSER_SPACINGS,
    STRAY_METRES,
    STRAY_REACH,
    WIDEST_CELL,
    WIDEST_SPACING,
)
from riemhuman.registration.registration_settings import DEFAULT_SETTINGS
from riemhuman.registration.scans import (
    FEWEST_POINTS,
    Scan,
)
from riemhuman.surfaces.measures import (
    find_inward_triangles,
    oriented_alike,
    split_triangles,
    vertex_components,
)

# Number of bodies fitted at once; like the next constant, it changes no result.
N_THREADS = 2
# Fewer points are matched faster than threads start.
_MANY_POINTS = 1000
# The median of |x| for a standard normal x, a constant of mathematics.
_MEDIAN = 0.6745


class Matches(NamedTuple):
    """The points of a scan that match the points of a body."""

    gaps: Array  # (n, 3) vectors from the points of the body to their matches, metres
    normals: Array  # (n, 3) normals of the scan at the matches
    weights: Array  # (n,) weights of the matches in a fit, between 0 and 1
    # (n,) lengths of the gaps beyond what the spacing of the scan explains, metres
    distances: Array
    reliable: Array  # (n,) what the weights would be at these distances


@dataclass(frozen=True, eq=False)
class PreparedScan:
    """Evenly spread points of a scan, ready for registration."""

    points: Array
    normals: Array
    background: Booleans  # (N,) which points of the whole scan are floor or strays
    whole: Scan
    up: Array | None = None  # direction up, if it is known
    floor: tuple[Array, float] | None = None  # its upward normal, and its height along this
    other_ups: tuple[Array, ...] = ()  # normals of more planes on which the body may rest
    estimated: bool = False  # whether the normals were estimated from the points alone
    parts: Integers | None = None  # (n,) connected parts of a mesh that has several
    signed: bool = True  # whether the signs of the normals are known
    landmarks: Mapping[int, Array] = field(default_factory=dict)  # positions of joints
    clothed: bool = False  # whether the person is known to wear clothes

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._places(self.points, self.normals))

    def _places(self, points: Array, normals: Array) -> Array:
        """Return points with six coordinates, so that distances include normals."""
        return np.concatenate([points, MATCH_NORMAL_METRES * normals], axis=1)

    @cached_property
    def spacing(self) -> Array:
        """The distance within which every point has neighbours on all sides, metres."""
        return point_spacing(self.points)

    @property
    def near_metres(self) -> float:
        """The distance within which its points are near a body, metres."""
        return NEAR_CLOTHED_METRES if self.clothed else NEAR_METRES

    @property
    def prior_weight(self) -> float:
        """The weight of the prior, square metres."""
        return PRIOR_METRES**2 / len(self.points)

    @cached_property
    def noise(self) -> float:
        """The standard deviation of the points along their normals, metres."""
        # On a circle, the chord between two points is perpendicular to the mean of their normals,
        # so what is left of it along this mean is noise.
        chosen = np.linspace(0, len(self.points) - 1, N_DENSE).astype(int)
        near = self._tree.query(self._tree.data[chosen], k=5)[1][:, 1:]
        chords = self.points[near] - self.points[chosen, np.newaxis]
        means = 0.5 * (self.normals[near] + self.normals[chosen, np.newaxis])
        heights = np.einsum("nkx,nkx->nk", chords, means)
        return float(np.median(np.abs(heights)) / (_MEDIAN * np.sqrt(2.0)))

    def match(self, points: Array, normals: Array, scale: float) -> Matches:
        """Match the points of a body; a match at distance `scale` has a quarter of the weight."""
        places = self._places(points, normals)
        far, near = self._tree.query(places, k=N_MATCHED, workers=_n_workers(len(places)))
        shares = np.exp(-0.5 * (far**2 - far[:, :1] ** 2) / BLUR_METRES**2)
        shares /= shares.sum(axis=1, keepdims=True)
        gaps = np.einsum("nk,nkx->nx", shares, self.points[near]) - points
        mean_normals = unit_vectors(np.einsum("nk,nkx->nx", shares, self.normals[near]))
        cosines = np.einsum("nx,nx->n", mean_normals, normals)
        heights = np.einsum("nx,nx->n", gaps, mean_normals)
        along = np.linalg.norm(gaps - heights[:, np.newaxis] * mean_normals, axis=1)
        allowed = self._allowed_along(places, near[:, 0], mean_normals)
        allowed *= np.clip(4.0 * cosines - 3.0, 0.0, 1.0)  # on the same side of the body
        distances = np.hypot(heights, np.maximum(along - allowed, 0.0))
        lengths = np.stack([np.linalg.norm(gaps, axis=1), distances])
        weights, reliable = (scale**2 / (lengths**2 + scale**2)) ** 2 * np.clip(cosines, 0.0, 1.0)
        if self.floor is not None:  # soles that it hides are at least not below it
            up, height = self.floor
            depths = height - points @ up
            below = depths > 0.0
            gaps[below], mean_normals[below] = depths[below, np.newaxis] * up, up
            weights[below], reliable[below], distances[below] = 1.0, 1.0, depths[below]
        return Matches(gaps, mean_normals, weights, distances, reliable)

    def _allowed_along(self, places: Array, nearest: Integers, normals: Array) -> Array:
        """Return how far along the surface matches may be: between sparse points, all are far.

        Beyond the border of what the scan shows, its points are on one side only, and matches
        must be near.
        """
        allowed = np.clip(
            self.spacing[nearest] - MATCHED_METRES,
            0.0,
            WIDEST_SPACING,
        )
        sparse_parts = np.flatnonzero(allowed > 0.0)
        if not len(sparse_parts):
            return allowed
        nearest, normals = nearest[sparse_parts], normals[sparse_parts]
        away = places[sparse_parts, :3] - self.points[nearest]
        away = unit_vectors(away - np.einsum("nx,nx->n", away, normals)[:, np.newaxis] * normals)
        ahead = places[sparse_parts]
        ahead[:, :3] += self.spacing[nearest, np.newaxis] * away
        across = self._tree.query(ahead, workers=_n_workers(len(ahead)))[1]
        onward = self.points[across] - places[sparse_parts, :3]
        between = np.einsum("nx,nx->n", onward, away) > 0.0
        between &= np.linalg.norm(onward, axis=1) < self.spacing[nearest]
        between &= np.einsum("nx,nx->n", self.normals[across], normals) > 0.5
        allowed[sparse_parts[~between]] = 0.0
        return allowed


def _n_workers(n_points: int) -> int:
    return N_THREADS if n_points > _MANY_POINTS else 1


@dataclass(frozen=True)
class _LoosePoints:
    """Evenly spread points of a scan with its surroundings."""

    everything: Array  # (M, 3) vertices, of triangles that are split
    faces: Triangles | None
    numbers: Integers  # (n,) those that are kept
    normals: Array  # (n, 3) of these
    estimated: bool  # whether normals were estimated from the points alone
    background: Booleans  # (M,) points far away


def prepare_scan(
    scan: Scan,
    *,
    most_points: int = DEFAULT_SETTINGS.most_points,
    surroundings: bool = True,
    up: Array | None = None,
    landmarks: Mapping[int, Array] | None = None,
) -> PreparedScan:
    """Return evenly spread points of the body with normals, and what the user says about it."""
    rng = np.random.default_rng(0)
    loose = _spread_points(scan, most_points, rng)
    if not surroundings:
        return PreparedScan(
            loose.everything[loose.numbers],
            loose.normals,
            loose.background[: len(scan.points)],
            scan,
            estimated=loose.estimated,
        )
    prepared = _without_surroundings(scan, loose, rng)
    if landmarks is not None:
        prepared = replace(prepared, landmarks=landmarks)
    if up is None:
        return prepared
    # A plane that leans from the direction up is a wall.
    is_floor = prepared.up is not None and prepared.up @ up > SAME_WAY
    return replace(prepared, up=up, floor=prepared.floor if is_floor else None, other_ups=())


def even_points(points: Array, n_points: int) -> Integers:
    """Return the indices of about this many points, spread evenly over the surface, ascending."""
    # One in each cube of a grid, whose width is found by bisection.
    if len(points) <= n_points:
        return np.arange(len(points))
    order = np.random.default_rng(0).permutation(len(points))
    shuffled = points[order] - points.min(axis=0)
    low, high = 0.0, float(shuffled.max())
    # The first estimate assumes a surface, where the number of cubes grows as 1/width².
    width = high / np.sqrt(n_points)
    best: Integers = order[:n_points]
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


def _spread_points(scan: Scan, most_points: int, rng: np.random.Generator) -> _LoosePoints:
    everything, faces, all_normals = scan.points, scan.faces, scan.normals
    numbers = np.arange(len(everything))
    estimated = all_normals is None
    if faces is not None:
        estimated = bool(np.sum(~oriented_alike(faces)[1]) > MIXED_TRIANGLES * 3 * len(faces))
        everything, faces = _outward_fine_mesh(everything, faces)
        all_normals = vertex_normals(everything, faces)
        numbers = np.unique(faces)
    if len(numbers) > FIRST_POINTS:
        numbers = np.sort(rng.choice(numbers, FIRST_POINTS, replace=False))
    distances = np.abs(everything - np.median(scan.points, axis=0)).max(axis=1)
    background = distances > STRAY_METRES
    numbers = numbers[~background[numbers]]
    if not len(numbers):
        raise ArgumentError(
            f"scan has no point within {STRAY_METRES:g} m of its middle; is it in metres?"
        )
    numbers = numbers[even_points(everything[numbers], most_points)]
    points = everything[numbers]
    if all_normals is None or estimated:
        normals = estimate_normals(points)
    else:
        normals = smooth_normals(points, unit_vectors(all_normals[numbers]))
        if faces is None and np.sum((points - points.mean(axis=0)) * normals) < 0:
            normals = -normals
    return _LoosePoints(everything, faces, numbers, normals, estimated, background)


def _without_surroundings(
    scan: Scan, loose: _LoosePoints, rng: np.random.Generator
) -> PreparedScan:
    """Return the points of the body, and the floors and walls beside it."""
    everything, numbers = loose.everything, loose.numbers
    background = loose.background.copy()
    planes = find_planes(everything[numbers], loose.normals, rng)
    for up, height, _ in planes:
        background |= everything @ up < height + NEAR_FLOOR_METRES
    if loose.faces is None:
        background |= _find_sparse_points(everything, ~background)
    background |= _find_strays(everything, ~background)
    keep = ~background[numbers]
    if keep.sum() < FEWEST_POINTS:
        raise ArgumentError(
            f"scan has {int(keep.sum())} points after the floor and stray points are removed; at "
            f"least {FEWEST_POINTS} are needed"
        )
    points, normals = everything[numbers[keep]], loose.normals[keep]
    parts = None
    if loose.estimated and background.any():
        normals = estimate_normals(points)  # the background may have flipped signs
    elif loose.faces is not None:
        parts = vertex_components(loose.faces, len(everything))[numbers[keep]]
    floors = [plane for plane in planes if plane.resting > LEAST_RESTING]
    floors.sort(key=lambda plane: -plane.resting)
    return PreparedScan(
        points,
        normals,
        background[: len(scan.points)],
        scan,
        up=floors[0].normal if floors else None,
        floor=(floors[0].normal, floors[0].height) if floors else None,
        other_ups=tuple(plane.normal for plane in floors[1:]),
        estimated=loose.estimated,
        parts=parts,
    )


def _outward_fine_mesh(points: Array, faces: Triangles) -> tuple[Array, Triangles]:
    """Return a mesh whose triangles face outward, and its large triangles split."""
    inward = find_inward_triangles(points, faces)
    faces = np.where(inward[:, np.newaxis], faces[:, ::-1], faces)
    while len(points) < FIRST_POINTS:
        corners = points[faces]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        large = (longest > LONG_EDGE) & (longest < LONGEST_EDGE)
        if not large.any():
            break
        points, parts = split_triangles(points, faces[large])
        faces = np.concatenate([faces[~large], parts])
    return points, faces


class Plane(NamedTuple):
    """A plane beside the body: a floor or a wall."""

    normal: Array  # (3,) towards the body
    height: float  # along the normal, metres
    resting: float  # share of the other points that are near to it


def find_planes(points: Array, normals: Array, rng: np.random.Generator) -> list[Plane]:
    """Return floors and walls: wide planes that have all other points on one side of them."""
    planes: list[Plane] = []
    while len(planes) < MOST_PLANES and len(points) > FEWEST_POINTS:
        plane = _find_plane(points, normals, rng)
        if plane is None:
            break
        planes.append(plane)
        rest = points @ plane.normal > plane.height + NEAR_FLOOR_METRES
        points, normals = points[rest], normals[rest]
    return planes


def _find_plane(points: Array, normals: Array, rng: np.random.Generator) -> Plane | None:
    """Return the floor or wall that holds the most points."""
    starts = rng.choice(len(points), min(N_PLANES, len(points)), replace=False)
    for _ in range(MOST_PLANES):
        best, support = None, FLOOR_SHARE * len(points)
        for start in starts:
            near = _near_plane(points, normals, start) & (
                np.abs(normals @ normals[start]) > SAME_WAY
            )
            if near.sum() > support:
                best, support = start, near.sum()
        if best is None:
            return None
        near = _near_plane(points, normals, best)
        plane = _as_plane(points, near)
        if plane is not None:
            return plane
        starts = starts[~near[starts]]  # such as a wall with more floor behind it
    return None


def _near_plane(points: Array, normals: Array, start: int) -> Booleans:
    """Return which points are in the plane across the normal of one of them."""
    near: Booleans = np.abs((points - points[start]) @ normals[start]) < FLOOR_METRES
    return near


def _as_plane(points: Array, near: Booleans) -> Plane | None:
    """Return the plane of the points near to it, if it is a floor or a wall."""
    centre = points[near].mean(axis=0)
    axes = np.linalg.svd(points[near] - centre, full_matrices=False)[2]
    heights = (points - centre) @ axes[2]
    sign = -1.0 if np.median(heights[~near]) < 0 else 1.0
    above = sign * heights[~near] > -NEAR_FLOOR_METRES
    is_wide = np.sort(points[near].std(axis=0))[1] > LEAST_WIDTH
    higher = sign * heights > NEAR_FLOOR_METRES
    if above.mean() < ABOVE_FLOOR or not is_wide or higher.sum() < FEWEST_POINTS:
        return None
    flat = (points - centre) @ axes[:2].T
    if _share_outside(flat[near], flat[higher]) < LEAST_OUTSIDE:
        return None
    resting = float(np.mean(sign * heights[higher] < RESTING_METRES))
    return Plane(sign * axes[2], float(centre @ (sign * axes[2])), resting)


def _share_outside(points: Array, others: Array) -> float:
    """Return the share of points in the plane, (n, 2), outside the convex outline of others."""
    low, high = np.percentile(others, [0.5, 99.5], axis=0)
    inside = ((others >= low) & (others <= high)).all(axis=1)  # without strays
    equations = ConvexHull(others[inside]).equations
    distances = points @ equations[:, :2].T + equations[:, 2]
    return float(np.mean(distances.max(axis=1) > OUTLINE_METRES))


def point_spacing(points: Array) -> Array:
    """Return the distance of each point to its sixth neighbour, metres."""
    count = min(N_CLOSE + 1, len(points))
    distances: Array = cKDTree(points).query(points, k=[count])[0][:, 0]
    return distances


def _areas(spacing: Array) -> Array:
    """Return the areas that points represent, up to a factor, from their spacing."""
    return np.minimum(spacing, WIDEST_SPACING) ** 2


def _quantile_over_area(spacing: Array, share: float) -> float:
    """Return the spacing that a share of the area stays below."""
    order = np.argsort(spacing)
    below = np.cumsum(_areas(spacing[order]))
    return float(spacing[order[np.searchsorted(below, share * below[-1])]])


def _find_sparse_points(points: Array, wanted: Booleans) -> Booleans:
    """Return which loose points are remnants of floors and stands, or strays of a sensor."""
    sparse_points = np.zeros(len(points), dtype=bool)
    chosen = points[wanted]
    spacing = point_spacing(chosen)
    is_stray = _find_strays_of_sensor(chosen, spacing)
    usual, areas = _quantile_over_area(spacing, 0.5), _areas(spacing)
    is_remnant = ~is_stray & (spacing > max(SPARSE_METRES, SPARSE_SPACINGS * usual))
    if areas[is_remnant].sum() > FEW_SPARSE * areas.sum():
        is_remnant &= spacing > LONELY_METRES
    is_remnant |= _find_sparse_floor(chosen, spacing > max(SPARSE_METRES, SPARSER_SPACINGS * usual))
    sparse_points[wanted] = is_remnant | is_stray
    return sparse_points


def _find_strays_of_sensor(points: Array, spacing: Array) -> Booleans:
    """Return which points a depth sensor put between an edge and what lies behind it."""
    is_stray = np.zeros(len(points), dtype=bool)
    sparse_ones = np.flatnonzero(spacing > SPARSE_METRES)
    if len(sparse_ones) < FEW_STRAYS * len(points):
        around = cKDTree(points).query_ball_point(
            points[sparse_ones], STRAY_REACH * spacing[sparse_ones], return_length=True
        )
        # On a surface that is sampled evenly, numbers grow with the area.
        is_stray[sparse_ones] = around > CROWDED * N_CLOSE * STRAY_REACH**2
    return is_stray


def _find_sparse_floor(points: Array, is_sparse: Booleans) -> Booleans:
    """Return which sparse points are in one plane that has nearly all points on one side."""
    rng, numbers = np.random.default_rng(0), np.flatnonzero(is_sparse)
    best, most = np.zeros(len(points)), int(IN_PLANE * len(numbers))
    for _ in range(N_PLANES if len(numbers) > N_NORMAL_NEIGHBOURS[0] else 0):
        corners = points[rng.choice(numbers, 3, replace=False)]
        normal = unit_vectors(np.cross(corners[1] - corners[0], corners[2] - corners[0]))
        heights = (points[numbers] - corners[0]) @ normal
        count = int(np.sum(np.abs(heights) < NEAR_FLOOR_METRES))
        if count > most:
            best, most = (points - corners[0]) @ normal, count
    in_plane = is_sparse & (np.abs(best) < NEAR_FLOOR_METRES)
    sides = np.sign(best) * (np.abs(best) > NEAR_FLOOR_METRES)
    is_floor = abs(sides.sum()) > (2.0 * ABOVE_FLOOR - 1.0) * np.abs(sides).sum()
    return in_plane if is_floor else np.zeros_like(in_plane)


def _find_strays(points: Array, wanted: Booleans) -> Booleans:
    """Return which points belong to small separate parts."""
    from scipy.ndimage import label  # takes long to import

    strays = np.zeros(len(points), dtype=bool)
    chosen = points[wanted]
    if not len(chosen):
        return strays
    low, high = np.percentile(chosen, [0.5, 99.5], axis=0)
    low, high = low - 0.5, high + 0.5
    inside = ((chosen >= low) & (chosen <= high)).all(axis=1)
    spacing = point_spacing(chosen)
    width = np.clip(
        _quantile_over_area(spacing, CELL_QUANTILE),
        LONG_EDGE,
        WIDEST_CELL,
    )
    cells = np.floor((chosen[inside] - low) / width).astype(np.int64)
    grid = np.zeros(np.ceil((high - low) / width).astype(int) + 1, dtype=bool)
    grid[tuple(cells.T)] = True
    labels, _ = label(grid, structure=np.ones((3, 3, 3)))
    parts = labels[tuple(cells.T)]
    areas = _areas(spacing)
    sizes = np.bincount(parts, areas[inside])
    is_stray = np.ones(len(chosen), dtype=bool)
    is_stray[inside] = sizes[parts] < LARGEST_STRAY * areas.sum()
    strays[wanted] = is_stray
    return strays


def estimate_normals(points: Array) -> Array:
    """Return outward normals of loose points on a surface."""
    n = len(points)
    tree = cKDTree(points)
    neighbours = tree.query(points, k=min(N_NORMAL_NEIGHBOURS[0], n))[1]
    normals, on_line = _normals_of(points[neighbours])
    for count in N_NORMAL_NEIGHBOURS[1:]:
        rest = np.flatnonzero(on_line)
        if not len(rest) or count > n:
            break
        more = tree.query(points[rest], k=count)[1]
        normals[rest], on_line[rest] = _normals_of(points[more])

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
    oriented: Array = np.where(outward < 0, -1.0, 1.0)[part][:, np.newaxis] * normals
    return oriented


def _normals_of(groups: Array) -> tuple[Array, Booleans]:
    """Return the normals of groups of points, (n, k, 3), and whether these are nearly on a line."""
    around = groups - groups.mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(np.einsum("nkx,nky->nxy", around, around))
    return axes[:, :, 0], variances[:, 1] < ON_LINE * variances[:, 2]


def smooth_normals(points: Array, normals: Array) -> Array:
    """Return normals averaged over neighbours with similar normals."""
    places = np.concatenate([points, MATCH_NORMAL_METRES * normals], axis=1)
    neighbours = cKDTree(places).query(places, k=min(N_NORMAL_NEIGHBOURS[0], len(points)))[1]
    return unit_vectors(normals[neighbours].mean(axis=1))
