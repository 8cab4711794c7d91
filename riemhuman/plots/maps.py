"""Maps: items placed in the plane by their distances, with pictures of bodies."""

from __future__ import annotations

import math
from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import cdist

from riemhuman.arrays import Array, Integers, Labels, Points, PointsLike
from riemhuman.checks import (
    Rng,
    checked,
    choice,
    distance_matrix,
    generator,
    length_of,
    real,
    real_array,
)
from riemhuman.checks.labels import class_indices, names_of, text
from riemhuman.datasets import Bodies
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.optional import import_matplotlib, import_optional
from riemhuman.plots.figures import class_colors, new_axes, plain
from riemhuman.plots.rendering import render

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METHODS = ("t-sne", "mds")

# Perplexity of t-SNE: about the number of bodies in a class.
_PERPLEXITY = 10.0
_MARKERS = ("o", "s", "D", "^", "v")
_NAME_POINTS = 9.5
_NAME_LETTERS = 14  # in a line
# Inches.
_ROOM = np.array([1.15, 0.6])  # around a map with bodies
_BODY_WIDTH = 0.46
_BODY_HEIGHT = 0.62
_NAME_GAP = 0.04
_LETTER_WIDTH = 0.09  # of names
_LINE_HEIGHT = 0.16
_POINT_INCHES = 0.05
# Points (of 1/72 inch): the room of the scale bar, and the radius of a point.
_BAR_POINTS = (110.0, 20.0)
_DOT_RADIUS = 3.0
_BODY_PIXELS = 200
_MOST_BODIES = 12
_MOST_CLASSES = 10_000
_GRID = 90  # places for bodies in each direction
_N_ORDERS = 24  # orders in which bodies take the nearest free place
_DARKER = 0.62  # names than points, for legibility
LARGEST_STRESS = 0.3
"""Stress of a map up to which distances on it say something.

Of bodies that are all equally far from each other, the best map has a stress of about 0.4.
"""
LEAST_KEPT = 0.2
"""Least share of nearest neighbours that a map keeps, of those that chance does not keep."""
_TIE = 1e-9
_NEIGHBOURS = 5  # of each item, of which a map should keep most
# Of majorization: steps, least gain of a step, and loss at which distances are kept.
_MOST_STEPS = 1000
_SMALLEST_GAIN = 1e-5
_SMALLEST_LOSS = 1e-12
_JITTER = 1e-12  # of the largest distance
_NO_STRESS = 0.01


@checked(method=choice(*METHODS))
def embed(
    distances: ArrayLike | RiemannianMetric,
    bodies: Bodies | PointsLike | None = None,
    *,
    method: str = "t-sne",
    rng: Rng = 0,
) -> Array:
    """Embed items in the plane by their distances, shape (n, 2).

    Parameters
    ----------
    distances : array_like, shape (n, n), or RiemannianMetric
        Distances, or the metric that computes those of the bodies.
    bodies : Bodies or array, shape (n, V, 3), optional
        The bodies that the metric compares; not for distances.
    method : {"t-sne", "mds"}
        t-distributed stochastic neighbour embedding [1]_, which preserves neighbourhoods, or
        metric multidimensional scaling by majorization [2]_, which keeps distances as well as a
        plane can: it minimizes `stress`, from classical scaling (Torgerson 1952).
    rng : int or numpy.random.Generator
        Seed of t-SNE.

    References
    ----------
    .. [1] van der Maaten, Hinton, "Visualizing data using t-SNE", JMLR 2008.
    .. [2] de Leeuw, "Convergence of the majorization method for multidimensional scaling",
       J. Classification 1988.

    Examples
    --------
    >>> rh.plots.embed([[0, 3, 4], [3, 0, 5], [4, 5, 0]], method="mds").shape
    (3, 2)
    >>> bodies = rh.datasets.load_open_bodies("coarse")[:20]
    >>> metric = rh.SRNFMetric(rh.AlignedSurfaces(bodies.template, equip=False))
    >>> rh.plots.embed(metric, bodies, method="mds").shape
    (20, 2)
    """
    if isinstance(distances, RiemannianMetric):
        if bodies is None:
            raise ArgumentError("with a metric, pass the bodies to compare: embed(metric, bodies)")
        distances = distances.dist_pairwise(bodies.points if isinstance(bodies, Bodies) else bodies)
    elif bodies is not None:
        raise ArgumentError("bodies is only for metrics; leave it out for distances")
    matrix = distance_matrix(distances, "distances")
    if len(matrix) < 3:
        raise ArgumentError(f"distances must be of at least 3 items; found {len(matrix)}")
    start = _classical_scaling(matrix)
    if method == "mds":
        return _majorized(matrix, start)
    manifold = import_optional("sklearn.manifold", "report")
    # The recommended scale of initial positions for t-SNE.
    start = start / max(float(start[:, 0].std()), 1e-30) * 1e-4
    seed = int(generator(rng).integers(2**31))
    estimator = manifold.TSNE(
        metric="precomputed",
        init=start,
        perplexity=min(_PERPLEXITY, (len(matrix) - 1) / 3),
        learning_rate="auto",
        random_state=seed,
    )
    with single_threaded_libraries():  # threads do not pay off for so few points
        return np.asarray(estimator.fit_transform(matrix), dtype=np.float64)


