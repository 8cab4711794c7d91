"""Retrieval tables as text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from numpy import ndarray

from riemhuman.retrieval.scores import RetrievalScores, scores


@dataclass(frozen=True)
class TableRow:
    """Scores of one representation on one task.

    Attributes
    ----------
    representation : str
        Name of the representation.
    scores : RetrievalScores
        Its scores.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> row = rh.retrieval.retrieval_table({"toy": D}, np.array([0, 0, 1, 1]))[0]
    >>> row.representation, row.scores.first_tier
    ('toy', 100.0)
    """

    representation: str
    scores: RetrievalScores


def retrieval_table(
    distances: Mapping[str, ndarray], labels: ndarray, groups: ndarray | None = None
) -> list[TableRow]:
    """Return the scores of several distance matrices for the same labels.

    Parameters
    ----------
    distances : mapping of str to array, shape (n, n)
        Distance matrices by name of representation.
    labels : array, shape (n,)
        Class of each body.
    groups : array, shape (n,), optional
        Groups, such as people: bodies of the group of a query are left out.

    Returns
    -------
    list of TableRow
        In the order of `distances`.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> row = rh.retrieval.retrieval_table({"toy": D}, np.array([0, 0, 1, 1]))[0]
    >>> row.representation, row.scores.first_tier
    ('toy', 100.0)
    """
    return [TableRow(name, scores(matrix, labels, groups)) for name, matrix in distances.items()]


def format_table(title: str, rows: list[TableRow]) -> str:
    """Return a table as text, one line per representation.

    Parameters
    ----------
    title : str
        Title of the first column.
    rows : list of TableRow
        Rows.

    Returns
    -------
    str

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> rows = rh.retrieval.retrieval_table({"toy": D}, np.array([0, 0, 1, 1]))
    >>> print(rh.retrieval.format_table("Who is it?", rows))
    Who is it?     NN     FT     ST
    toy         100.0  100.0  100.0
    """
    width = max(len(title), *(len(row.representation) for row in rows))
    lines = [f"{title:<{width}}     NN     FT     ST"]
    lines += [
        f"{row.representation:<{width}}  {row.scores.nn:5.1f}  {row.scores.first_tier:5.1f}"
        f"  {row.scores.second_tier:5.1f}"
        for row in rows
    ]
    return "\n".join(lines)
