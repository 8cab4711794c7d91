"""Docstrings that are written once: an override says what is its own, and inherits the rest."""

from __future__ import annotations

import inspect
import re

_HEADER = re.compile(r"\n\n(\w[\w ]*)\n-{3,}\n")
_INHERITED = ("Parameters", "Returns")


def inherit_sections(owner: type) -> None:
    """Complete the docstrings of methods by parameters and returns of those they override.

    Parameters
    ----------
    owner : type
        The class; docstrings of its own methods are changed.
    """
    for name, method in vars(owner).items():
        if not inspect.isfunction(method) or not method.__doc__:
            continue
        head, own = _sections(method.__doc__)
        for base in owner.__mro__[1:]:
            inherited = getattr(vars(base).get(name), "__doc__", None)
            if inherited:
                found = {k: v for k, v in _sections(inherited)[1].items() if k in _INHERITED}
                parts = [f"{k}\n{'-' * len(k)}\n{v}" for k, v in (found | own).items()]
                method.__doc__ = "\n\n".join([head, *parts])
                break


def _sections(text: str) -> tuple[str, dict[str, str]]:
    """Return what stands before the first section, and the sections by their names."""
    head, *rest = _HEADER.split(inspect.cleandoc(text))
    return head, dict(zip(rest[::2], rest[1::2], strict=True))