def _classical_scaling(distances: Array) -> Array:
    # Two leading eigenvectors of −½ J D² J, with the centring matrix J, by roots of eigenvalues.
    squared = distances**2
    means = squared.mean(axis=0)
    products = -0.5 * (squared - means - means[:, None] + means.mean())
    values, vectors = np.linalg.eigh(products)
    return _with_signs(vectors[:, [-1, -2]] * np.sqrt(np.maximum(values[[-1, -2]], 0.0)))


def _majorized(distances: Array, positions: Array) -> Array:
    """Lower the stress of positions by de Leeuw's majorization until it hardly falls."""
    scale = float(distances.max())
    if not scale:
        return positions
    # Points in one place would stay there.
    jitter = np.random.default_rng(0).normal(size=positions.shape)
    places = positions + _JITTER * scale * jitter
    total = (distances**2).sum()
    loss = math.inf
    for _ in range(_MOST_STEPS):
        on_map = cdist(places, places)
        previous, loss = loss, float(((distances - on_map) ** 2).sum() / total)
        if loss < _SMALLEST_LOSS or previous - loss < _SMALLEST_GAIN * loss:
            break
        # The Guttman transform.
        ratios = np.divide(distances, on_map, out=np.zeros_like(on_map), where=on_map > 0)
        places = (ratios.sum(axis=1)[:, np.newaxis] * places - ratios @ places) / len(places)
    return _turned(places)


def _turned(positions: Array) -> Array:
    """Return positions about their mean, with the widest direction first."""
    centred = positions - positions.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    return _with_signs(centred @ axes.T)


def _with_signs(positions: Array) -> Array:
    """Return positions whose farthest coordinate in each direction is positive."""
    farthest = positions[np.abs(positions).argmax(axis=0), [0, 1]]
    return positions * np.where(farthest < 0, -1.0, 1.0)


