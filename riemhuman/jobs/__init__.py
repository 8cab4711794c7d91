"""Resumable jobs: distances and paths of more bodies than fit in memory or in one run."""

from riemhuman.jobs.pairwise import pairwise_job
from riemhuman.jobs.paths import path_job

__all__ = ["pairwise_job", "path_job"]


def __dir__() -> list[str]:
    return sorted(__all__)
