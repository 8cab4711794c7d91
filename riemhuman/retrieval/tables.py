"""Retrieval tables of labelled bodies: who it is, and how they stand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from numpy import ndarray

from riemhuman.retrieval.scores import RetrievalScores, scores


@dataclass(frozen=True)
class TableRow:
    """One representation's scores on one task.

    Attributes
    ----------
    representation : str
        What the distances are made of.
    scores : RetrievalScores
        Nearest neighbour, first and second tier, in per cent.
    """

    representation: str
    scores: RetrievalScores


def retrieval_table(distances: Mapping[str, ndarray], labels: ndarray) -> list[TableRow]:
    """Return the scores of several distance matrices against the same labels.

    Parameters
    ----------
    distances : mapping of str to array, shape (n, n)
        Distance matrices by name of representation.
    labels : array, shape (n,)
        Class of each body.

    Returns
    -------
    list of TableRow
        In the order of `distances`.
    """
    return [TableRow(name, scores(matrix, labels)) for name, matrix in distances.items()]


def format_table(title: str, rows: list[TableRow]) -> str:
    """Return a table as text, one line a representation.

    Parameters
    ----------
    title : str
        What is retrieved.
    rows : list of TableRow
        Rows.

    Returns
    -------
    str
    """
    width = max(len(title), *(len(row.representation) for row in rows))
    lines = [f"{title:<{width}}     NN     FT     ST"]
    lines += [
        f"{row.representation:<{width}}  {row.scores.nn:5.1f}  {row.scores.first_tier:5.1f}"
        f"  {row.scores.second_tier:5.1f}"
        for row in rows
    ]
    return "\n".join(lines)
