"""The command ``formats``: what can be done with each kind of file, by its reader."""

from __future__ import annotations

import argparse
from itertools import zip_longest
from textwrap import wrap

import riemhuman as rh
from riemhuman.cli import _commands as cli

_TITLES = ("I have", "endings", "read by", "registered", "measured", "motions", "written back")
# Columns of the printed table, which fits 100 letters; JSON also has the functions.
_SHOWN = ("I have", "endings", "registered", "measured", "written back")
_WIDTHS = (30, 22, 17, 13, 10)


def file_kinds() -> tuple[rh.io.FileKind, ...]:
    """Return what all readers of riemhuman declare, and those of others imported so far."""
    # Readers declare their files when their modules are imported.
    import riemhuman.bodies
    import riemhuman.datasets
    import riemhuman.registration

    return riemhuman.io.file_kinds()


def _cells(kind: rh.io.FileKind) -> tuple[str, ...]:
    """Return the row of the table."""
    return (
        kind.name,
        " ".join(kind.endings),
        f"`{kind.reader_name}`",
        kind.registered,
        kind.measured,
        "yes" if kind.is_motion else "",
        " ".join(kind.written),
    )


def format_table() -> str:
    """Return a table of all kinds of files, whose cells are wrapped."""
    lines = []
    for row in (_TITLES, *(_cells(kind) for kind in file_kinds())):
        cells = dict(zip(_TITLES, row, strict=True))
        parts = [
            wrap(cells[title].replace("`", ""), width, break_long_words=False)
            for title, width in zip(_SHOWN, _WIDTHS, strict=True)
        ]
        for line in zip_longest(*parts, fillvalue=""):
            shown = (f"{text:{width}}" for text, width in zip(line, _WIDTHS, strict=True))
            lines.append("  ".join(shown).rstrip())
        lines.append("")
    return "\n".join(lines[:-1])


@cli.command(
    "formats",
    "Prints a table of the files that can be read: what registers them, whether they can be\n"
    "measured, and in which formats they can be written. --json also names the functions of the\n"
    "library that read them.",
    "  riemhuman formats\n  riemhuman formats --json\n",
)
def _formats(options: argparse.Namespace) -> cli.Answer:
    del options
    record = [dict(zip(_TITLES, _cells(kind), strict=True)) for kind in file_kinds()]
    return cli.Answer(format_table(), record)