def neighbours_kept(distances: ArrayLike, positions: ArrayLike) -> tuple[float, int, float]:
    """Return which share of each item's nearest neighbours are its nearest on a map, (n, 2).

    Also their number, and the share that positions by chance would have; where distances (n, n) are
    equal, neighbours are kept by chance.
    """
    matrix = distance_matrix(distances, "distances")
    places = real_array(positions, "positions", (len(matrix), "n_axes"), batched=False)
    n_others = len(matrix) - 1
    count = max(1, min(_NEIGHBOURS, n_others // 2))
    by_chance = count / n_others
    order = _nearest_first(matrix)
    on_map = _nearest_first(cdist(places, places))[:, :count]
    sorted_distances = np.take_along_axis(matrix, order, axis=1)
    # The nearest that is not counted, from which ties cannot be told.
    border = sorted_distances[:, count : count + 1]
    is_tied = sorted_distances[:, :count] >= border * (1.0 - _TIE)
    is_kept = (order[:, :count, np.newaxis] == on_map[:, np.newaxis]).any(axis=2)
    return float(np.where(is_tied, by_chance, is_kept).mean()), count, by_chance


def _nearest_first(distances: Array) -> Integers:
    others = distances.copy()
    np.fill_diagonal(others, np.inf)
    return np.argsort(others, axis=1, kind="stable")


def stress(distances: Array, positions: Array) -> float:
    r"""Return Kruskal's stress √(Σ (d_ij − δ_ij)² / Σ d_ij²) of an embedding, over all pairs.

    If all distances are zero, it is zero where all items coincide in the embedding, else infinite.

    Parameters
    ----------
    distances : array, shape (n, n)
        d.
    positions : array, shape (n, 2)
        Embedded items, with distances δ.

    Examples
    --------
    >>> rh.plots.stress(np.array([[0.0, 2.0], [2.0, 0.0]]), np.array([[0.0, 0.0], [1.0, 0.0]]))
    0.5
    """
    distances = distance_matrix(distances, "distances")
    positions = real_array(positions, "positions", (len(distances), "n_axes"), batched=False)
    on_map = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    squared_errors, squares = ((distances - on_map) ** 2).sum(), (distances**2).sum()
    if not squares:
        return float("inf") if squared_errors else 0.0
    return float(np.sqrt(squared_errors / squares))


@checked(stress=real(minimum=0.0))
def describe_stress(stress: float) -> str:
    """Return in words how far an embedding is from the distances.

    Parameters
    ----------
    stress : float
        See `stress`: the root mean square error of distances, relative to that of distances.

    Examples
    --------
    >>> rh.plots.describe_stress(0.35)
    'distances are off by 35 %'
    """
    if stress < _NO_STRESS:
        return "distances are kept"
    return f"distances are off by {100 * stress:.0f} %"


def plot_embedding(
    positions: ArrayLike,
    labels: ArrayLike,
    names: Sequence[str] | None = None,
    *,
    item_names: Sequence[str] | None = None,
    points: ArrayLike | None = None,
    faces: ArrayLike | None = None,
    unit: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot items in the plane, coloured by class, with a body of each class.

    Parameters
    ----------
    positions : array_like, shape (n, 2)
        See `embed`.
    labels : array_like of int, shape (n,)
        Class of each item, counted from 0; none may be missing, see `rh.retrieval.scores`.
    names : sequence of str, optional
        Names of the classes.
    item_names : sequence of str, length n, optional
        Names of the items, written next to them instead of a legend of the classes.
    points : array_like, shape (n, V, 3), optional
        Bodies of the items; the middle one of each class is drawn. If there are more than twelve
        classes, the twelve largest are drawn, with a legend.
    faces : array_like, shape (F, 3), optional
    unit : str, optional
        Unit of the positions, for a scale bar; both axes then have the same scale.
    ax : matplotlib.axes.Axes, optional

    Examples
    --------
    >>> ax = rh.plots.plot_embedding([[0, 1], [1, 0], [1, 1]], [0, 0, 1], ["Anna", "Ben"])
    """
    places = real_array(positions, "positions", ("n_items", 2), batched=False)
    items, classes = named_classes(labels, names, len(places))
    titles = None
    if item_names is not None:
        titles = names_of(item_names, "item_names", len(places), "items")
    length_unit = None if unit is None else text(unit, "unit")
    if (points is None) != (faces is None):
        raise ArgumentError("points and faces must be given together; found only one of them")
    ax = new_axes(ax, 6.0, 5.0)
    colors = class_colors(int(items.max()) + 1)
    for label in np.unique(items):
        ax.scatter(
            *places[items == label].T,
            s=22,
            color=colors[label],
            marker=_MARKERS[label // 10 % len(_MARKERS)],
            linewidths=0,
            label=plain(classes[label]),
            zorder=3,
        )
    ax.set(xticks=[], yticks=[])
    for spine in ax.spines.values():
        spine.set_visible(False)
    is_drawn = points is not None and len(np.unique(items)) <= _MOST_BODIES
    if titles is None and not is_drawn:
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    low, high = places.min(axis=0), places.max(axis=0)
    margin = 0.05 * np.maximum(high - low, 1e-9)
    if points is not None:
        rooms = np.minimum(2 * _ROOM / _inches(ax), 0.8)
        margin += np.maximum(high - low, 1e-9) * rooms / (1 - rooms) / 2
    ax.set_xlim(low[0] - margin[0], high[0] + margin[0])
    ax.set_ylim(low[1] - margin[1], high[1] + margin[1])
    if length_unit is not None:
        _add_length_bar(ax, length_unit)
    if titles is not None:
        _add_item_names(ax, places, titles)
    if points is None or faces is None:
        return ax
    surfaces = real_array(points, "points", (len(places), "n_vertices", 3), batched=False)
    _add_bodies(ax, places, items, colors, classes, surfaces, faces)
    return ax


def named_classes(
    labels: Labels, names: Sequence[str] | None, count: int
) -> tuple[Integers, tuple[str, ...]]:
    """Return the classes of items, counted from 0, and the names of classes, or their numbers."""
    if not count:
        raise ArgumentError("positions must hold at least one item; found none")
    items = class_indices(labels, "labels", count)
    low, high = int(items.min()), int(items.max())
    if low < 0 or high >= _MOST_CLASSES:
        raise ArgumentError(
            f"labels must be classes counted from 0, below {_MOST_CLASSES}; found {low} to {high}"
        )
    if names is None:
        return items, tuple(map(str, range(high + 1)))
    named = names_of(names, "names", length_of(names, "names"), "classes")
    if len(named) <= high:
        raise ArgumentError(
            f"names must hold a name for each class; found {len(named)} for the classes 0 to {high}"
        )
    return items, named


def _add_item_names(ax: Axes, positions: Array, names: Sequence[str]) -> None:
    """Write a name beside each point, off other points, names and the scale bar if possible."""
    low = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    size = 72 * _inches(ax)
    points = (positions - low) / [np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())] * size
    height = 9.0  # of a name, points, of which a letter is about 5 wide
    # To the right and left of a point, then a line lower, a line higher and so on.
    lines = (0, -1, 1, -2, 2, -3, 3)
    offsets = np.array([[x, line * height] for line in lines for x in (5.0, -5.0)])
    is_right = offsets[:, 0] > 0
    # Left, bottom, right and top, in points.
    bar = [
        [size[0] / 2 - _BAR_POINTS[0] / 2, 0.0, size[0] / 2 + _BAR_POINTS[0] / 2, _BAR_POINTS[1]]
    ]
    dots = np.concatenate([points - _DOT_RADIUS, points + _DOT_RADIUS], axis=1)
    written = np.concatenate([bar, dots])
    for position, (x, y), name in zip(positions, points, names, strict=True):
        width = 5.0 * len(name)
        left = x + np.where(is_right, offsets[:, 0], offsets[:, 0] - width)
        bottom = y + offsets[:, 1] - height / 2
        boxes = np.stack([left, bottom, left + width, bottom + height], axis=1)
        is_before = boxes[:, np.newaxis, 2:] <= written[np.newaxis, :, :2]
        is_behind = written[np.newaxis, :, 2:] <= boxes[:, np.newaxis, :2]
        overlaps = ~(is_before | is_behind).any(axis=-1)
        is_outside = (bottom < 0) | (bottom + height > size[1])
        best = int((overlaps.sum(axis=1) + len(positions) * is_outside).argmin())
        written = np.append(written, boxes[[best]], axis=0)
        ax.annotate(
            plain(name),
            position,
            xytext=tuple(offsets[best]),
            textcoords="offset points",
            va="center",
            ha="left" if is_right[best] else "right",
            fontsize="small",
        )


def _add_length_bar(ax: Axes, unit: str) -> None:
    """Draw a scale bar of a round length, after giving both axes the same scale."""
    limits = np.array([ax.get_xlim(), ax.get_ylim()])
    inches = _inches(ax)
    half = (np.ptp(limits, axis=1) / inches).max() * inches / 2
    (left, right), (bottom, top) = limits.mean(axis=1)[:, None] + np.outer(half, [-1, 1])
    ax.set(xlim=(left, right), ylim=(bottom, top))
    most = 0.25 * (right - left)
    power = 10.0 ** np.floor(np.log10(most))
    length = max(times * power for times in (1, 2, 5) if times * power <= most)
    middle = (left + right) / 2
    ends = [middle - length / 2, middle + length / 2]
    ax.plot(ends, [bottom, bottom], color="#8a8f96", linewidth=2, clip_on=False)
    ax.annotate(
        plain(f"{length:g} {unit}"), (middle, bottom), xytext=(0, 3), textcoords="offset points",
        ha="center", va="bottom", fontsize=_NAME_POINTS,
    )  # fmt: skip


def _add_bodies(
    ax: Axes,
    positions: Array,
    labels: Integers,
    colors: Array,
    names: Sequence[str],
    points: Points,
    faces: ArrayLike,
) -> None:
    """Draw the middle body of the largest classes, with its name, beside the points of each."""
    offsetbox = import_matplotlib("offsetbox")
    classes, counts = np.unique(labels, return_counts=True)
    classes = classes[np.argsort(-counts, kind="stable")][:_MOST_BODIES]
    titles = [fill(names[label], _NAME_LETTERS) for label in classes]
    centres = np.stack([np.median(positions[labels == label], axis=0) for label in classes])
    size = _inches(ax)
    low = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    scale = size / [np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())]
    sizes = np.array([_size_with_name(title) for title in titles])
    places = free_places((centres - low) * scale, sizes, (positions - low) * scale, size)
    extents = np.maximum(np.ptp(positions, axis=0), 1e-9)
    zoom = 72 * _BODY_HEIGHT / _BODY_PIXELS
    for label, centre, title, place, (_, tall) in zip(
        classes, centres, titles, places, sizes, strict=True
    ):
        members = np.flatnonzero(labels == label)
        gaps = np.linalg.norm((positions[members] - centre) / extents, axis=1)
        body, color = points[members[gaps.argmin()]], colors[label]
        picture = render(body, faces, height=_BODY_PIXELS, color=0.25 + 0.75 * color)
        image = offsetbox.OffsetImage(picture, zoom=zoom)
        at = (place + [0.0, tall / 2 - _BODY_HEIGHT / 2]) / size
        settings = {"xycoords": "axes fraction", "frameon": False, "pad": 0}
        ax.add_artist(offsetbox.AnnotationBbox(image, tuple(at), **settings))
        ax.annotate(
            plain(title), tuple((place + [0.0, tall / 2 - _BODY_HEIGHT - _NAME_GAP]) / size),
            xycoords="axes fraction", ha="center", va="top", fontsize=_NAME_POINTS,
            linespacing=1.0, color=_DARKER * color,
        )  # fmt: skip


def _size_with_name(title: str) -> tuple[float, float]:
    """Return the width and height in inches of a body with its name below."""
    lines = title.split("\n")
    width = max(_BODY_WIDTH, _LETTER_WIDTH * max(map(len, lines)))
    return width, _BODY_HEIGHT + _NAME_GAP + _LINE_HEIGHT * len(lines)


def free_places(centres: Array, sizes: Array, points: Points, size: Array) -> Array:
    """Return the middles of boxes near to centres that cover no point and no other box, inches.

    Each box in turn takes the nearest free place of a grid, in the order of several tried in which
    they stay nearest. If there is none in any order, boxes stand in columns beside the points.
    """
    sides = (np.linspace(0.0, length, _GRID) for length in size)
    grid = np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 2)
    halves, free = sizes / 2, []
    for half in halves:
        possible = grid[np.all((grid >= half) & (grid <= size - half), axis=1)]
        reach = half + _POINT_INCHES
        # Columns by themselves: arrays whose last axis has two entries are slow to reduce.
        beside = np.abs(possible[:, :1] - points[:, 0]) < reach[0]
        above = np.abs(possible[:, 1:] - points[:, 1]) < reach[1]
        free.append(possible[~(beside & above).any(axis=1)])
    farthest_first = np.argsort(-np.linalg.norm(centres - points.mean(axis=0), axis=1))
    rng = np.random.default_rng(0)
    orders = [farthest_first, *(rng.permutation(len(centres)) for _ in range(_N_ORDERS))]
    arrangements = [_places_in_order(order, centres, halves, free) for order in orders]
    complete = [places for places in arrangements if places is not None]
    if not complete:
        return _columns(centres, size)
    return min(complete, key=lambda places: float(np.linalg.norm(places - centres, axis=1).sum()))


def _places_in_order(
    order: Integers, centres: Array, halves: Array, free: list[Array]
) -> Array | None:
    """Return the nearest free places, taken in an order, or None if one finds none."""
    places = np.zeros_like(centres)
    for number, k in enumerate(order):
        open_places = free[k]
        for earlier in order[:number]:
            reach = halves[k] + halves[earlier]
            x, y = np.abs(open_places - places[earlier]).T
            open_places = open_places[(x >= reach[0]) | (y >= reach[1])]
        if not len(open_places):
            return None
        places[k] = open_places[np.linalg.norm(open_places - centres[k], axis=1).argmin()]
    return places


def _columns(centres: Array, size: Array) -> Array:
    """Return places in two columns, each in the order of heights."""
    places = np.zeros_like(centres)
    by_x = np.argsort(centres[:, 0], kind="stable")
    half = len(centres) // 2
    for x, column in ((_ROOM[0] / 2, by_x[:half]), (size[0] - _ROOM[0] / 2, by_x[half:])):
        ordered = column[np.argsort(centres[column, 1], kind="stable")]
        slot = size[1] / max(len(ordered), 1)
        places[ordered] = np.stack(
            [np.full(len(ordered), x), slot * (np.arange(len(ordered)) + 0.5)], axis=1
        )
    return places


def _inches(ax: Axes) -> Array:
    """Return the width and height of the axes."""
    engine = ax.figure.get_layout_engine()
    if engine is not None:
        engine.execute(ax.figure)
    return np.asarray(ax.figure.get_size_inches() * ax.get_position().size)
