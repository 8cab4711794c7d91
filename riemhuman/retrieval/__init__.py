"""Retrieval: rankings of bodies by distance, their scores, and exact nearest neighbours."""

from riemhuman.retrieval.benchmark import BenchmarkRecord, benchmark
from riemhuman.retrieval.neighbors import NearestNeighbors
from riemhuman.retrieval.rankings import confusion, precision_recall
from riemhuman.retrieval.scores import RetrievalScores, scores
from riemhuman.retrieval.tables import TableRow, format_benchmark, format_table, retrieval_table

__all__ = [
    "BenchmarkRecord",
    "NearestNeighbors",
    "RetrievalScores",
    "TableRow",
    "benchmark",
    "confusion",
    "format_benchmark",
    "format_table",
    "precision_recall",
    "retrieval_table",
    "scores",
]


def __dir__() -> list[str]:
    return sorted(__all__)
