"""Retrieval: rankings by distance, their scores, nearest neighbours and resumable jobs."""

from riemhuman.retrieval.jobs import pairwise_job, path_job
from riemhuman.retrieval.neighbors import NearestNeighbors
from riemhuman.retrieval.rankings import confusion, precision_recall
from riemhuman.retrieval.scores import RetrievalScores, local_scaling, scores
from riemhuman.retrieval.tables import TableRow, format_table, retrieval_table

__all__ = [
    "NearestNeighbors",
    "RetrievalScores",
    "TableRow",
    "confusion",
    "format_table",
    "local_scaling",
    "pairwise_job",
    "path_job",
    "precision_recall",
    "retrieval_table",
    "scores",
]


def __dir__() -> list[str]:
    return sorted(__all__)
