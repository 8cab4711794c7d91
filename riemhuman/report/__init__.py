"""The report of the paper's experiments, and the page of registered scans."""

import warnings
from typing import Any

from riemhuman import plots, retrieval
from riemhuman.report.make import make_report
from riemhuman.report.registered_scans import scan_page

__all__ = ["make_report", "scan_page"]


def __getattr__(name: str) -> Any:
    # Names that have moved stay available to existing scripts.
    for room in (plots, retrieval):
        if name in room.__all__:
            message = f"riemhuman.report.{name} has moved to {room.__name__}.{name}"
            warnings.warn(message, DeprecationWarning, stacklevel=2)
            return getattr(room, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
