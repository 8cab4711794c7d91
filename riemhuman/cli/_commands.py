"""Declaration of commands: their help, their arguments, and the function that each runs."""

from __future__ import annotations

import argparse
import difflib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, NoReturn, TypeAlias, TypedDict, Unpack

from riemhuman.errors import ArgumentError, FileError
from riemhuman.optional import import_matplotlib

if TYPE_CHECKING:
    from riemhuman.arrays import JSONRecord

# The wrong word within argparse's messages: the first unknown option, without the value after "=",
# or an unknown choice.
_WRONG_WORD = re.compile(r"(?:unrecognized arguments: .*(?=--)|invalid choice: ')([^\s'=]+)")

_HELP_WIDTH = 92  # letters
UNITS = ("metres", "centimetres", "millimetres", "inches")
AXES = ("x", "y", "z", "-x", "-y", "-z")
MESH_ENDINGS = (".ply", ".obj", ".off")
_MOTION_ENDINGS = (".bvh", ".amc", ".trc", ".c3d")  # of recordings that cannot be meshes
FIGURE_ENDINGS = (".png", ".svg", ".pdf")


Record: TypeAlias = "JSONRecord | Sequence[object]"
"""What is written as JSON: values by name, or a list, also of dataclasses."""


@dataclass(frozen=True)
class Answer:
    """The answer of a command: lines of text, or values by name, and a record for ``--json``."""

    text: str | Mapping[str, object] = ""
    record: Record | None = None
    trusted: bool = True
    written: bool = True  # whether to add the places of outputs


Run: TypeAlias = Callable[[argparse.Namespace], Answer]
Argument: TypeAlias = Callable[[argparse._ActionsContainer], object]


class PathSettings(TypedDict, total=False):
    """Settings of a path, as argparse takes them."""

    default: object
    dest: str
    nargs: str | int
    required: bool


class Settings(PathSettings, total=False):
    """Settings of an argument, as argparse takes them."""

    action: str
    choices: Sequence[str]
    const: str
    metavar: str | tuple[str, ...]
    type: Callable[[str], object]


# The texts, arguments and functions of commands; a name of two words is a command of a group.
COMMANDS: dict[str, tuple[JSONRecord, Sequence[Argument], Run]] = {}
GROUPS = {
    "motions": (
        "compare, align, average and search motions",
        """A motion is a folder of registered meshes, one per frame (frame_0001.ply,
...), a recording of a skeleton (walk.bvh, or an .npz file of AMASS), or an .npz
file with an array path, as `riemhuman transfer` writes it.""",
    )
}


# Verbs by what people want to do, in the order of the help. A new verb is a line here, and a
# function that `command` declares. A name of two words is a command of a group.
VERBS: Mapping[str, Mapping[str, str]] = {
    "look and convert": {
        "examples": "a folder of simulated people to practise on",
        "view": "bodies, a path or a recording as an interactive page, picture or film",
        "info": "what a file holds, its size and its defects",
        "convert": "bodies or a motion in another format or topology",
        "align": "registered meshes aligned with a template",
        "formats": "what can be done with which files",
    },
    "compare people and poses": {
        "dist": "the distance between two registered meshes",
        "retrieve": "the meshes in a folder that are nearest to one mesh",
        "matrix": "all distances within a folder of registered meshes",
        "plot": "a distance matrix as a map",
        "tables": "retrieval tables: who is it, how do they stand?",
        "report": "a page on a data set: measurements, differences, paths, retrieval",
    },
    "paths and means": {
        "geodesic": "the geodesic (minimum-energy path) between two registered meshes",
        "mean": "the Karcher mean of registered meshes",
        "components": "principal components of registered meshes, and new bodies",
        "transfer": "the motion of one body replayed on another",
        "disentangle": "one mesh's shape in another mesh's pose",
    },
    "scans": {
        "register": "registered bodies from raw scans",
        "match": "point-to-point correspondence between two scans",
    },
    "measurements": {
        "measure": "girths, lengths, heights and volumes of registered meshes",
        "compare": "what changed about a person, or where two people differ",
        "sheet": "a sheet for each person: measurements, percentiles, changes",
    },
    "motions": {
        "motions dist": "the distance between two motions, whatever their speeds",
        "motions align": "two motions aligned in time",
        "motions matrix": "all distances between several motions",
        "motions mean": "the mean of several performances",
        "motions find": "occurrences of a short motion in a long one",
        "motions table": "how well each measure tells the bundled motions apart",
    },
    "advanced": {
        "fit": "shape and pose of a body model for registered meshes",
        "basis": "a basis of deformations, for geodesic and mean",
        "scores": "how well a distance matrix finds people and poses",
        "make-map": "a map between another topology and the open model",
        "convert-model": "the pickle of a body model as plain arrays",
    },
}


