"""Retrieval: rankings by distance, scores, nearest neighbours, benchmarks and resumable jobs."""

from riemhuman.retrieval.benchmarks import (
    BenchmarkRecord,
    benchmark,
    format_benchmark,
    representations,
)
from riemhuman.retrieval.jobs import pairwise_job, path_job
from riemhuman.retrieval.neighbors import NearestNeighbors
from riemhuman.retrieval.scores import (
    RetrievalScores,
    confusion,
    format_table,
    local_scaling,
    precision_recall,
    retrieval_table,
    scores,
)

__all__ = [
    "BenchmarkRecord",
    "NearestNeighbors",
    "RetrievalScores",
    "benchmark",
    "confusion",
    "format_benchmark",
    "format_table",
    "local_scaling",
    "pairwise_job",
    "path_job",
    "precision_recall",
    "representations",
    "retrieval_table",
    "scores",
]


def __dir__() -> list[str]:
    return sorted(__all__)
