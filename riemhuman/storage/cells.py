"""Cells of CSV files that no spreadsheet runs as formulas."""

from __future__ import annotations

import unicodedata

_FORMULA = ("=", "+", "-", "@")


def cell(text: str) -> str:
    """Return a text as a cell of a table that is safe to open in a spreadsheet.

    Parameters
    ----------
    text : str
        Any text, such as a file name or a label from somebody else.

    Returns
    -------
    str
        The text with spaces for control characters and line ends, with backslash escapes for bytes
        that are not text, and with an apostrophe before it if a spreadsheet would compute it.
    """
    known = text.encode("utf-8", "backslashreplace").decode("utf-8")
    line = "".join(" " if unicodedata.category(c) in ("Cc", "Zl", "Zp") else c for c in known)
    return f"'{line}" if line.lstrip().startswith(_FORMULA) else line
