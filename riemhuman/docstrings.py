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
        for base in owner.__mro__[1:]:
            inherited = getattr(vars(base).get(name), "__doc__", None)
            if inherited:
                method.__doc__ = _completed(method.__doc__, inherited)
                break


def inherit_parameters(owner: type) -> None:
    """Complete the docstring of a class that is made as the one it extends, and of its methods.

    Parameters
    ----------
    owner : type
        The class; its docstrings are changed.
    """
    inherit_sections(owner)
    owner.__doc__ = _completed(owner.__doc__ or "", owner.__mro__[1].__doc__ or "")


def _completed(text: str, inherited: str) -> str:
    head, own = _sections(text)
    found = {k: v for k, v in _sections(inherited)[1].items() if k in _INHERITED}
    parts = [f"{k}\n{'-' * len(k)}\n{v}" for k, v in (found | own).items()]
    return "\n\n".join([head, *parts])


def _sections(text: str) -> tuple[str, dict[str, str]]:
    """Return what stands before the first section, and the sections by their names."""
    head, *rest = _HEADER.split(inspect.cleandoc(text))
    return head, dict(zip(rest[::2], rest[1::2], strict=True))
