"""Checks of terms that a metric is made of: what their methods return, and that they are local."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as onp

from riemhuman.errors import ArgumentError, ArgumentTypeError, shown
from riemhuman.kernels.surface import follow_up
from riemhuman.terms.flat import FlatTerm
from riemhuman.terms.term import Term

# Partial derivatives of three triangles on each of two surfaces, nearly those of the template.
_TRIANGLES = onp.random.default_rng(0).uniform(-0.3, 0.3, (2, 2, 3, 3))
_TRIANGLES += onp.eye(2, 3)[:, None, None]

TermType = TypeVar("TermType")


def checked_terms(terms: Sequence[TermType], term_class: type[object]) -> tuple[TermType, ...]:
    """Return the terms of a metric after checking that they work triangle by triangle."""
    if not terms:
        raise ArgumentError("terms must hold at least one term; found none")
    for term in terms:
        if not isinstance(term, term_class):
            raise ArgumentTypeError(
                f"terms must hold instances of {term_class.__name__}; found {shown(term)}"
            )
        if isinstance(term, Term):
            with onp.errstate(all="ignore"):
                _check_fields(term)
    return tuple(terms)


def _check_fields(term: Term) -> None:
    name, shape = type(term).__name__, _TRIANGLES.shape[1:3]
    together = term.fields(follow_up(*_TRIANGLES))
    if not isinstance(together, tuple) or not together:
        raise ArgumentTypeError(
            f"fields of {name} must return a tuple of arrays; found {type(together).__name__}"
        )
    alone = term.fields(follow_up(*_TRIANGLES[:, 1:, 2:]))
    is_flat = isinstance(term, FlatTerm)
    dimensions = (3,) if is_flat else (2, 3)
    for whole, part in zip(together, alone, strict=True):
        if whole.shape[:2] != shape or whole.ndim not in dimensions:
            expected = "(..., F, n)" if is_flat else "(..., F) or (..., F, n)"
            raise ArgumentError(
                f"the fields of {name} must have shape {expected}; for derivatives of shape "
                f"(2, 3, 3), of three triangles on each of two surfaces, found {whole.shape}"
            )
        if not onp.allclose(whole[1:, 2:], part, rtol=1e-8, atol=1e-8):
            raise ArgumentError(
                f"the fields of {name} must be computed triangle by triangle; found values that "
                "change with the other triangles"
            )
    found_shape = onp.shape(term.squared_dist(together, together))
    if found_shape != shape:
        raise ArgumentError(
            f"squared_dist of {name} must return shape (..., F), one number per triangle; for "
            f"fields of three triangles on each of two surfaces, found {found_shape}"
        )
