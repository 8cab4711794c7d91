"""The report of the paper's experiments, retrieval benchmarks, and the page of registered scans."""

from riemhuman.report.make import make_report
from riemhuman.report.registered_scans import scan_page
from riemhuman.report.retrieval_benchmark import (
    BenchmarkRecord,
    benchmark,
    format_benchmark,
    representations,
)

__all__ = [
    "BenchmarkRecord",
    "benchmark",
    "format_benchmark",
    "make_report",
    "representations",
    "scan_page",
]


def __dir__() -> list[str]:
    return sorted(__all__)
