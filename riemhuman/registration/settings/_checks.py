"""Checks of numbers in settings, which name the one that is wrong."""

from __future__ import annotations

from riemhuman.checks import real_number, refuse_type, whole_number
from riemhuman.errors import ArgumentError


def check_counts(**counts: int) -> None:
    for name, value in counts.items():
        whole_number(value, name, minimum=1)


def check_amounts(**amounts: float) -> None:
    """Refuse what is no positive number: a length, an angle, a weight or a deviation."""
    for name, value in amounts.items():
        real_number(value, name, minimum=0.0, strict=True)


def check_lists(**lists: tuple[float, ...]) -> None:
    for name, values in lists.items():
        if not isinstance(values, tuple) or not values:
            refuse_type(values, name, "a tuple of numbers, at least one")
        for number, value in enumerate(values):
            real_number(value, f"{name}[{number}]")


def check_pairs(**lists: tuple[tuple[float, float], ...]) -> None:
    for name, pairs in lists.items():
        if not isinstance(pairs, tuple) or not pairs:
            refuse_type(pairs, name, "a tuple of pairs of numbers, at least one")
        for number, pair in enumerate(pairs):
            if not isinstance(pair, tuple) or len(pair) != 2:
                refuse_type(pair, f"{name}[{number}]", "a pair of numbers")
            for value in pair:
                real_number(value, f"{name}[{number}]")


def check_shares(**shares: float) -> None:
    for name, value in shares.items():
        if real_number(value, name, minimum=0.0) > 1.0:
            raise ArgumentError(f"{name} must be a number between 0 and 1; found {value!r}")


def check_cosines(**cosines: float) -> None:
    for name, value in cosines.items():
        if abs(real_number(value, name)) > 1.0:
            raise ArgumentError(f"{name} must be a cosine, between -1 and 1; found {value!r}")
