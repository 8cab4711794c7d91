"""Verbs of the command line: how each is declared, with the options that all have."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TypeAlias

_CHOICE = re.compile(r"(?s)(.*invalid choice: '(?P<found>[^']*)') \(choose from (?P<known>.*)\)")

Run = Callable[[argparse.Namespace], None]

# What `add_subparsers` returns has no public name, and is generic for type checkers alone.
Verbs: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


class Parser(argparse.ArgumentParser):
    """A parser whose errors say what may have been meant."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse, and refuse what is left over with the nearest option of the verb.

        Parameters
        ----------
        args : sequence of str, optional
            The command line.
        namespace : argparse.Namespace, optional
            Where the options go.

        Returns
        -------
        argparse.Namespace
        """
        options, unknown = self.parse_known_args(args, namespace)
        if unknown:
            parser: argparse.ArgumentParser = getattr(options, "parser", self)
            known = [name for action in parser._actions for name in action.option_strings]
            named = [name.split("=")[0] for name in unknown if name.startswith("-")]
            found = [near for name in named for near in _nearest(name, known)]
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{_meant(found)}")
        return options

    def error(self, message: str) -> NoReturn:
        """Refuse, and leave out what was known where something near to it was meant.

        Parameters
        ----------
        message : str
            What is wrong.
        """
        choice = _CHOICE.fullmatch(message)
        if choice:
            known = re.findall(r"[^\s,']+", choice["known"])
            near = _nearest(choice["found"], known)
            message = choice[1] + _meant(near) if near else message
        super().error(message)


def _nearest(found: str, known: Sequence[str]) -> list[str]:
    return difflib.get_close_matches(found, known, 1)


def _meant(names: Sequence[str]) -> str:
    return f"; did you mean {' and '.join(names)}?" if names else ""


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
    parser.set_defaults(run=run, parser=parser)
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
