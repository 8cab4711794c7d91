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

# Bytes of addresses, of which imports take 240 million with one thread, and 320 with two.
_LEAST_MEMORY = 300_000_000


def _leave(number: int, frame: FrameType | None) -> None:
    """End the process at once, before it has begun or after everything is done."""
    os._exit(128 + number)


def _open_closed_streams() -> None:
    """Open the standard streams that the caller closed, as in ``riemhuman ... >&-``, on nothing.

    Each takes the lowest free descriptor, its own, so that no file of results gets that.
    """
    if sys.stdin is None:
        sys.stdin = open(os.devnull, encoding="utf-8")  # noqa: SIM115
    if sys.stdout is None:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def _too_little_memory() -> bool:
    """Say whether the process may use too little memory to import what it needs.

    There, imports fail with tracebacks, or never end: BLAS asks for its buffers for ever.
    """
    from riemhuman.memory import address_limit

    limit = address_limit()
    if limit >= _LEAST_MEMORY:
        return False
    sys.stderr.write(
        f"riemhuman: not enough memory: the limit of this process is {limit / 1e6:.0f} MB, and "
        f"riemhuman needs {_LEAST_MEMORY / 1e6:.0f} MB to start; raise it (ulimit -v)\n"
    )
    return True


def main() -> int:
    """Run the command line."""
    _open_closed_streams()
    # Shells, like nohup, start background processes with some of them ignored.
    heard = [number for number in _STOPPING if signal.getsignal(number) is not signal.SIG_IGN]
    for number in heard:
        signal.signal(number, _leave)
    if _too_little_memory():
        return 2
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
