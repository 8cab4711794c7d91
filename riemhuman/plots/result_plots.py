"""Plots of energies and retrieval results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Integers, Labels
from riemhuman.checks import checked, instance, length_of, real_array, real_number
from riemhuman.checks.labels import class_numbers, names_of, text
from riemhuman.errors import ArgumentError
from riemhuman.optional import import_matplotlib
from riemhuman.plots.figures import class_colors, new_axes, plain
from riemhuman.plots.maps import named_classes
from riemhuman.retrieval import confusion, precision_recall

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FEWEST_CLASSES = 3  # of a curve or matrix that says more than its scores
# Lightest and deepest shade, and the colour of text that is legible on both.
_LIGHTEST = "#eef3f8"
_DEEPEST = "#5b8fbe"
_ON_SHADES = "#101418"


@checked(lines=instance(Mapping, "a mapping of names to energies"))
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

    Examples
    --------
    >>> ax = rh.plots.plot_energy({"basis": [3.0, 2.0, 1.9], "straight": [3.0, 2.5]})
    """
    curves = energies if isinstance(energies, Mapping) else {"": energies}
    levels = {
        text(name, "lines"): real_number(value, f"lines[{name!r}]")
        for name, value in (lines or {}).items()
    }
    ax = new_axes(ax, 3.6, 2.6)
    colors = class_colors(max(2, len(curves)))
    highest = 0
    for (name, curve), color in zip(curves.items(), colors, strict=False):
        values = np.atleast_1d(real_array(curve, "energies", ("n_iterations",), batched=False))
        highest = max(highest, len(values) - 1)
        title = plain(text(name, "energies")) or None
        ax.plot(np.arange(len(values)), values, color=color, marker=".", label=title)
    for name, value in levels.items():
        above = value == max(levels.values())
        ax.axhline(value, linewidth=0.8, linestyle=(0, (4, 3)), color="#8a8f96")
        ax.annotate(
            plain(name), (1.0, value), xycoords=("axes fraction", "data"),
            xytext=(-2, 3 if above else -3), textcoords="offset points", ha="right",
            va="bottom" if above else "top", fontsize="small",
        )  # fmt: skip
    ax.set(xlabel="iteration", ylabel="energy")
    ax.margins(y=0.16)
    ax.xaxis.get_major_locator().set_params(integer=True)
    ax.set_xlim(-0.04 * max(highest, 1), 1.04 * max(highest, 1))
    _hide_frame(ax)
    if any(curves):  # above the axes, where it covers no line
        ax.legend(frameon=False, fontsize="small", loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return ax


@checked(distances=instance(Mapping, "a mapping of names to matrices of distances"))
def plot_precision_recall(
    distances: Mapping[str, ArrayLike],
    labels: Labels,
    *,
    ax: Axes | None = None,
) -> Axes:
    """Plot precision against recall, see `rh.retrieval.precision_recall`.

    Parameters
    ----------
    distances : mapping of str to array_like, shape (n, n)
        Distances by name of representation.
    labels : sequence of hashable, length n
        Class of each item; none may be missing, see `rh.retrieval.scores`.
    ax : matplotlib.axes.Axes, optional

    Raises
    ------
    ArgumentError
        If there are fewer than three classes.

    Examples
    --------
    >>> place = np.array([0.0, 1.0, 5.0, 6.0, 9.0, 11.0])
    >>> D = np.abs(place[:, None] - place)
    >>> ax = rh.plots.plot_precision_recall({"toy": D}, [0, 0, 1, 1, 2, 2])
    """
    _check_classes(class_numbers(labels, "labels", length_of(labels, "labels"))[0])
    ax = new_axes(ax, 4.2, 3.2)
    for (name, matrix), color in zip(distances.items(), class_colors(len(distances)), strict=True):
        recall, precision = precision_recall(matrix, labels)
        title = plain(text(name, "distances"))
        ax.plot(100 * recall, 100 * precision, color=color, marker=".", label=title)
    ax.set(xlabel="recall, %", ylabel="precision, %", xlim=(0, 102), ylim=(0, 104))
    _hide_frame(ax)
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
    labels : array_like of int, shape (n,)
        Class of each item, counted from 0; none may be missing, see `rh.retrieval.scores`.
    names : sequence of str, optional
        Names of the classes.
    ax : matplotlib.axes.Axes, optional

    Raises
    ------
    ArgumentError
        If there are fewer than three classes.

    Examples
    --------
    >>> place = np.array([0.0, 1.0, 5.0, 6.0, 9.0, 11.0])
    >>> D = np.abs(place[:, None] - place)
    >>> ax = rh.plots.plot_confusion(D, [0, 0, 1, 1, 2, 2])
    """
    items, named = named_classes(labels, names, length_of(distances, "distances"))
    _check_classes(items)
    counts = confusion(distances, items)
    titles = [plain(named[label]) for label in np.unique(items)]
    ax = new_axes(ax, 4.2, 4.0)
    without_zeros = np.ma.masked_equal(counts.astype(np.float64), 0.0)
    _heat_map(ax, without_zeros, counts.sum(axis=1).max(), titles, titles, digits=1)
    ax.tick_params(axis="x", labelrotation=90)
    ax.set(xlabel="nearest neighbour", ylabel="body")
    return ax


def _check_classes(items: Integers) -> None:
    count = len(np.unique(items))
    if count < FEWEST_CLASSES:
        raise ArgumentError(
            f"labels must name at least {FEWEST_CLASSES} classes for this plot; found {count}: "
            "rh.retrieval.scores gives the same in numbers"
        )


def plot_sweep(
    scores: ArrayLike, lams: Sequence[float], weights: Sequence[str], *, ax: Axes | None = None
) -> Axes:
    """Plot a score over λ and the weights of the metric.

    Parameters
    ----------
    scores : array_like, shape (n_lams, n_weights)
        Per cent.
    lams : sequence of float
        λ of each row.
    weights : sequence of str
        Label of each column.
    ax : matplotlib.axes.Axes, optional

    Examples
    --------
    >>> ax = rh.plots.plot_sweep([[90, 95], [80, 99]], [1e-4, 1], ["c = 0", "c = 1"])
    """
    rows = real_array(lams, "lams", ("n_lams",), batched=False)
    columns = names_of(weights, "weights", length_of(weights, "weights"), "columns")
    if not (len(rows) and len(columns)):
        raise ArgumentError("lams and weights must hold at least one entry each; found none")
    cells = real_array(scores, "scores", (len(rows), len(columns)), batched=False)
    ax = new_axes(ax, 5.2, 3.0)
    labels = [f"{lam:g}" for lam in rows]
    _heat_map(ax, np.ma.array(cells), 100.0, labels, [plain(column) for column in columns])
    ax.set(xlabel="c (with a = 1)", ylabel="λ")
    return ax


def _heat_map(
    ax: Axes,
    values: np.ma.MaskedArray[tuple[int, ...], np.dtype[np.float64]],
    largest: float,
    rows: Sequence[str],
    columns: Sequence[str],
    *,
    digits: int = 0,
) -> None:
    """Draw a matrix in shades of blue, on which its values are legible."""
    colors = import_matplotlib("colors")
    shades = colors.LinearSegmentedColormap.from_list("shades", [_LIGHTEST, _DEEPEST])
    ax.imshow(values, cmap=shades, vmin=0, vmax=largest, aspect="auto", interpolation="nearest")
    for spine in ax.spines.values():
        spine.set_visible(False)
    ax.tick_params(length=0)
    ax.set_xticks(range(len(columns)), columns)
    ax.set_yticks(range(len(rows)), rows)
    for row, column in np.argwhere(~np.ma.getmaskarray(values)):
        written = f"{values[row, column]:.{digits}f}".removesuffix(".0")
        ax.text(column, row, written, ha="center", va="center", fontsize="small", color=_ON_SHADES)


def _hide_frame(ax: Axes) -> None:
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
