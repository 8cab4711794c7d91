"""Maps: items placed in the plane by their distances, with pictures of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import Rng, generator, integer_array, one_of, real_array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.optional import import_optional
from riemhuman.plots._colors import class_colors
from riemhuman.plots._figures import new_axes
from riemhuman.plots.rendering import View, render, window_around

if TYPE_CHECKING:
    from matplotlib.axes import Axes

METHODS = ("t-sne", "mds")

# Perplexity of t-SNE: about the number of bodies in a class.
_PERPLEXITY = 10.0
_MARKERS = ("o", "s", "D", "^", "v")
_THUMBNAIL_INCHES = 0.62
_THUMBNAIL_PIXELS = 200
_NAME_POINTS = 9.5
_NAME_BELOW = 0.34  # inches from the middle of the body to its name
_NAME_LETTERS = 14  # in a line
_LETTER_WIDTH = 0.62 * _NAME_POINTS / 72  # inches, at most in the mean of a line
# Inches: half the width and height of a body; half the height and the middle of a body with its
# name in two lines, and of the name alone.
_BODY = np.array([0.31, 0.31])
_WHOLE_HEIGHT, _WHOLE_MIDDLE = 0.49, np.array([0.0, -0.16])
_NAME_HEIGHT, _NAME_MIDDLE = 0.15, np.array([0.0, -0.49])


def embed(distances: ArrayLike, method: str = "t-sne", rng: Rng = 0) -> ndarray:
    """Embed items in the plane by their distances.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Symmetric distances.
    method : {"t-sne", "mds"}
        t-distributed stochastic neighbour embedding [1]_, which preserves neighbourhoods, or
        classical multidimensional scaling, which approximates distances.
    rng : int or numpy.random.Generator
        Seed of t-SNE.

    Returns
    -------
    array, shape (n, 2)

    References
    ----------
    .. [1] van der Maaten, Hinton, "Visualizing data using t-SNE", JMLR 2008.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> D = space.metric.dist_pairwise(bodies.points[:30])
    >>> rh.plots.embed(D, method="mds").shape
    (30, 2)
    """
    matrix = real_array(distances, "distances", ("n", "n"), batched=False)
    one_of(method, "method", METHODS)
    n_items = len(matrix)
    if matrix.shape != (n_items, n_items) or n_items < 3:
        raise ArgumentError(
            f"distances must be a square matrix of at least 3 items; found shape {matrix.shape}"
        )
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0) or matrix.min() < 0:
        raise ArgumentError("distances must be symmetric and not negative")
    start = _classical_scaling(matrix)
    if method == "mds":
        return start
    manifold = import_optional("sklearn.manifold", "report")
    # The recommended scale of initial positions for t-SNE.
    start = start / max(float(start[:, 0].std()), 1e-30) * 1e-4
    seed = int(generator(rng).integers(2**31))
    estimator = manifold.TSNE(
        metric="precomputed",
        init=start,
        perplexity=min(_PERPLEXITY, (n_items - 1) / 3),
        learning_rate="auto",
        random_state=seed,
    )
    with single_threaded_libraries():  # threads do not pay for so few points
        return np.asarray(estimator.fit_transform(matrix), dtype=np.float64)


def _classical_scaling(distances: ndarray) -> ndarray:
    """Return positions in the plane, shape (n, 2), by Torgerson's multidimensional scaling (1952).

    They are the two leading eigenvectors of −½ J D² J, with the squared distances D² and the
    centring matrix J, each times the square root of its eigenvalue.
    """
    squared = distances**2
    means = squared.mean(axis=0)
    products = -0.5 * (squared - means - means[:, None] + means.mean())
    values, vectors = np.linalg.eigh(products)
    positions = vectors[:, [-1, -2]] * np.sqrt(np.maximum(values[[-1, -2]], 0.0))
    farthest = positions[np.abs(positions).argmax(axis=0), [0, 1]]
    return positions * np.where(farthest < 0, -1.0, 1.0)


def stress(distances: ndarray, positions: ndarray) -> float:
    r"""Return Kruskal's stress √(Σ (d_ij − δ_ij)² / Σ d_ij²) of an embedding, over all pairs.

    Parameters
    ----------
    distances : array, shape (n, n)
        Distances d between the items.
    positions : array, shape (n, 2)
        Embedded items, with distances δ.

    Returns
    -------
    float
        0 if the embedding preserves all distances.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> corners = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]])
    >>> rh.plots.stress(np.array([[0.0, 3, 4], [3, 0, 5], [4, 5, 0]]), corners)
    0.0
    """
    on_map = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    return float(np.sqrt(((distances - on_map) ** 2).sum() / (distances**2).sum()))


def plot_embedding(
    positions: ArrayLike,
    labels: ArrayLike,
    names: Sequence[str] | None = None,
    *,
    item_names: Sequence[str] | None = None,
    points: ArrayLike | None = None,
    faces: ArrayLike | None = None,
    view: View | None = None,
    unit: str | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot items in the plane, coloured by class, with a body of each class.

    Parameters
    ----------
    positions : array_like, shape (n, 2)
        Positions of the items, see `embed`.
    labels : array_like of int, shape (n,)
        Class of each item, counted from 0.
    names : sequence of str, optional
        Names of the classes.
    item_names : sequence of str, length n, optional
        Names of the items, written beside them instead of a legend of the classes.
    points : array_like, shape (n, V, 3), optional
        Bodies of the items; the body nearest to the middle of each class is drawn.
    faces : array_like, shape (F, 3), optional
        Triangles of the bodies.
    view : View, optional
        Direction from which the bodies are seen.
    unit : str, optional
        Unit of the positions, for a scale bar; both axes then have the same scale.
    ax : matplotlib.axes.Axes, optional
        By default those of a new figure.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> ax = rh.plots.plot_embedding(bodies.points[:10, 0, :2], bodies.subject[:10])
    """
    places = real_array(positions, "positions", ("n_items", 2), batched=False)
    items = integer_array(labels, "labels", (len(places),))
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
            label=str(label) if names is None else names[label],
            zorder=3,
        )
    ax.set(xticks=[], yticks=[])
    for spine in ax.spines.values():
        spine.set_visible(False)
    low, high = places.min(axis=0), places.max(axis=0)
    margin = (0.16 if points is not None else 0.05) * np.maximum(high - low, 1e-9)
    ax.set_xlim(low[0] - margin[0], high[0] + margin[0])
    ax.set_ylim(low[1] - margin[1], high[1] + margin[1])
    if item_names is None and points is None:
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    if unit is not None:
        _add_length_bar(ax, unit)
    if item_names is not None:
        _add_item_names(ax, places, item_names)
    if points is None or faces is None:
        return ax
    surfaces = real_array(points, "points", (len(places), "n_vertices", 3), batched=False)
    _add_thumbnails(ax, places, items, colors, names, surfaces, faces, view or View())
    return ax