def command(
    name: str, description: str, examples: str, *arguments: Argument
) -> Callable[[Run], Run]:
    """Return the declaration of a verb of the table."""
    (summary,) = [verbs[name] for verbs in VERBS.values() if name in verbs]
    paragraph = fill(" ".join(description.split()), _HELP_WIDTH)
    texts = {"help": summary, "description": paragraph, "epilog": f"examples:\n{examples}"}

    def declare(run: Run) -> Run:
        COMMANDS[name] = texts, arguments, run
        return run

    return declare


def option(flags: str, text: str, **settings: Unpack[Settings]) -> Argument:
    """Return the declaration of an argument with its help, to which a default is added."""
    default = settings.get("default")
    if isinstance(default, (int, float, str)) and not {"action", "type"} & {*settings}:
        shown = f"{default:g}" if isinstance(default, (int, float)) else default
        text = f"{text} (default: {shown})"
        settings.setdefault("type", type(default))
    return lambda parser: parser.add_argument(*flags.split(), help=text, **settings)


def flag(flags: str, text: str) -> Argument:
    return option(flags, text, action="store_true")


def choice(flags: str, text: str, *choices: str) -> Argument:
    """Return the declaration of an option that takes one of several words, by default the first."""
    return option(flags, text, choices=choices, default=choices[0])


def several(
    *arguments: Argument, exclusive: bool = False, title: str | None = None, text: str = ""
) -> Argument:
    """Return one declaration of several arguments, of which one may be given if exclusive."""

    def declare(parser: argparse._ActionsContainer) -> None:
        target: argparse._ActionsContainer = (
            parser.add_argument_group(title, text) if title else parser
        )
        if exclusive:
            target = target.add_mutually_exclusive_group()
        for argument in arguments:
            argument(target)

    return declare


def needs(names: str, *needed: str) -> Argument:
    """Return the declaration that options are given with one of those that they need."""

    def check(options: argparse.Namespace) -> None:
        if any(getattr(options, _attribute(need.split()[0])) for need in needed):
            return
        for name in names.split():
            if getattr(options, _attribute(name)):
                raise ArgumentError(
                    f"{name} needs {' or '.join(needed)}; add that, or leave it out"
                )

    return checked(check)


def checked(check: Callable[[argparse.Namespace], None]) -> Argument:
    """Return the declaration of a check that is made before a command runs."""
    return lambda parser: parser.set_defaults(checks=(*parser.get_default("checks"), check))


def _attribute(flags: str) -> str:
    """Return the attribute of an option, which argparse names after its last flag."""
    return flags.split()[-1].strip("-").replace("-", "_")


def path(text: str) -> Path:
    """Return the path that an argument names; ``~`` stands for the user's home."""
    from riemhuman.io.files import file_path

    if not text:  # of a variable of the shell that is not set; else the current folder
        raise FileError("a path is missing: found an empty text in its place")
    return file_path(text)


def mesh(text: str) -> Path:
    """Return the path of an argument that is one mesh, not a folder of meshes."""
    place = path(text)
    if place.is_dir():
        raise argparse.ArgumentTypeError(
            f"must be one mesh, but {place} is a folder; `riemhuman retrieve` and `riemhuman "
            "matrix` compare folders"
        )
    if place.suffix.lower() in _MOTION_ENDINGS:
        raise argparse.ArgumentTypeError(
            f"must be a mesh, but {place} is a recording; `riemhuman motions dist` compares "
            "motions, and `riemhuman view` shows one"
        )
    return place


def path_option(flags: str, metavar: str, text: str, **settings: Unpack[PathSettings]) -> Argument:
    return option(flags, text, metavar=metavar, type=path, **settings)


