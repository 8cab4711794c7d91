# PYTHON_ARGCOMPLETE_OK
"""The command line as a program: ``riemhuman``, and ``python -m riemhuman``.

Signals that stop it, such as Ctrl-C, end it with 128 and their number as the exit code, also while
it imports and at its end.
"""

import os
import signal
import sys
from types import FrameType

_STOPPING = [signal.SIGINT, signal.SIGTERM]
if sys.platform != "win32":
    _STOPPING.append(signal.SIGHUP)  # its terminal was closed


def _leave(number: int, frame: FrameType | None) -> None:
    """End the process at once, before it has begun or after everything is done."""
    os._exit(128 + number)


def _open_closed_streams() -> None:
    """Open the standard streams that the caller closed, as in ``riemhuman ... >&-``, on nothing.

    Each takes the lowest free descriptor, its own, so that no file of results gets that. What is
    written to standard output fails, as it would have without this.
    """
    if sys.stdin is None:
        sys.stdin = open(os.devnull, encoding="utf-8")  # noqa: SIM115
    if sys.stdout is None:
        read_only = os.open(os.devnull, os.O_RDONLY)
        sys.stdout = open(read_only, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def main() -> int:
    """Run the command line."""
    _open_closed_streams()
    # Shells, like nohup, start background processes with some of them ignored.
    heard = [number for number in _STOPPING if signal.getsignal(number) is not signal.SIG_IGN]
    for number in heard:
        signal.signal(number, _leave)
    from riemhuman.cli import interrupt, last_interruption
    from riemhuman.cli import main as run

    try:
        for number in heard:
            signal.signal(number, interrupt)
        return run()
    except KeyboardInterrupt:  # before the work or after it: `run` handles those within
        return 128 + last_interruption()
    finally:
        for number in heard:
            signal.signal(number, _leave)


if __name__ == "__main__":
    sys.exit(main())
