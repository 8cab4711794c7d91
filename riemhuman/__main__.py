# PYTHON_ARGCOMPLETE_OK
"""The command line as a program: ``riemhuman``, and ``python -m riemhuman``."""

import sys


def main() -> int:
    """Run the command line."""
    from riemhuman.cli import main as run

    return run()


if __name__ == "__main__":
    sys.exit(main())
