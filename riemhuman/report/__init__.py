"""The report of the paper's experiments, the page of registered scans, and people's sheets."""

from riemhuman.report.make import make_report
from riemhuman.report.registered_scans import scan_page
from riemhuman.report.sheet_folders import make_sheets
from riemhuman.report.sheet_values import SheetRow
from riemhuman.report.sheets import Sheet, sheet

__all__ = ["Sheet", "SheetRow", "make_report", "make_sheets", "scan_page", "sheet"]


def __dir__() -> list[str]:
    return sorted(__all__)
