"""Declaration of verbs, and the options that many of them share."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TypeAlias

from riemhuman.cli.inputs import path_argument

_CHOICE = re.compile(r"(?s)(.*invalid choice: '(?P<found>[^']*)') \(choose from (?P<known>.*)\)")

Run = Callable[[argparse.Namespace], None]

# The result of `add_subparsers` has no public name, and only type checkers know its parameter.
Verbs: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"


class Parser(argparse.ArgumentParser):
    """A parser whose errors suggest similar names."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse; for an unknown option, suggest the nearest option of the verb.

        Parameters
        ----------
        args : sequence of str, optional
            The command line.
        namespace : argparse.Namespace, optional
            Object that receives the options.

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
        """Print an error and exit; for an unknown choice, suggest the nearest one.

        Parameters
        ----------
        message : str
            The error.
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
        The parser's verbs.
    name : str
        Name of the verb.
    run : callable
        Function of the parsed options that runs the verb.
    summary : str
        A few words for the list of verbs.
    description : str
        Description for the help of the verb.
    examples : str
        Command lines, one per line, with comments after ``#``.

    Returns
    -------
    argparse.ArgumentParser
        Parser of the verb.
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
    parser.add_argument(
        "-q", "--quiet", action="store_true", help="print results only, no progress"
    )
    return parser


def add_debug(parser: argparse.ArgumentParser) -> None:
    """Declare the option that shows the traceback of errors.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb, or of the whole command line.
    """
    parser.add_argument(
        "--debug",
        action="store_true",
        default=argparse.SUPPRESS,
        help="show the traceback of an error",
    )


def add_json(parser: argparse.ArgumentParser) -> None:
    """Declare the option for JSON output.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument("--json", action="store_true", help="print JSON, with all digits")


def add_output(parser: argparse.ArgumentParser, metavar: str, what: str = "file to write") -> None:
    """Declare the option for the output, and the option to replace it.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    metavar : str
        Name of the output in the help text.
    what : str
        What the option names.
    """
    parser.add_argument(
        "-o", "--output", required=True, metavar=metavar, type=path_argument, help=what
    )
    add_force(parser)


def add_force(parser: argparse.ArgumentParser) -> None:
    """Declare the option to replace existing outputs.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument("-f", "--force", action="store_true", help="replace an existing output")
