"""Import of optional dependencies on use, with errors that name the command to install them."""

from __future__ import annotations

import importlib
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
    """Import matplotlib or a module of it."""
    return import_optional(f"matplotlib.{module}".rstrip("."), extra)
