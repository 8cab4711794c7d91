"""Optional dependencies: imported when used, and named with the line that installs them."""

from __future__ import annotations

import importlib
from types import ModuleType

from riemhuman.errors import MissingDependencyError


def import_optional(module: str, extra: str) -> ModuleType:
    """Import `module`, or name the extra that brings it.

    Parameters
    ----------
    module : str
        Name of the module.
    extra : str
        Extra of riemhuman that installs it.

    Returns
    -------
    module

    Raises
    ------
    MissingDependencyError
        If the module cannot be imported.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(
            f"{module} is needed for this and is not installed: pip install 'riemhuman[{extra}]'"
        ) from error
