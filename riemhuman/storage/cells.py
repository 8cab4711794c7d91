"""Cells of CSV files that no spreadsheet takes for code."""

from __future__ import annotations

import unicodedata

_FORMULA = ("=", "+", "-", "@")


def cell(text: str) -> str:
    """Return a text as a cell of a table that spreadsheets open.

    Parameters
    ----------
    text : str
        Any text, such as the name of a file or a label that somebody else has chosen.

    Returns
    -------
    str
        Without line ends and other control characters; behind an apostrophe if a spreadsheet would
        compute it; bytes that are no text as backslashes and numbers.
    """
    known = text.encode("utf-8", "backslashreplace").decode("utf-8")
    line = "".join(" " if unicodedata.category(c) in ("Cc", "Zl", "Zp") else c for c in known)
    return f"'{line}" if line.lstrip().startswith(_FORMULA) else line
