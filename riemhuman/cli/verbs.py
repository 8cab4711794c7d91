"""Verbs of the command line: how each is declared, with the options that all have."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TypeAlias

Run = Callable[[argparse.Namespace], None]

# What `add_subparsers` returns has no public name, and is generic for type checkers alone.
Verbs: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


def add_verb(
    verbs: Verbs, name: str, run: Run, summary: str, description: str, examples: str
) -> argparse.ArgumentParser:
    """Declare a verb.

    Parameters
    ----------
    verbs : argparse action
        Where verbs are declared.
    name : str
        The verb.
    run : callable
        Called with the parsed options.
    summary : str
        What it does, in a few words, for the list of verbs.
    description : str
        What it does.
    examples : str
        Command lines, one a line, with explanations behind ``#``.

    Returns
    -------
    argparse.ArgumentParser
        To be given the verb's own options.
    """
    parser = verbs.add_parser(
        name,
        help=summary,
        description=description,
        epilog=f"examples:\n{examples}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.set_defaults(run=run)
    add_debug(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress, results alone")
    return parser


def add_debug(parser: argparse.ArgumentParser) -> None:
    """Declare the option that shows where an error comes from.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Where to declare it: before and behind the verb.
    """
    parser.add_argument(
        "--debug",
        action="store_true",
        default=argparse.SUPPRESS,
        help="show the traceback of an error",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """Declare the option for results that programs read.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument("--json", action="store_true", help="print the result as JSON, all digits")


def add_force(parser: argparse.ArgumentParser) -> None:
    """Declare the option to replace what is there.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument("-f", "--force", action="store_true", help="replace an output that exists")