def mesh_option(
    flags: str, metavar: str, text: str = "mesh file", **settings: Unpack[PathSettings]
) -> Argument:
    return _existing(option(flags, text, metavar=metavar, type=mesh, **settings), flags)


def _existing(declared: Argument, flags: str) -> Argument:
    """Return the declaration of inputs, which must exist before anything else is checked."""
    attribute = _attribute(flags)

    def check(options: argparse.Namespace) -> None:
        value = getattr(options, attribute)
        for place in value if isinstance(value, list) else [value]:
            if place is not None and not place.exists():
                raise FileError(f"there is no file {place}")

    def declare(parser: argparse._ActionsContainer) -> None:
        declared(parser)
        parser.set_defaults(input_checks=(*parser.get_default("input_checks"), check))

    return declare


def output(
    metavar: str,
    *endings: str,
    text: str | None = None,
    names: str | None = None,
    always: str = "",
    flags: str = "-o --output",
    required: bool = True,
    takes_stream: bool = False,
    needs_matplotlib: bool = True,
) -> Argument:
    """Return the declaration of an output: a file or, with a pattern of names in it, a folder.

    A folder with such names is an earlier result if the file `always` is among them. With
    `takes_stream`, ``-`` stands for standard output. Pictures of which `needs_matplotlib` is
    false are drawn without it.
    """
    attribute = _attribute(flags)

    def check(options: argparse.Namespace) -> None:
        # Before the command runs; `options.ending` is empty for a folder.
        from riemhuman.io.outputs import FolderContent, check_output_file, check_output_folder

        text = getattr(options, attribute)
        if text is None or (text == "-" and takes_stream):
            return
        if text == "-":
            raise ArgumentError(
                f"{flags.split()[-1]} cannot be standard output (-); name a file or a folder"
            )
        place = path(text)
        may_be_folder = not endings or text.endswith("/") or place.is_dir() or not place.suffix
        if names is not None and may_be_folder:
            options.ending = ""
            options.content = FolderContent(names, always)
            check_output_folder(place, options.content, force=options.force)
        else:
            options.ending = place.suffix.lower()
            accepted = endings if names is None else (*endings, "/ (a folder)")
            check_output_file(place, accepted, force=options.force)
        is_figure = needs_matplotlib and options.ending in FIGURE_ENDINGS
        if is_figure or (not options.ending and options.has_figure):
            import_matplotlib()  # before the work, not after it
        setattr(options, attribute, place)
        options.written.append(place)

    if text is None and names is None:
        text = "file to write"
    elif text is None:
        text = "folder or file to write" if endings else "folder to write"
    declared = option(flags, text, metavar=metavar, required=required)

    def declare(parser: argparse._ActionsContainer) -> None:
        declared(parser)
        if attribute == "output":  # one --force is enough for a command of several outputs
            FORCE(parser)
        checked(check)(parser)

    return declare


def unless_given(attribute: str, value: str) -> Argument:
    """Return the declaration of the value of an option of the same command that is not given."""
    return lambda parser: parser.set_defaults(**{attribute: value})


def template(default: str, use: str = "whose triangle areas weight the metric") -> Argument:
    """Return the declarations of the template and of the unit of meshes."""
    text = f"template mesh, {use} (default: {default})"
    return several(path_option("--template", "MESH", text), ANY_SCALE, UNIT)


JOINTS = path_option(
    "--joints",
    "FILE",
    'JSON file with the joints or markers of a recording that are not recognised: {"left_knee": '
    '["LK1", "LK2"]}',
)
FPS = option("--fps", "frame rate of a recording that does not state it", metavar="N", type=float)
FILES = _existing(path_option("meshes", "FILES", "mesh files, or folders", nargs="+"), "meshes")
FOLDER = path_option("folder", "FOLDER", "folder of meshes")
FORCE = flag("-f --force", "replace an existing output")
ALIGN = flag("--align", "first remove rigid motions, by Procrustes alignment with the template")
ANY_SCALE = flag("--any-scale", "accept meshes of any size, also in another unit")
UNIT = several(
    option("--unit", "unit of the files, which are converted to metres", choices=UNITS),
    option("--up", "axis that points up in the files (default: y)", choices=AXES),
)
PICTURE = output(
    "FILE",
    ".png",
    ".html",
    text="picture to write: .png, or .html for an interactive page",
    flags="--picture",
    required=False,
    needs_matplotlib=False,
)
MODEL = path_option("--model", "FILE", "body model (default: the open one)")
OUTPUT_UNITS = choice(
    "--output-units",
    "units of what is printed and shown: centimetres, litres and kilograms, or inches and pounds; "
    "CSV and JSON keep metres and kilograms",
    *("cm", "in"),
)
_COMMON = (
    flag("--json", "print JSON, with all digits"),
    flag("-q --quiet", "print results only, no progress"),
)
_DEBUG = option(
    "--debug", "show the traceback of an error", action="store_true", default=argparse.SUPPRESS
)
# Options that commands read without declaring them.
_DEFAULTS = dict.fromkeys(("any_scale", "align", "force", "has_figure"), False)


