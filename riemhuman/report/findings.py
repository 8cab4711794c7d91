"""Sentences on the results, each only if the results support it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy import ndarray

_TASKS = {"shape": "people", "pose": "poses"}


def chance_of_tier(labels: ndarray) -> float:
    """Return the mean first tier of items in random order, per cent.

    Parameters
    ----------
    labels : array, shape (n,)
        Class of each item.

    Returns
    -------
    float
    """
    _, inverse, counts = np.unique(labels, return_inverse=True, return_counts=True)
    others = counts[inverse] - 1
    asked = others > 0
    return float(100 * (others[asked] / (len(labels) - 1)).mean()) if asked.any() else 0.0


def below_chance(rows: Sequence[Mapping[str, Any]], metric: str, labels: ndarray) -> str:
    """Return a sentence if a metric finds fewer bodies of a class than chance would.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the retrieval table.
    metric : str
        Name of the metric.
    labels : array, shape (n,)
        Class of each item.

    Returns
    -------
    str
    """
    found = next(row["first_tier"] for row in rows if row["representation"] == metric)
    chance = chance_of_tier(labels)
    if found >= chance:
        return ""
    return (
        f"Chance alone would put {chance:.1f} % into the first tier, more than the {found:.1f} % "
        f"of the {metric}: it ranks bodies of another class first."
    )


def best_weights(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a sentence on the weights that score highest on people and on poses.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the sweep.

    Returns
    -------
    str
    """
    said = []
    for task, what in _TASKS.items():
        key = f"{task}_mean_average_precision"
        if key not in rows[0]:
            continue
        best = max(row[key] for row in rows)
        first = next(row for row in rows if row[key] == best)
        lam = "" if first["lam"] is None else f", λ = {first['lam']:g}"
        ties = sum(row[key] == best for row in rows) - 1
        more = f" (and {ties} other {'choice' if ties == 1 else 'choices'})" if ties else ""
        said.append(
            f"{what} with a = {first['a']:g}{lam}, c = {first['c']:g}{more}: mAP {best:.1f} %"
        )
    return f"The best are {'; '.join(said)}." if said else ""


def neighbours_kept(positions: ndarray, labels: ndarray) -> float:
    """Return the percentage of items whose nearest neighbour on a map shares their class.

    Parameters
    ----------
    positions : array, shape (n, 2)
        Positions of the items.
    labels : array, shape (n,)
        Class of each item.

    Returns
    -------
    float
    """
    gaps = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    np.fill_diagonal(gaps, np.inf)
    return float(100 * (labels[gaps.argmin(axis=1)] == labels).mean())


def shares(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a sentence on the share of the normal part in squared distances.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the table of differences.

    Returns
    -------
    str
    """
    said = [
        f"{100 * row['normal_part'] / row['squared_distance']:.0f} % for {row['pair']}"
        for row in rows
        if row["squared_distance"] > 0
    ]
    return f"The normal part is {' and '.join(said)}." if said else ""