def _add_item_names(ax: Axes, positions: ndarray, names: Sequence[str]) -> None:
    """Write a name beside each point, where no name stands yet."""
    low = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    points = 72 * (positions - low) / [np.ptp(ax.get_xlim()), np.ptp(ax.get_ylim())] * _inches(ax)
    height, corners = 9.0, np.empty((0, 4))
    for place, shown, name in zip(positions, points, names, strict=True):
        width = 5.0 * len(name)
        offsets = np.array([[x, y * height] for y in (0, -1, 1, -2, 2, -3, 3) for x in (5, -5)])
        left = shown[0] + np.where(offsets[:, 0] > 0, offsets[:, 0], offsets[:, 0] - width)
        bottom = shown[1] + offsets[:, 1] - height / 2
        boxes = np.stack([left, bottom, left + width, bottom + height], axis=1)
        apart = (boxes[:, None, 2:] <= corners[None, :, :2]) | (
            corners[None, :, 2:] <= boxes[:, None, :2]
        )
        chosen = int((~apart.any(axis=-1)).sum(axis=1).argmin())
        corners = np.append(corners, boxes[chosen : chosen + 1], axis=0)
        ax.annotate(
            name, place, xytext=tuple(offsets[chosen]), textcoords="offset points", va="center",
            ha="left" if offsets[chosen, 0] > 0 else "right", fontsize="small",
        )  # fmt: skip


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
    ax.plot([left, left + length], [bottom, bottom], color="#8a8f96", linewidth=2, clip_on=False)
    ax.annotate(
        f"{length:g} {unit}", (left, bottom), xytext=(0, 3), textcoords="offset points",
        ha="left", va="bottom", fontsize=_NAME_POINTS,
    )  # fmt: skip


