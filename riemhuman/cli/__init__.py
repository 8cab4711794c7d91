# PYTHON_ARGCOMPLETE_OK
"""The command line: commands that apply the library to files.

Commands use the library as its users do, ``import riemhuman as rh``, which loads subpackages when
they are used: help and usage errors appear at once.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from functools import partial

from riemhuman import __version__

# isort: off
# Each declares its commands.
from riemhuman.cli import _distance_commands, _body_commands, _registration_commands  # noqa: F401
from riemhuman.cli import _measurement_commands, _motion_commands, _file_commands  # noqa: F401
from riemhuman.cli import _conversion_commands, _format_commands  # noqa: F401

# isort: on
from riemhuman.cli import _terminal as terminal
from riemhuman.cli._commands import Answer, make_parser
from riemhuman.errors import RiemhumanError
from riemhuman.kernels.compilation import compilation_time
from riemhuman.optional import import_optional

__all__ = ["main"]

_DONE = 0
_NOT_TRUSTED = 1
_NOT_DONE = 2  # also argparse's code for wrong usage
_INTERRUPTED = 130
_BROKEN_PIPE = 141

_DESCRIPTION = """\
Distances, geodesics and means of registered human bodies: meshes that share one triangulation.
The shape metric compares people, the pose metric compares poses.

examples:
  riemhuman examples people/                  # a folder of people to try the commands on
  riemhuman tables                            # who is it, how do they stand? 100 open bodies
  riemhuman register scan.ply -o body.ply     # a registered body from a raw scan
"""
_EPILOG = """\
`riemhuman COMMAND --help` explains a command and shows examples. After
`pip install '.[completion]'` in its folder, the shell completes commands and options if you run
`eval "$(register-python-argcomplete riemhuman)"`.

exit codes: 0 done; 1 done, but some results are not trusted: a scan without a trusted body, or a
search that has not converged; 2 failed: wrong usage, unusable data or an error; 130
interrupted; 141 closed output pipe
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    terminal.tolerate_ascii()
    try:
        try:
            return _run(words)
        finally:
            sys.stdout.flush()
    except KeyboardInterrupt:
        terminal.note("interrupted")
        return _INTERRUPTED
    except BrokenPipeError:
        terminal.discard(sys.stdout)
        return _BROKEN_PIPE
    except OSError as error:  # of standard output: `_run` reports all others
        terminal.discard(sys.stdout)
        terminal.note(f"standard output cannot be written: {error.strerror or error}")
        return _NOT_DONE


def _run(words: Sequence[str]) -> int:
    parser = make_parser(__version__, _DESCRIPTION, _EPILOG)
    if "_ARGCOMPLETE" in os.environ:  # set by the shell while it completes a line
        import_optional("argcomplete", "completion").autocomplete(parser)
    try:
        options = parser.parse_args(words)
    except (RiemhumanError, OSError) as error:  # an argument that cannot be a path
        if not isinstance(error, RiemhumanError) and error.filename is None:
            raise  # of standard output
        terminal.note(str(error))
        return _NOT_DONE
    if not hasattr(options, "run"):
        parser.print_help()
        return _DONE
    options.bars = not options.quiet and sys.stderr.isatty()
    options.task = partial(terminal.task, options)
    options.written = []  # places of outputs, which the declarations of outputs add
    compilation_time.tell(terminal.say_compilation if options.bars else None)
    try:
        with terminal.short_warnings() as unconverged:
            for check in (*options.input_checks, *options.checks):
                check(options)
            answer: Answer = options.run(options)
    except Exception as error:
        if getattr(options, "debug", False):
            raise
        if isinstance(error, RiemhumanError):
            terminal.note(str(error))
        elif isinstance(error, MemoryError):
            details = f": {error}" if str(error) else ""
            terminal.note(f"not enough memory; use fewer or coarser meshes{details}")
        elif isinstance(error, OSError) and error.filename is not None:
            terminal.note(str(error))  # such as a name that is too long
        else:
            terminal.note(
                f"unexpected {type(error).__name__}: {error}; --debug shows the traceback"
            )
        return _NOT_DONE
    sys.stdout.write(f"{_text(answer, options)}\n")
    return _NOT_TRUSTED if unconverged or not answer.trusted else _DONE


def _text(answer: Answer, options: argparse.Namespace) -> str:
    """Return an answer as JSON or text, with the places that were written."""
    places = options.written if answer.written else []
    if options.json:
        record = answer.record
        if options.written and isinstance(record, dict):
            record = record | {"output": options.output if places else None}
        return terminal.as_json(record)
    if isinstance(answer.text, str):
        if not answer.text:
            return "\n".join(map(str, places))
        return "\n".join([answer.text, *(f"written to {place}" for place in places)])
    return terminal.lines({**answer.text, "written to": " and ".join(map(str, places)) or None})
