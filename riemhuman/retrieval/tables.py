"""Retrieval tables as text."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from numpy import ndarray

from riemhuman.retrieval.benchmark import POSE_METRIC, SHAPE_METRIC, BenchmarkRecord
from riemhuman.retrieval.scores import RetrievalScores, scores

_TITLES = {"shape": "Who is it?", "pose": "How do they stand?"}
_OURS = {"shape": SHAPE_METRIC, "pose": POSE_METRIC}
_COLUMNS = {
    "NN": "nn",
    "FT": "first_tier",
    "ST": "second_tier",
    "mAP": "mean_average_precision",
}


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


def retrieval_table(distances: Mapping[str, ndarray], labels: ndarray) -> list[TableRow]:
    """Return the scores of several distance matrices for the same labels.

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

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> D = np.array([[0, 1, 5, 6], [1, 0, 4, 5], [5, 4, 0, 1], [6, 5, 1, 0]])
    >>> row = rh.retrieval.retrieval_table({"toy": D}, np.array([0, 0, 1, 1]))[0]
    >>> row.representation, row.scores.first_tier
    ('toy', 100.0)
    """
    return [TableRow(name, scores(matrix, labels)) for name, matrix in distances.items()]


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


def format_benchmark(
    records: Sequence[BenchmarkRecord], ours: Mapping[str, str] | None = None
) -> str:
    """Format a benchmark as text tables, with the representations that score higher than ours.

    Parameters
    ----------
    records : sequence of BenchmarkRecord
        Records of `riemhuman.retrieval.benchmark`.
    ours : mapping of str to str, optional
        Representation by task that the others are compared with; by default the paper's shape
        metric and pose metric.

    Returns
    -------
    str
        One table per task, with an asterisk at the best of each column. Sentences below it say
        which representations are better than ours, and which failed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> shape = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template))
    >>> text = rh.retrieval.format_benchmark(rh.retrieval.benchmark(bodies, {"ours": shape}))
    >>> "ours" in text
    True
    """
    ours = _OURS if ours is None else ours
    tasks = dict.fromkeys(record.task for record in records)
    return "\n\n".join(
        _task_table(task, [record for record in records if record.task == task], ours.get(task))
        for task in tasks
    )


def _task_table(task: str, records: list[BenchmarkRecord], ours: str | None) -> str:
    title = _TITLES.get(task, task)
    width = max(len(title), *(len(record.representation) for record in records))
    columns = {
        name: {
            record.representation: round(getattr(record.scores, field), 1)
            for record in records
            if record.scores is not None
        }
        for name, field in _COLUMNS.items()
    }
    best = {name: max(column.values(), default=0.0) for name, column in columns.items()}
    header = "".join(f"{name:>6} " for name in columns)
    lines = [f"{title:<{width}}  {header} ms a body  ms a pair"]
    for record in records:
        if record.scores is None:
            lines.append(f"{record.representation:<{width}}  failed")
            continue
        cells = "".join(
            f"{column[record.representation]:6.1f}"
            + ("*" if column[record.representation] == best[name] else " ")
            for name, column in columns.items()
        )
        body = f"{1e3 * record.seconds_per_body:9.1f}" if record.seconds_per_body else f"{'-':>9}"
        pair = f"{1e3 * record.seconds_per_pair:9.4f}"
        lines.append(f"{record.representation:<{width}}  {cells} {body}  {pair}")
    lines += _verdict(columns, ours)
    lines += [
        f"{record.representation} failed: {record.problem}"
        for record in records
        if record.scores is None
    ]
    return "\n".join(lines)


def _verdict(columns: Mapping[str, Mapping[str, float]], ours: str | None) -> list[str]:
    """Return sentences that say what is better than ours."""
    if ours is None or ours not in columns["NN"]:
        return []
    lines = []
    for name, column in columns.items():
        better = sorted(
            (row for row in column if column[row] > column[ours]), key=lambda row: -column[row]
        )
        if better:
            listed = ", ".join(f"{row} ({column[row]:.1f})" for row in better)
            lines.append(f"Better than {ours} in {name} ({column[ours]:.1f}): {listed}.")
    return lines or [f"Nothing is better than {ours}."]
