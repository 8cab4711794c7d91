"""Plots of embeddings, energies and retrieval results."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import integer_array, real_array
from riemhuman.errors import ArgumentError
from riemhuman.optional import import_optional
from riemhuman.plots.body_plots import new_axes
from riemhuman.plots.colors import class_colors
from riemhuman.plots.map_labels import add_length_bar, add_thumbnails
from riemhuman.retrieval.rankings import confusion, precision_recall
from riemhuman.surfaces.rendering import View

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARKERS = ("o", "s", "D", "^", "v")
# Lightest and deepest shade, and the colour of text that is legible on both.
_LIGHTEST, _DEEPEST, _ON_SHADES = "#eef3f8", "#5b8fbe", "#101418"


def plot_embedding(
    positions: ArrayLike,
    labels: ArrayLike,
    names: Sequence[str] | None = None,
    *,
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
    points : array_like, shape (n, V, 3), optional
        Bodies of the items; the body nearest to the middle of each class is drawn.
    faces : array_like, shape (F, 3), optional
        Triangles of the bodies.
    view : View, optional
        Direction from which the bodies are seen.
    unit : str, optional
        Unit of the positions, for a scale bar; both axes then have the same scale.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If an array has the wrong shape, or only one of points and faces is given.
    MissingDependencyError
        If matplotlib is not installed.

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
    if points is None or faces is None:
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False, fontsize="small")
    if unit is not None:
        add_length_bar(ax, unit)
    if points is None or faces is None:
        return ax
    surfaces = real_array(points, "points", (len(places), "n_vertices", 3), batched=False)
    add_thumbnails(ax, places, items, colors, names, surfaces, faces, view or View())
    return ax


def plot_energy(
    energies: ArrayLike | Mapping[str, ArrayLike],
    *,
    lines: Mapping[str, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot the energy of a path after each iteration.

    Parameters
    ----------
    energies : array_like, shape (n_iterations + 1,), or mapping of str to such
        Energies of a `PathResult`, or of several results by name.
    lines : mapping of str to float, optional
        Energies to compare with by name, drawn as horizontal lines.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    MissingDependencyError
        If matplotlib is not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> ax = rh.plots.plot_energy({"basis": [3.0, 2.0, 1.9], "straight": [3.0, 2.5]})
    """
    curves = energies if isinstance(energies, Mapping) else {"": energies}
    ax = new_axes(ax, 3.6, 2.6)
    colors = class_colors(max(2, len(curves)))
    highest = 0
    for (name, curve), color in zip(curves.items(), colors, strict=False):
        values = np.atleast_1d(real_array(curve, "energies", ("n_iterations",), batched=False))
        highest = max(highest, len(values) - 1)
        ax.plot(np.arange(len(values)), values, color=color, marker=".", label=name or None)
    level = dict(lines or {})
    for name, value in level.items():
        above = value == max(level.values())
        ax.axhline(value, linewidth=0.8, linestyle=(0, (4, 3)), color="#8a8f96")
        ax.annotate(
            name, (1.0, value), xycoords=("axes fraction", "data"),
            xytext=(-2, 3 if above else -3), textcoords="offset points", ha="right",
            va="bottom" if above else "top", fontsize="small",
        )  # fmt: skip
    ax.set(xlabel="iteration", ylabel="energy")
    ax.margins(y=0.16)
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.set_xlim(-0.04 * max(highest, 1), 1.04 * max(highest, 1))
    _bare(ax)
    if any(curves):
        ax.legend(frameon=False, fontsize="small")
    return ax


