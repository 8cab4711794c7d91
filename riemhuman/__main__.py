# PYTHON_ARGCOMPLETE_OK
"""The command line as a program: ``riemhuman``, and ``python -m riemhuman``.

Interruptions from the keyboard end it with code 130, also while it imports and at its end.
"""

import os
import signal
import sys
from types import FrameType

_INTERRUPTED = 130


def _leave(number: int, frame: FrameType | None) -> None:
    """End the process at once, before it has begun or after everything is done."""
    os._exit(_INTERRUPTED)


def main() -> int:
    """Run the command line."""
    # Shells, like nohup, start background processes with interruptions ignored.
    listens = signal.getsignal(signal.SIGINT) is not signal.SIG_IGN
    if listens:
        signal.signal(signal.SIGINT, _leave)
    from riemhuman.cli import interrupt
    from riemhuman.cli import main as run

    try:
        if listens:
            signal.signal(signal.SIGINT, interrupt)
        return run()
    finally:
        sys.stderr.flush()
        if listens:
            signal.signal(signal.SIGINT, _leave)


if __name__ == "__main__":
    sys.exit(main())
