"""Declaration of commands: their help, their arguments, and the function that each runs."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn, TypeAlias

_CHOICE = re.compile(r"(?s)(.*invalid choice: '(?P<found>[^']*)') \(choose from (?P<known>.*)\)")

UNITS = ("metres", "centimetres", "millimetres", "inches")
AXES = ("x", "y", "z", "-x", "-y", "-z")


@dataclass(frozen=True)
class Answer:
    """What a command has found: a record for ``--json``, else lines of text."""

    text: str
    record: Any = None
    trusted: bool = True


Run: TypeAlias = Callable[[argparse.Namespace], Answer]
Argument: TypeAlias = Callable[[argparse.ArgumentParser], object]


@dataclass(frozen=True)
class Command:
    """The declaration of a command; a name of two words is a command of a group."""

    name: str
    summary: str
    description: str
    examples: str
    arguments: Sequence[Argument]
    run: Run


COMMANDS: list[Command] = []
GROUPS = {
    "motions": (
        "compare, align, average and search motions",
        """A motion is a folder of registered meshes, one per frame (frame_0001.ply,
...), or an .npz file with an array path, as `riemhuman transfer` writes it.""",
    )
}


def command(
    name: str, summary: str, description: str, examples: str, *arguments: Argument
) -> Callable[[Run], Run]:
    """Declare the command that a function runs."""

    def declare(run: Run) -> Run:
        COMMANDS.append(Command(name, summary, description, examples, arguments, run))
        return run

    return declare


def option(*flags: str, **settings: Any) -> Argument:
    """Return the declaration of an argument, as `argparse.ArgumentParser.add_argument` takes it."""
    return lambda parser: parser.add_argument(*flags, **settings)


def several(*arguments: Argument, exclusive: bool = False) -> Argument:
    """Return one declaration of several arguments, of which one may be given if exclusive."""

    def declare(parser: argparse.ArgumentParser) -> None:
        target: Any = parser.add_mutually_exclusive_group() if exclusive else parser
        for argument in arguments:
            argument(target)

    return declare


def path(text: str) -> Path:
    """Return the path that an argument names; ``~`` stands for the user's home."""
    from riemhuman.io.files import file_path

    return file_path(text)


def path_option(*flags: str, **settings: Any) -> Argument:
    """Return the declaration of an argument that names a file or a folder."""
    return option(*flags, type=path, **settings)


def mesh(dest: str, metavar: str, text: str = "mesh file") -> Argument:
    """Return the declaration of one mesh."""
    return path_option(dest, metavar=metavar, help=text)


def template(default: str, use: str = "whose triangle areas weight the metric") -> Argument:
    """Return the declarations of the template and of the unit of meshes."""
    text = f"template mesh, {use} (default: {default})"
    return several(path_option("--template", metavar="MESH", help=text), ANY_SCALE, UNIT)


def output(metavar: str, text: str = "file to write", *, required: bool = True) -> Argument:
    """Return the declarations of the output and of the permission to replace it."""
    return several(
        path_option("-o", "--output", required=required, metavar=metavar, help=text), FORCE
    )


FILES = path_option("meshes", metavar="FILES", nargs="+", help="mesh files, or folders")
FOLDER = path_option("folder", metavar="FOLDER", help="folder of meshes")
FORCE = option("-f", "--force", action="store_true", help="replace an existing output")
JSON = option("--json", action="store_true", help="print JSON, with all digits")
ALIGN = option(
    "--align",
    action="store_true",
    help="first remove rigid motions, by Procrustes alignment with the template",
)
ANY_SCALE = option(
    "--any-scale",
    action="store_true",
    help="accept meshes of any size; by default, meshes in another unit are refused",
)
UNIT = several(
    option(
        "--unit",
        choices=UNITS,
        help="unit of the files, to convert them to metres (default: no conversion)",
    ),
    option("--up", choices=AXES, help="axis that points up in the files (default: y)"),
)
PICTURE = path_option(
    "--picture",
    metavar="FILE",
    help="picture to write: .png, or .html for an interactive page",
)
# The output stays text: a / at its end means a folder.
FOLDER_OR_FILE = several(
    option("-o", "--output", required=True, metavar="PATH", help="folder or file to write"), FORCE
)
MODEL = path_option("--model", metavar="FILE", help="body model (default: the open one)")
_DEBUG = option(
    "--debug", action="store_true", default=argparse.SUPPRESS, help="show the traceback of an error"
)
_QUIET = option("-q", "--quiet", action="store_true", help="print results only, no progress")
# Options that commands read but need not declare.
_DEFAULTS = {"template": None, "any_scale": False, "align": False, "json": False, "force": False}


class Parser(argparse.ArgumentParser):
    """A parser whose errors suggest similar names."""

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        options, unknown = self.parse_known_args(args, namespace)
        if unknown:
            parser: argparse.ArgumentParser = getattr(options, "parser", self)
            known = [name for action in parser._actions for name in action.option_strings]
            named = [name.split("=")[0] for name in unknown if name.startswith("-")]
            near = [match for name in named for match in _nearest(name, known)]
            parser.error(f"unrecognized arguments: {' '.join(unknown)}{_suggestion(near)}")
        return options

    def error(self, message: str) -> NoReturn:
        choice = _CHOICE.fullmatch(message)
        if choice:
            near = _nearest(choice["found"], re.findall(r"[^\s,']+", choice["known"]))
            message = choice[1] + _suggestion(near) if near else message
        super().error(message)


def _nearest(name: str, known: Sequence[str]) -> list[str]:
    return difflib.get_close_matches(name, known, 1)


def _suggestion(names: Sequence[str]) -> str:
    return f"; did you mean {' and '.join(names)}?" if names else ""


def make_parser(version: str, description: str, epilog: str) -> Parser:
    """Return the parser of all declared commands."""
    style: dict[str, Any] = {
        "formatter_class": argparse.RawDescriptionHelpFormatter,
        "allow_abbrev": False,
    }
    parser = Parser(prog="riemhuman", description=description, epilog=epilog, **style)
    parser.add_argument("--version", action="version", version=f"riemhuman {version}")
    _DEBUG(parser)
    commands = {"": parser.add_subparsers(metavar="COMMAND", title="commands")}
    for declared in COMMANDS:
        group, _, name = declared.name.rpartition(" ")
        if group not in commands:
            summary, text = GROUPS[group]
            inner = commands[""].add_parser(group, help=summary, description=text, **style)
            commands[group] = inner.add_subparsers(
                metavar="COMMAND", title="commands", required=True
            )
        own = commands[group].add_parser(
            name,
            help=declared.summary,
            description=declared.description,
            epilog=f"examples:\n{declared.examples}",
            **style,
        )
        own.set_defaults(**_DEFAULTS, run=declared.run, parser=own)
        for argument in (*declared.arguments, _QUIET, _DEBUG):
            argument(own)
    return parser
