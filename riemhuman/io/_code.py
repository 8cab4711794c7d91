"""The names that a function looks up, and the installed libraries that values belong to."""

from __future__ import annotations

import builtins
import dis
import importlib.util
import os
import platform
import sys
import sysconfig
import types
from collections.abc import Iterator
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any

from riemhuman.errors import ArgumentTypeError

_OWN = "riemhuman"
_GLOBAL = ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS")
# With these, a function reaches names that its code does not contain.
_HIDING = frozenset({"eval", "exec", "globals", "__import__"})


def reached_by(function: types.FunctionType) -> dict[str, Any]:
    """Return what a function and the functions nested in it look up outside themselves."""
    names = function.__globals__
    reached: dict[str, Any] = {}
    attributes = set()
    for name, kind in _looked_up(function.__code__, names.get("__package__")):
        if kind == "module":
            reached[name] = _module(name)
        elif kind == "attribute":
            attributes.add(name)
        elif name in names:
            reached[name] = names[name]
        elif name in _HIDING:
            raise ArgumentTypeError(
                f"{function.__qualname__} uses {name}, so a job cannot record what it reaches; "
                "give the job a key, and another key whenever its distances change"
            )
        elif not hasattr(builtins, name):
            reached[name] = "undefined"
    return _without_own_modules(reached, attributes)


def _looked_up(code: types.CodeType, package: str | None) -> Iterator[tuple[str, str]]:
    """Yield the names that code looks up, each with "module", "attribute" or "global"."""
    instructions = list(dis.get_instructions(code))
    for number, instruction in enumerate(instructions):
        name = instruction.argval
        if instruction.opname == "IMPORT_NAME":
            level = instructions[number - 2].argval
            yield (importlib.util.resolve_name("." * level + name, package), "module")
        elif instruction.opname in _GLOBAL:
            yield name, "global"
        elif isinstance(name, str):
            yield name, "attribute"
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _looked_up(constant, package)


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return "undefined"


def _without_own_modules(reached: dict[str, Any], attributes: set[str]) -> dict[str, Any]:
    """Replace modules that belong to no library by those of their attributes that may be used."""
    known: dict[str, Any] = {}
    waiting = dict(reached)
    seen = set()
    while waiting:
        name, value = waiting.popitem()
        if not isinstance(value, types.ModuleType) or library_of(value) is not None:
            known[name] = value
        elif value.__name__ not in seen:
            seen.add(value.__name__)
            for attribute in attributes & vars(value).keys():
                waiting[f"{value.__name__}.{attribute}"] = vars(value)[attribute]
    return known


def library_of(value: Any) -> dict[str, str] | None:
    """Return the installed library that a module, class or function belongs to."""
    if isinstance(value, types.ModuleType):
        name: str | None = value.__name__
    elif isinstance(value, types.FunctionType):
        # Not its `__module__`, which a decorator may copy from the decorated function.
        name = value.__globals__.get("__name__", "")
    else:
        name = getattr(value, "__module__", None) or _module_of_compiled(value)
    return _library(name) if isinstance(name, str) and name in sys.modules else None


def _module_of_compiled(value: Any) -> str | None:
    # Universal functions do not know their module; those of NumPy and SciPy are found by name.
    name = getattr(value, "__name__", "")
    for module in ("numpy", "scipy.special", "builtins"):
        if module in sys.modules and getattr(sys.modules[module], name, None) is value:
            return module
    return None


@cache
def _library(name: str) -> dict[str, str] | None:
    top = name.partition(".")[0]
    file = getattr(sys.modules[name], "__file__", None)
    if top in sys.stdlib_module_names or (file is None and top in sys.builtin_module_names):
        return {"library": f"Python {platform.python_version()}"}
    if file is None or not str(Path(str(file)).resolve()).startswith(_installed()):
        return None
    version = getattr(sys.modules.get(top), "__version__", None)
    if not isinstance(version, str):
        try:
            version = metadata.version(top)
        except metadata.PackageNotFoundError:
            version = "of unknown version"
    return {"library": f"{top} {version}"}


def is_own(library: dict[str, str] | None) -> bool:
    """Tell whether a library is riemhuman."""
    return library is not None and library["library"].startswith(f"{_OWN} ")


@cache
def _installed() -> tuple[str, ...]:
    """Return the folders that libraries are installed in."""
    kinds = ("purelib", "platlib", "stdlib", "platstdlib")
    folders = {*map(Path, map(sysconfig.get_path, kinds)), Path(__file__).parents[1]}
    return tuple(f"{folder.resolve()}{os.sep}" for folder in folders)
