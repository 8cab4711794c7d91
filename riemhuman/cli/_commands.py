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
    """The answer of a command: a record for ``--json``, else lines of text."""

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


def option(flags: str, text: str, **settings: Any) -> Argument:
    """Return the declaration of an argument with its help, to which a default is added."""
    default = settings.get("default")
    if isinstance(default, (int, float, str)) and not {"action", "type"} & {*settings}:
        shown = f"{default:g}" if isinstance(default, (int, float)) else default
        text = f"{text} (default: {shown})"
        settings.setdefault("type", type(default))
    return lambda parser: parser.add_argument(*flags.split(), help=text, **settings)


def flag(flags: str, text: str) -> Argument:
    """Return the declaration of an option without a value."""
    return option(flags, text, action="store_true")


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


def path_option(flags: str, metavar: str, text: str, **settings: Any) -> Argument:
    """Return the declaration of an argument that names a file or a folder."""
    return option(flags, text, type=path, metavar=metavar, **settings)


def mesh(dest: str, metavar: str, text: str = "mesh file") -> Argument:
    """Return the declaration of one mesh."""
    return path_option(dest, metavar, text)


def template(default: str, use: str = "whose triangle areas weight the metric") -> Argument:
    """Return the declarations of the template and of the unit of meshes."""
    text = f"template mesh, {use} (default: {default})"
    return several(path_option("--template", "MESH", text), ANY_SCALE, UNIT)


def output(metavar: str, text: str = "file to write", *, required: bool = True) -> Argument:
    """Return the declarations of the output and of the permission to replace it."""
    return several(path_option("-o --output", metavar, text, required=required), FORCE)


FILES = path_option("meshes", "FILES", "mesh files, or folders", nargs="+")
FOLDER = path_option("folder", "FOLDER", "folder of meshes")
FORCE = flag("-f --force", "replace an existing output")
JSON = flag("--json", "print JSON, with all digits")
ALIGN = flag("--align", "first remove rigid motions, by Procrustes alignment with the template")
ANY_SCALE = flag(
    "--any-scale", "accept meshes of any size; by default, meshes in another unit are refused"
)
UNIT = several(
    option(
        "--unit",
        "unit of the files, to convert them to metres (default: no conversion)",
        choices=UNITS,
    ),
    option("--up", "axis that points up in the files (default: y)", choices=AXES),
)
PICTURE = path_option(
    "--picture", "FILE", "picture to write: .png, or .html for an interactive page"
)
# The output stays text: a / at its end means a folder.
FOLDER_OR_FILE = several(
    option("-o --output", "folder or file to write", required=True, metavar="PATH"), FORCE
)
MODEL = path_option("--model", "FILE", "body model (default: the open one)")
_DEBUG = option(
    "--debug", "show the traceback of an error", action="store_true", default=argparse.SUPPRESS
)
_QUIET = flag("-q --quiet", "print results only, no progress")
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
