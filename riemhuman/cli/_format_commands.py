"""The command ``formats``: what can be done with each kind of file, by its reader."""

from __future__ import annotations

import argparse

import riemhuman as rh
from riemhuman.cli import _commands as cli

_TITLES = ("I have", "endings", "read by", "registered", "measured", "motions", "written back")


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
    """Return the table of all kinds of files, as Markdown."""
    rows = [_TITLES, ("---",) * len(_TITLES), *(_cells(kind) for kind in file_kinds())]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


@cli.command(
    "formats",
    "what can be done with which files",
    "Prints a table of the files that can be read: which function reads them, what registers\n"
    "them, whether they can be measured, whether they are motions, and in which formats they\n"
    "can be written.",
    "  riemhuman formats\n  riemhuman formats --json\n",
)
def _formats(options: argparse.Namespace) -> cli.Answer:
    del options
    record = [dict(zip(_TITLES, _cells(kind), strict=True)) for kind in file_kinds()]
    return cli.Answer(format_table(), record)