def plot_precision_recall(
    distances: Mapping[str, ArrayLike],
    labels: Sequence[Hashable] | ndarray,
    *,
    ax: Axes | None = None,
) -> Axes:
    """Plot precision against recall, see `rh.retrieval.precision_recall`.

    Parameters
    ----------
    distances : mapping of str to array_like, shape (n, n)
        Distance matrices by name of representation.
    labels : sequence of hashable, length n
        Class of each item.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If a matrix and the labels have different sizes.
    MissingDependencyError
        If matplotlib is not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> D = space.metric.dist_pairwise(bodies.points[:30])
    >>> ax = rh.plots.plot_precision_recall({"shape": D}, bodies.subject[:30])
    """
    ax = new_axes(ax, 4.2, 3.2)
    styles = ("-", (0, (5, 1.5)), (0, (1.5, 1)))
    for index, (name, matrix) in enumerate(distances.items()):
        recall, precision = precision_recall(matrix, labels)
        ax.plot(
            100 * recall,
            100 * precision,
            color=class_colors(max(10, len(distances)))[index],
            linestyle=styles[index // 10 % len(styles)],
            marker=".",
            label=name,
        )
    ax.set(xlabel="recall, %", ylabel="precision, %", xlim=(0, 102), ylim=(0, 104))
    _bare(ax)
    ax.legend(
        frameon=False, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2
    )
    return ax


def plot_confusion(
    distances: ArrayLike,
    labels: ArrayLike,
    names: Sequence[str] | None = None,
    *,
    ax: Axes | None = None,
) -> Axes:
    """Plot the confusion matrix of nearest neighbours, see `rh.retrieval.confusion`.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Distances between the items.
    labels : array_like of int, shape (n,)
        Class of each item, counted from 0.
    names : sequence of str, optional
        Names of the classes.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If the matrix and the labels have different sizes.
    MissingDependencyError
        If matplotlib is not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> D = space.metric.dist_pairwise(bodies.points[:30])
    >>> ax = rh.plots.plot_confusion(D, bodies.subject[:30])
    """
    items = integer_array(labels, "labels", ("n_items",))
    counts = confusion(distances, items)
    classes = np.unique(items)
    titles = [str(label) if names is None else names[label] for label in classes]
    ax = new_axes(ax, 4.2, 4.0)
    heat_map(ax, np.ma.masked_equal(counts, 0), counts.sum(axis=1).max())
    ax.set_xticks(range(len(titles)), titles, rotation=90)
    ax.set_yticks(range(len(titles)), titles)
    ax.set(xlabel="nearest neighbour", ylabel="body")
    for row, column in np.argwhere(counts):
        write_in_cell(ax, row, column, str(counts[row, column]))
    return ax


def plot_sweep(
    scores: ArrayLike,
    lams: Sequence[float],
    weights: Sequence[str],
    *,
    ax: Axes | None = None,
) -> Axes:
    """Plot a score over λ and the weights of the metric.

    Parameters
    ----------
    scores : array_like, shape (n_lams, n_weights)
        Scores, per cent.
    lams : sequence of float
        λ of each row.
    weights : sequence of str
        Label of the weights of each column.
    ax : matplotlib.axes.Axes, optional
        Axes to draw in; by default those of a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    ArgumentError
        If the scores have the wrong shape.
    MissingDependencyError
        If matplotlib is not installed.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> scores = np.array([[90.0, 95.0], [80.0, 99.0]])
    >>> ax = rh.plots.plot_sweep(scores, [1e-4, 1.0], ["c = 0", "c = 1"])
    """
    cells = real_array(scores, "scores", (len(lams), len(weights)), batched=False)
    ax = new_axes(ax, 5.2, 3.0)
    heat_map(ax, cells, 100.0)
    ax.set_xticks(range(len(weights)), weights)
    ax.set_yticks(range(len(lams)), [f"{lam:g}" for lam in lams])
    ax.set(xlabel="c (with a = 1)", ylabel="λ")
    for (row, column), score in np.ndenumerate(cells):
        write_in_cell(ax, row, column, f"{score:.0f}")
    return ax


def heat_map(ax: Axes, values: ndarray, largest: float) -> None:
    """Draw a matrix in shades from almost white to blue, on which dark text is legible.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes to draw in.
    values : array, shape (n_rows, n_columns)
        Non-negative values; masked ones have no shade.
    largest : float
        Value with the deepest shade.
    """
    colors = import_optional("matplotlib.colors", "plot")
    shades = colors.LinearSegmentedColormap.from_list("shades", [_LIGHTEST, _DEEPEST])
    ax.imshow(values, cmap=shades, vmin=0, vmax=largest, aspect="auto", interpolation="nearest")
    for spine in ax.spines.values():
        spine.set_visible(False)
    ax.tick_params(length=0)


def write_in_cell(ax: Axes, row: int, column: int, text: str) -> None:
    """Write text into a cell of a heat map.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes of the heat map.
    row, column : int
        Position of the cell.
    text : str
        The text.
    """
    ax.text(column, row, text, ha="center", va="center", fontsize="small", color=_ON_SHADES)


def _bare(ax: Axes) -> None:
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