def one_line(text: str) -> str:
    """Return a text in one line, with codes for what could make a terminal do something."""
    line = " ".join(text.split())
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in line)


class Parser(argparse.ArgumentParser):
    """A parser whose errors suggest the nearest name."""

    def parse_args(  # type: ignore[override]  # its overloads are for namespaces of other types
        self, args: Sequence[str] | None = None, namespace: argparse.Namespace | None = None
    ) -> argparse.Namespace:
        options, unknown = self.parse_known_args(args, namespace)
        if unknown:
            # The parser of the command knows its options.
            parser: argparse.ArgumentParser = getattr(options, "parser", self)
            parser.error(f"unrecognized arguments: {' '.join(unknown)}")
        return options

    def error(self, message: str) -> NoReturn:
        words = [*self._option_string_actions]
        words += [word for action in self._actions for word in action.choices or ()]
        wrong = _WRONG_WORD.search(message)
        suggestions = difflib.get_close_matches(wrong[1], words, 1) if wrong else []
        if suggestions:
            message = f"{message.partition(' (choose from')[0]}; did you mean {suggestions[0]}?"
        elif "argument COMMAND: invalid choice" in message:
            message = f"{message.partition(' (choose from')[0]}; `{self.prog} --help` lists all"
        super().error(one_line(message))


def _verbs_text() -> str:
    """Return the verbs by kind, with their summaries; a group is one line."""
    names = [name for verbs in VERBS.values() for name in verbs]
    width = max(len(name) for name in names if " " not in name)
    lines = []
    for kind, verbs in VERBS.items():
        shown = {name: text for name, text in verbs.items() if " " not in name}
        groups = {name.split()[0] for name in verbs if " " in name}
        shown |= {group: GROUPS[group][0] for group in groups}
        lines += [f"{kind}:", *(f"  {name:{width}}  {text}" for name, text in shown.items()), ""]
    return "\n".join(lines[:-1])


@cache
def make_parser(version: str, description: str, epilog: str) -> Parser:
    style: JSONRecord = {
        "formatter_class": argparse.RawDescriptionHelpFormatter,
        "allow_abbrev": False,
    }
    usage = "riemhuman [-h] [--version] [--debug] COMMAND ..."
    parser = Parser(prog="riemhuman", usage=usage, description=description, epilog=epilog, **style)
    parser.add_argument("--version", action="version", version=f"riemhuman {version}")
    _DEBUG(parser)
    commands = {
        "": parser.add_subparsers(
            prog="riemhuman",
            metavar="COMMAND",
            title="commands",
            description=_verbs_text(),
            help=argparse.SUPPRESS,
        )
    }
    for whole_name in (name for verbs in VERBS.values() for name in verbs):
        texts, arguments, run = COMMANDS[whole_name]
        group, _, name = whole_name.rpartition(" ")
        if group not in commands:
            _, text = GROUPS[group]
            inner = commands[""].add_parser(group, description=text, **style)
            commands[group] = inner.add_subparsers(
                metavar="COMMAND", title="commands", required=True
            )
        # Those without a group are listed by topic.
        listed = texts if group else {key: texts[key] for key in ("description", "epilog")}
        command_parser = commands[group].add_parser(name, **listed, **style)
        command_parser.set_defaults(
            **_DEFAULTS, template=None, run=run, parser=command_parser, input_checks=(), checks=(),
            summary=texts["help"],
        )  # fmt: skip
        for argument in (*arguments, *_COMMON, _DEBUG):
            argument(command_parser)
    return parser
