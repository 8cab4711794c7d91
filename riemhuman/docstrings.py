"""Docstrings that are written once: an override says what is its own, and inherits the rest."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence
from typing import Any

_HEADER = re.compile(r"\n\n(\w[\w ]*)\n-{3,}\n")
_ENTRY = re.compile(r"^(?=\S)", re.MULTILINE)
_PREFIXES = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}


class InheritsDocstrings:
    """A base of classes that inherit what docstrings of theirs and of their methods leave out."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        inherit_sections(cls)


def inherit_sections(owner: type) -> None:
    """Complete the docstrings of a class and its methods by those of what they extend.

    Parameters are inherited one by one, in the order of the signature, and what a method returns if
    it does not say so itself. What is raised is not inherited.

    Parameters
    ----------
    owner : type
        The class; its docstrings are changed.
    """
    for name, method in vars(owner).items():
        if inspect.isfunction(method) and method.__doc__:
            inherited = _inherited_docs(owner, name)[:1]
            method.__doc__ = _completed(method.__doc__, inherited, _names(method))
    names = _names_of_class(owner)
    if names and owner.__doc__:
        owner.__doc__ = _completed(owner.__doc__, _inherited_docs(owner), names, returns=False)


def _inherited_docs(owner: type, name: str | None = None) -> list[str]:
    bases = owner.__mro__[1:-1]
    members = bases if name is None else [vars(base).get(name) for base in bases]
    return [doc for member in members if (doc := getattr(member, "__doc__", None))]


def _names(function: Any) -> list[str]:
    """Return the names of parameters, as they are documented, without the first."""
    parameters = inspect.signature(function).parameters.items()
    return [_PREFIXES.get(parameter.kind, "") + name for name, parameter in parameters][1:]


def _names_of_class(owner: type) -> list[str]:
    """Return the names of the parameters of a class, or of the fields of a data class."""
    fields = list(getattr(owner, "__dataclass_fields__", ()))
    if fields:
        # Those of its own become fields later, by its decorator.
        return [*fields, *(name for name in inspect.get_annotations(owner) if name not in fields)]
    made = getattr(owner, "__init__", None)
    return _names(made) if inspect.isfunction(made) else []


def _completed(
    text: str, inherited: Sequence[str], names: Sequence[str], *, returns: bool = True
) -> str:
    head, own = _sections(text)
    entries = _entries(own.get("Parameters", ""))
    found: dict[str, str] = {}
    for doc in inherited:
        sections = _sections(doc)[1]
        for group, description in _entries(sections.get("Parameters", "")).items():
            known = {name for one in entries for name in one}
            missing = tuple(name for name in group if name in names and name not in known)
            if missing:
                entries[missing] = description
        if returns and "Returns" in sections:
            found["Returns"] = sections["Returns"]
    ordered = sorted(entries, key=lambda group: _place(group, names))
    if ordered:
        described = "".join(", ".join(group) + entries[group] for group in ordered)
        own["Parameters"] = described.rstrip()
        found = {"Parameters": "", **found}
    return "\n\n".join([head, *(f"{k}\n{'-' * len(k)}\n{v}" for k, v in (found | own).items())])


def _place(group: Sequence[str], names: Sequence[str]) -> int:
    return min((names.index(name) for name in group if name in names), default=len(names))


def _entries(section: str) -> dict[tuple[str, ...], str]:
    """Return the descriptions of parameters, from behind their names."""
    entries = {}
    for entry in filter(None, _ENTRY.split(section)):
        header = entry.splitlines()[0].split(" : ")[0]
        entries[tuple(name.strip() for name in header.split(","))] = entry.rstrip()[len(header) :]
    return {group: f"{description}\n" for group, description in entries.items()}


def _sections(text: str) -> tuple[str, dict[str, str]]:
    """Return what stands before the first section, and the sections by their names."""
    head, *rest = _HEADER.split(inspect.cleandoc(text))
    return head, dict(zip(rest[::2], rest[1::2], strict=True))
