"""The report of the paper's experiments, and the page of registered scans."""

from riemhuman.report.make import make_report
from riemhuman.report.registered_scans import scan_page

__all__ = ["make_report", "scan_page"]


def __dir__() -> list[str]:
    return sorted(__all__)
