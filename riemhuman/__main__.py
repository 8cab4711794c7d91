"""The command line as a module: python -m riemhuman."""

import sys

from riemhuman.cli import main

if __name__ == "__main__":
    sys.exit(main())