def _add_thumbnails(
    ax: Axes,
    positions: ndarray,
    labels: ndarray,
    colors: ndarray,
    names: Sequence[str] | None,
    points: ndarray,
    faces: ArrayLike,
    view: View,
) -> None:
    """Draw the middle body of each class beside its points, with its name and a line to them."""
    offsetbox = import_optional("matplotlib.offsetbox", "plot")
    classes = np.unique(labels)
    centres = np.stack([np.median(positions[labels == label], axis=0) for label in classes])
    extent = _inches(ax)
    low = np.array([ax.get_xlim()[0], ax.get_ylim()[0]])
    size = np.array([ax.get_xlim()[1], ax.get_ylim()[1]]) - low
    inches = size / extent
    starts = (centres - low) / inches
    titles = [str(k) if names is None else fill(names[k], _NAME_LETTERS) for k in classes]
    letters = np.array([max(map(len, title.split("\n"))) for title in titles])
    widths = 0.5 * _LETTER_WIDTH * letters
    places = free_places((positions - low) / inches, starts, extent, widths)
    for label, title, start, place, width in zip(
        classes, titles, starts, places, widths, strict=True
    ):
        own = np.flatnonzero(labels == label)
        to_centre = np.linalg.norm(
            (positions[own] - np.median(positions[own], axis=0)) / size, axis=1
        )
        body = points[own[to_centre.argmin()]]
        window = window_around(body, view)
        tint = 0.25 + 0.75 * colors[label]
        picture = render(
            body, faces, height=_THUMBNAIL_PIXELS, view=view, window=window, color=tint
        )
        zoom = _THUMBNAIL_INCHES * 72 / _THUMBNAIL_PIXELS
        line = low + np.stack([start, leader_end(start, place, width)]) * inches
        ax.plot(*line.T, color=colors[label], linewidth=0.6, alpha=0.7, zorder=1)
        at = low + place * inches
        ax.add_artist(
            offsetbox.AnnotationBbox(
                offsetbox.OffsetImage(picture, zoom=zoom), at, frameon=False, pad=0, zorder=2
            )
        )
        ax.annotate(
            title, at, xytext=(0, -72 * _NAME_BELOW), textcoords="offset points",
            ha="center", va="top", fontsize=_NAME_POINTS, linespacing=1.0, zorder=4,
        )  # fmt: skip


def _inches(ax: Axes) -> ndarray:
    """Return the width and height of the axes."""
    if ax.figure.get_layout_engine() is not None:
        ax.figure.draw_without_rendering()  # finds them
    return np.asarray(ax.figure.get_size_inches() * ax.get_position().size)


def free_places(items: ndarray, centres: ndarray, size: ndarray, widths: ndarray) -> list[ndarray]:
    """Return a place for each label: near its class, over few items, with its line off names.

    Lengths are inches: `items` has shape (n, 2), `centres` (n_classes, 2), `size` is that of the
    map, `widths` are half the widths of the names.
    """
    angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    spokes = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    steps = np.concatenate([radius * spokes for radius in (0.5, 0.65, 0.8, 1.05, 1.35, 1.7, 2.1)])
    wholes = np.stack([np.maximum(widths, _BODY[0]), np.full(len(widths), _WHOLE_HEIGHT)], axis=1)
    alone = np.stack([widths, np.full(len(widths), _NAME_HEIGHT)], axis=1)
    places: dict[int, ndarray] = {}
    # Each class in turn takes the best place that the others leave, and does so again.
    for index in [*range(len(centres))] * 6:
        candidates = centres[index] + steps
        boxes = candidates + _WHOLE_MIDDLE
        whole, width = wholes[index], widths[index]
        cost = 1.0 * covered(items, boxes, whole) + 4.0 * np.linalg.norm(steps, axis=1)
        cost += 4.0 * covered(items, candidates + _NAME_MIDDLE, alone[index])
        cost += 50.0 * ((boxes < whole) | (boxes > size - whole)).any(axis=1)
        ends = np.stack([leader_end(centres[index], place, width) for place in candidates])
        for other, place in places.items():
            if other == index:
                continue
            gap = np.abs(candidates - place) / (whole + wholes[other])
            cost += 40.0 * np.clip(1.0 - gap, 0, None).prod(axis=1) ** 0.5
            cost += 10.0 * (gap < 1.0).all(axis=1)
            cost += 30.0 * crosses(centres[index], ends, place + _NAME_MIDDLE, alone[other])
            cost += 10.0 * crosses(centres[index], ends, place, _BODY)
            end = leader_end(centres[other], place, widths[other])
            cost += 30.0 * crosses(centres[other], end, candidates + _NAME_MIDDLE, alone[index])
            cost += 10.0 * crosses(centres[other], end, candidates, _BODY)
        places[index] = candidates[cost.argmin()]
    return [places[index] for index in range(len(centres))]


def covered(items: ndarray, middles: ndarray, reach: ndarray) -> ndarray:
    """Return how many items lie within boxes, given by their middles and half their size."""
    return (np.abs(items[None] - middles[:, None]) < reach).all(axis=-1).sum(axis=1)


def leader_end(start: ndarray, place: ndarray, width: float) -> ndarray:
    """Return where the line to a body ends: at the edge of the body with its name."""
    middle = place + _WHOLE_MIDDLE
    whole = np.array([max(width, _BODY[0]), _WHOLE_HEIGHT])
    away = start - middle
    return middle + away * min(1.0, float((whole / np.maximum(np.abs(away), 1e-9)).min()))


def crosses(start: ndarray, end: ndarray, middle: ndarray, reach: ndarray) -> ndarray:
    """Return whether lines cross boxes, given by their middles and half their size."""
    way = np.where(end == start, 1e-12, end - start)
    low, high = (middle - reach - start) / way, (middle + reach - start) / way
    enters = np.minimum(low, high).max(axis=-1)
    leaves = np.maximum(low, high).min(axis=-1)
    return (enters <= leaves) & (leaves >= 0) & (enters <= 1)
