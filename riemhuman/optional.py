"""Import of optional dependencies on use, with errors that name the command to install them."""

from __future__ import annotations

import importlib
import os
import sys
from types import ModuleType

from riemhuman.errors import MissingDependencyError


def import_optional(module: str, extra: str) -> ModuleType:
    """Import an optional module, or raise an error that names the extra to install."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(
            f"{module} is needed for this and is not installed: pip install '.[{extra}]' in the "
            "checkout of riemhuman"
        ) from error


def import_matplotlib(module: str = "", extra: str = "plot") -> ModuleType:
    """Import matplotlib or a module of it, whatever backend the environment asks for.

    Jupyter sets MPLBACKEND for the processes that it starts. A value that this matplotlib does not
    know makes its import fail, though pictures in files need no backend.
    """
    name = f"matplotlib.{module}".rstrip(".")
    try:
        return import_optional(name, extra)
    except ValueError:
        asked = os.environ.pop("MPLBACKEND", None)
        if asked is None:
            raise
        # The failed import has left parts of the package behind.
        for part in [part for part in sys.modules if part.partition(".")[0] == "matplotlib"]:
            del sys.modules[part]
        try:
            return import_optional(name, extra)
        finally:
            os.environ["MPLBACKEND"] = asked
