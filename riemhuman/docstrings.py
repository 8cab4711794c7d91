"""Docstrings that are written once: an override says what is its own, and inherits the rest."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence
from functools import cache
from typing import Any

_HEADER = re.compile(r"\n\n(\w[\w ]*)\n-{3,}\n")
_ENTRY = re.compile(r"^(?=\S)", re.MULTILINE)


class InheritsDocstrings:
    """A base of classes that inherit what docstrings of theirs and of their methods leave out."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        inherit_sections(cls)


def inherit_sections(owner: type) -> None:
    """Complete the docstrings of a class and its methods by those that they extend.

    Parameters, and attributes of data classes, are inherited one by one, in the order of the
    signature, and what a method returns if it does not say so itself. What is raised is not
    inherited.

    Parameters
    ----------
    owner : type
        The class; its docstrings are changed.
    """
    for name, method in vars(owner).items():
        if inspect.isfunction(method) and method.__doc__:
            inherited = [vars(base)[name] for base in owner.__mro__[1:-1] if name in vars(base)]
            if inherited:
                method.__doc__ = _completed(method, inherited, _names(method), ["Parameters"])
    fields = getattr(owner, "__dataclass_fields__", {}).values()
    kinds, names = ["Parameters"], []
    if fields:
        # Fields of its own become so later, by its decorator.
        last = [field.name for field in fields if field.kw_only]
        first = [field.name for field in fields if not field.kw_only]
        own = [name for name in inspect.get_annotations(owner) if name not in [*first, *last]]
        kinds, names = ["Parameters", "Attributes"], [*first, *own, *last]
    elif inspect.isfunction(made := getattr(owner, "__init__", None)):
        names = _names(made)
    if names and owner.__doc__:
        owner.__doc__ = _completed(owner, owner.__mro__[1:-1], names, kinds)


def _names(function: Any) -> list[str]:
    """Return the names of parameters, as they are documented, without the first."""
    code = inspect.unwrap(function).__code__
    names, several, named = inspect.getargs(code)
    stars = [f"*{several}"] if several else []
    double = [f"**{named}"] if named else []
    return [*names[1 : code.co_argcount], *stars, *names[code.co_argcount :], *double]


def _completed(
    written: Any, inherited: Sequence[Any], names: Sequence[str], kinds: Sequence[str]
) -> str:
    """Return the docstring of a class or method, with what it inherits of sections."""
    docs = [_sections(doc)[1] for one in inherited if (doc := getattr(one, "__doc__", None))]
    if not docs:
        return str(written.__doc__)
    head, own = _sections(written.__doc__)
    found = {kind: _described(own, docs, names, kind) for kind in kinds}
    if inspect.isfunction(written):
        found["Returns"] = own.get("Returns", docs[0].get("Returns", ""))
    sections = {kind: text for kind, text in (found | (own | found)).items() if text}
    return "\n\n".join([head, *(f"{k}\n{'-' * len(k)}\n{v}" for k, v in sections.items())])


def _described(
    own: dict[str, str], docs: Sequence[dict[str, str]], names: Sequence[str], kind: str
) -> str:
    """Return the descriptions of one kind, those of the nearest docstring first."""
    written = own.get(kind, "")
    entries = _entries(written)
    n_written = len(entries)
    for doc in docs:
        known = {name for group in entries for name in group}
        for group, description in _entries(doc.get(kind, "")).items():
            missing = tuple(name for name in group if name in names and name not in known)
            if missing:
                entries[missing] = description
    if len(entries) == n_written:
        return written
    ordered = sorted(entries, key=lambda group: _place(group, names))
    return "".join(", ".join(group) + entries[group] for group in ordered).rstrip()


def _place(group: Sequence[str], names: Sequence[str]) -> int:
    return min((names.index(name) for name in group if name in names), default=len(names))


def _entries(section: str) -> dict[tuple[str, ...], str]:
    """Return the descriptions of parameters, from behind their names."""
    entries = {}
    for entry in filter(None, _ENTRY.split(section)):
        header = entry.splitlines()[0].split(" : ")[0]
        entries[tuple(name.strip() for name in header.split(","))] = entry.rstrip()[len(header) :]
    return {group: f"{description}\n" for group, description in entries.items()}


@cache
def _sections(text: str) -> tuple[str, dict[str, str]]:
    """Return the text before the first section, and the sections by their names."""
    head, *rest = _HEADER.split(inspect.cleandoc(text))
    return head, dict(zip(rest[::2], rest[1::2], strict=True))
