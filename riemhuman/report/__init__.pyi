"""Public names of `riemhuman.report`."""

from .make import make_report as make_report
from .registered_scans import scan_page as scan_page
from .sheet_folders import make_sheets as make_sheets
from .sheet_values import SheetRow as SheetRow
from .sheets import (
    Sheet as Sheet,
    sheet as sheet,
)
