"""Checks of the terms that a metric is made of, once, when it is made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.kernels.surface import Derivatives, follow_up
from riemhuman.terms.flat import FlatTerm
from riemhuman.terms.term import Term

# Partial derivatives of three triangles on each of two surfaces, nearly those of the template.
_TRIANGLES = np.random.default_rng(0).uniform(-0.3, 0.3, (2, 2, 3, 3))
_TRIANGLES += np.eye(2, 3)[:, None, None]


def checked_terms(terms: Any, term_class: type) -> tuple[Any, ...]:
    """Return the terms of a metric after checking that loops over triangles can run them.

    A loop trusts the shapes of the fields; wrong ones would have it write beyond its arrays.
    """
    if not isinstance(terms, Sequence) or isinstance(terms, str):
        raise ArgumentTypeError(f"terms must be a sequence of terms; found {terms!r}")
    if not terms:
        raise ArgumentError("terms must hold at least one term; found none")
    for term in terms:
        if not isinstance(term, term_class):
            raise ArgumentTypeError(
                f"terms must hold instances of {term_class.__name__}; found {term!r}"
            )
        if isinstance(term, Term):
            with np.errstate(all="ignore"):
                _check_fields(term)
    return tuple(terms)


def _check_fields(term: Term) -> None:
    name, shape = type(term).__name__, _TRIANGLES.shape[1:3]
    together = _fields(term, follow_up(*_TRIANGLES))
    for field in together:
        dimensions = (3,) if isinstance(term, FlatTerm) else (2, 3)
        if field.shape[:2] != shape or field.ndim not in dimensions:
            expected = " or ".join(["(..., F)", "(..., F, n)"][-len(dimensions) :])
            raise ArgumentError(
                f"the fields of {name} must have shape {expected}; for derivatives of shape "
                f"(2, 3, 3), of three triangles on each of two surfaces, found {field.shape}"
            )
        _refuse_infinite(field, f"the fields of {name}")
    alone = _fields(term, follow_up(*_TRIANGLES[:, 1:, 2:]))
    for whole, part in zip(together, alone, strict=True):
        if not np.allclose(whole[1:, 2:], part, rtol=1e-8, atol=1e-8):
            raise ArgumentError(
                f"the fields of {name} must be computed triangle by triangle; found values that "
                "change with the other triangles"
            )
    for other in (together, tuple(field[::-1] for field in together)):
        found = np.asarray(term.squared_dist(together, other))
        if found.shape != shape:
            raise ArgumentError(
                f"squared_dist of {name} must return shape (..., F), one number a triangle; for "
                f"fields of three triangles on each of two surfaces, found {found.shape}"
            )
        _refuse_infinite(found, f"squared_dist of {name}")


def _refuse_infinite(found: ndarray, name: str) -> None:
    if not np.isfinite(found).all():
        first = found[~np.isfinite(found)][0]
        raise ArgumentError(f"{name} must be finite on ordinary triangles; found {first}")


def _fields(term: Term, first: Derivatives) -> tuple[ndarray, ...]:
    name, fields = type(term).__name__, term.fields(first)
    if not isinstance(fields, tuple) or not fields:
        raise ArgumentTypeError(
            f"fields of {name} must return a tuple of arrays; found {type(fields).__name__}"
        )
    for field in fields:
        if np.asarray(field).dtype.kind != "f":
            raise ArgumentTypeError(
                f"the fields of {name} must be arrays of real numbers; found "
                f"{np.asarray(field).dtype}"
            )
    return tuple(map(np.asarray, fields))
