"""Checks of class labels, names and other texts."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Hashable, Iterable, Mapping, Set
from contextlib import suppress
from pathlib import PurePath

import numpy as np

from riemhuman.arrays import Integers, Labels
from riemhuman.checks.arguments import items_of, refuse_type
from riemhuman.checks.arrays import integer_array
from riemhuman.errors import ArgumentError, ArgumentTypeError, shown

# Texts that stand for no value in tables, as pandas reads them; "Na" and "none" may be names.
_MISSING_TEXTS = frozenset(
    ("NA", "N/A", "n/a", "#N/A", "#NA", "<NA>", "NaN", "nan", "-nan", "NaT", "None", "NULL", "null")
)
# Characters that nobody sees: marks of byte order, of direction and of width zero. Joiners, which
# some scripts need, are none of them.
_INVISIBLE = re.compile("[\u00ad\u200b\u200e\u200f\u202a-\u202e\u2060\u2066-\u2069\ufeff]")
# Control characters but tabs and line breaks, and halves of characters: pages cannot hold them.
_UNWRITABLE = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ud800-\udfff\ufffe\uffff]")


def label_list(labels: Labels, name: str, count: int) -> list[Hashable]:
    """Return `count` class labels as a list of Python objects; none of them may be missing.

    A label is missing if it is None, NaN, NaT, pandas' NA, one of these as a text (NA, n/a, nan,
    null, …), a masked entry, empty or blank text, or a tuple with such a part. Texts are returned
    in one Unicode form. Tables of labels have the same rule, see `rh.datasets.read_labels`.
    """
    if isinstance(labels, (Mapping, Set)) or getattr(labels, "ndim", 1) != 1:
        shape = getattr(labels, "shape", None)
        raise ArgumentTypeError(
            f"{name} must be a sequence of hashable class labels; found {type(labels).__name__}"
            + (f" of shape {tuple(shape)}" if isinstance(shape, tuple) else "")
        )
    try:
        # Elements of other packages' arrays are arrays, each of which would be its own class.
        listed = labels.tolist() if hasattr(labels, "tolist") else labels
        values = [_plain_label(value) for value in list(listed)]  # type: ignore[arg-type]  # TypeError
    except (TypeError, ValueError, RuntimeError) as error:
        raise ArgumentTypeError(
            f"{name} must be a sequence of class labels ({error}); found {type(labels).__name__}"
        ) from error
    if len(values) != count:
        raise ArgumentError(
            f"{name} must hold a label for each of {count} points; found {len(values)}"
        )
    missing = [index for index, value in enumerate(values) if is_missing_label(value)]
    if missing:
        raise ArgumentError(
            f"{name}[{missing[0]}] is missing, {shown(values[missing[0]])}, the first of "
            f"{len(missing)} missing labels; leave out the items without labels"
        )
    try:
        hash(tuple(values))
    except TypeError as error:
        raise ArgumentTypeError(
            f"{name} must be a sequence of hashable class labels ({error})"
        ) from error
    return values


def is_missing_label(value: object) -> bool:
    """Return whether a label is missing, see `label_list`."""
    if value is None or value is np.ma.masked:
        return True
    if isinstance(value, str):
        return not value.strip() or value.strip() in _MISSING_TEXTS
    if isinstance(value, bytes):
        return not value.strip()
    if isinstance(value, tuple):
        return any(is_missing_label(part) for part in value)
    if getattr(value, "shape", ()) != ():
        return False
    try:
        # NaN and NaT differ from themselves.
        return bool(value != value)
    except (TypeError, ArithmeticError):
        # Comparing pandas' NA with itself gives NA, neither true nor false; a signalling NaN of
        # decimal numbers cannot be compared.
        return True


def _plain_label(value: Hashable) -> Hashable:
    """Return a label; of an array of no dimension, of NumPy or not, its Python number or text."""
    if isinstance(value, str):
        return plain_text(value)
    item = getattr(value, "item", None)
    if item is None or getattr(value, "shape", None) != () or is_missing_label(value):
        return value
    number: Hashable = item()
    return plain_text(number) if isinstance(number, str) else number


def plain_text(text: str) -> str:
    """Return a name in one Unicode form (NFC), without what nobody sees.

    macOS writes é as two characters, and spreadsheets copy spaces and marks of other kinds.
    """
    if text.isascii():
        return text.strip()
    visible = _INVISIBLE.sub("", unicodedata.normalize("NFC", text))
    return "".join(" " if unicodedata.category(c) == "Zs" else c for c in visible).strip()


def class_numbers(labels: Labels, name: str, count: int) -> tuple[Integers, list[Hashable]]:
    """Return `count` labels as numbers, and the classes, ascending where labels can be compared.

    Missing labels are refused, see `label_list`.
    """
    values = label_list(labels, name, count)
    classes = list(dict.fromkeys(values))
    with suppress(TypeError):
        classes = sorted(classes)  # type: ignore[type-var]  # TypeError where there is no order
    numbers = {value: number for number, value in enumerate(classes)}
    return np.array([numbers[value] for value in values], dtype=np.int64), classes


def class_indices(labels: Labels, name: str, count: int) -> Integers:
    """Return `count` labels that are whole numbers, as int64; missing ones are refused."""
    return integer_array(label_list(labels, name, count), name, (count,))


def texts_of(
    values: Iterable[str], name: str, expected: str = "a list of texts"
) -> tuple[str, ...]:
    """Return the texts of an iterable, as Python texts."""
    items = items_of(values, name, expected)
    for item in items:
        if not isinstance(item, str):
            raise ArgumentTypeError(f"{name} must be {expected}; found {shown(item)} among them")
    return tuple(map(str, items))


def text(value: object, name: str) -> str:
    """Return a text that pages and pictures can show."""
    if not isinstance(value, str):
        refuse_type(value, name, "a text")
    return _writable(value, name)


def names_of(values: object, name: str, count: int, items: str) -> tuple[str, ...]:
    """Return `count` names of items as texts; numbers and paths are names as well.

    `items` says what they are the names of, such as "surfaces".
    """
    expected = f"a sequence of texts, one for each of the {count} {items}"
    if isinstance(values, Set) or not isinstance(values, Iterable):
        refuse_type(values, name, expected)
    names = [
        _writable(text, name) for text in texts_or_numbers(items_of(values, name, expected), name)
    ]
    if len(names) != count:
        raise ArgumentError(f"{name} must name each of the {count} {items}; found {len(names)}")
    return tuple(names)


def _writable(value: str, name: str) -> str:
    if _UNWRITABLE.search(value):
        raise ArgumentError(
            f"{name} must be a text without control characters; found {shown(value)}"
        )
    return str(value)


def text_or_number(value: object, name: str) -> str:
    """Return a name, a text of any characters, a finite number or a path, as a text."""
    if isinstance(value, (str, PurePath)):
        return str(value)
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool):
        return str(int(value))
    # Times or ages.
    if isinstance(value, (float, np.floating)) and np.isfinite(value):
        return str(value)
    raise ArgumentTypeError(f"{name} must be a text; found {shown(value)}")


def texts_or_numbers(values: Iterable[object], name: str) -> tuple[str, ...]:
    """Return names, texts of any characters, numbers or paths, as Python texts."""
    return tuple(text_or_number(item, name) for item in items_of(values, name, "a list of names"))
