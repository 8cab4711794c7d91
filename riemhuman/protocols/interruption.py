"""How a result says that its solver was stopped from the keyboard."""

from __future__ import annotations

from typing import TypeVar

INTERRUPTED = "interrupted from the keyboard"
"""What a result says whose solver was stopped from the keyboard."""

Found = TypeVar("Found")


def was_interrupted(result: object) -> bool:
    """Tell whether a solver was stopped from the keyboard.

    Parameters
    ----------
    result : object
        What it returned.

    Returns
    -------
    bool
    """
    unfinished = not getattr(result, "converged", True)
    return unfinished and INTERRUPTED in str(getattr(result, "message", ""))


def uninterrupted(result: Found) -> Found:
    """Return a result, unless its solver was stopped from the keyboard: then the caller stops too.

    Parameters
    ----------
    result : object
        What a solver returned.

    Returns
    -------
    object
        The same.

    Raises
    ------
    KeyboardInterrupt
        If the solver was interrupted: half a search is no number to go on with.
    """
    if was_interrupted(result):
        raise KeyboardInterrupt
    return result
