# PYTHON_ARGCOMPLETE_OK
"""The command line as a program: ``riemhuman``, and ``python -m riemhuman``."""

import sys


def main() -> int:
    """Run the command line."""
    try:
        from riemhuman.cli import main as run

        return run()
    except KeyboardInterrupt:  # before the command began
        return 130


if __name__ == "__main__":
    sys.exit(main())
