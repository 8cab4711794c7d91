# PYTHON_ARGCOMPLETE_OK
"""The command line: verbs that apply the library to files.

Verbs import heavy packages when they run, so that help and usage errors appear at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext

from riemhuman import __version__
from riemhuman.cli import (
    alignment,
    bases,
    components,
    distances,
    fitting,
    information,
    means,
    measuring,
    models,
    motions,
    paths,
    registration,
    reports,
    tables,
    transfer,
    viewing,
)
from riemhuman.cli.inputs import path_argument
from riemhuman.cli.terminal import (
    discard_output,
    flush_output,
    note,
    short_warnings,
    tolerate_ascii,
)
from riemhuman.cli.verbs import Parser, add_debug
from riemhuman.errors import (
    FileError,
    MissingDependencyError,
    NotDefinedError,
    OutsideManifoldError,
    RiemhumanError,
)
from riemhuman.io.outputs import lock_output
from riemhuman.optional import import_optional

_FAILURE = 1
_BAD_DATA = 2
_INTERRUPTED = 130
_BROKEN_PIPE = 141

_VERB_MODULES = (
    tables,
    distances,
    paths,
    means,
    components,
    measuring,
    transfer,
    motions,
    alignment,
    fitting,
    viewing,
    bases,
    models,
    registration,
    information,
    reports,
)
_DEFAULT_VERB = "tables"

_DESCRIPTION = """\
Distances, geodesics and means of registered human bodies: meshes that share one triangulation.
The shape metric compares people, the pose metric compares poses.
"""
_EPILOG = """\
Without a verb, `riemhuman [--faust FOLDER] ...` runs `riemhuman tables`.
`riemhuman VERB --help` explains a verb and shows examples. After
`pip install 'riemhuman[completion]'`, the shell completes verbs and options with
`eval "$(register-python-argcomplete riemhuman)"`.

exit codes: 0 success; 1 failure; 2 wrong usage or unusable data; 130 interrupted;
141 closed output pipe
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line arguments, by default those of the process.

    Returns
    -------
    int
        Exit code: 0 for success; 1 for a failure; 2 for unusable data; 130 if interrupted; 141 if
        the output pipe was closed.

    Raises
    ------
    SystemExit
        After ``--help`` and ``--version``, with code 0, and after wrong usage, with code 2.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    tolerate_ascii()
    try:
        try:
            return _run(given)
        finally:
            flush_output()
    except BrokenPipeError:
        discard_output()
        return _BROKEN_PIPE
    except FileError as error:
        if "--debug" in given:
            raise
        note(str(error))
        return _FAILURE


def _run(given: Sequence[str]) -> int:
    parser = _parser()
    if "_ARGCOMPLETE" in os.environ:  # set by the shell while it completes a line
        import_optional("argcomplete", "completion").autocomplete(parser)
    options = parser.parse_args(_with_verb(given))
    debug = getattr(options, "debug", False)
    try:
        with short_warnings(), _output_claimed(options):
            options.run(options)
    except KeyboardInterrupt:
        note("interrupted")
        return _INTERRUPTED
    except BrokenPipeError:
        raise
    except RiemhumanError as error:
        if debug:
            raise
        note(str(error))
        failures = (MissingDependencyError, NotDefinedError, OutsideManifoldError)
        return _FAILURE if isinstance(error, failures) else _BAD_DATA
    except MemoryError:
        if debug:
            raise
        note("not enough memory; use fewer or coarser meshes")
        return _FAILURE
    except Exception as error:
        if debug:
            raise
        note(f"unexpected {type(error).__name__}: {error}; --debug shows the traceback")
        return _FAILURE
    return 0


def _output_claimed(options: argparse.Namespace) -> AbstractContextManager[None]:
    output = getattr(options, "output", None)
    return nullcontext() if output is None else lock_output(path_argument(os.fspath(output)))


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog="riemhuman",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("--version", action="version", version=f"riemhuman {__version__}")
    add_debug(parser)
    verbs = parser.add_subparsers(metavar="VERB", required=True, title="verbs")
    for module in _VERB_MODULES:
        module.add_verbs(verbs)
    return parser


def _with_verb(given: Sequence[str]) -> list[str]:
    """Return the arguments, with the default verb if there is none."""
    before = [argument for argument in given[:1] if argument == "--debug"]
    rest = list(given[len(before) :])
    if not rest or (rest[0].startswith("-") and rest[0] not in ("-h", "--help", "--version")):
        rest.insert(0, _DEFAULT_VERB)
    return before + rest
