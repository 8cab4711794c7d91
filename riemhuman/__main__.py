"""The command line as a module; its main job is `riemhuman.cli.tables`."""

import sys

from riemhuman.cli import main

if __name__ == "__main__":
    sys.exit(main())
