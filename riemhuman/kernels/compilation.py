"""Compilation by numba, whose results are kept on disk wherever the disk allows."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
from numba.core.caching import FunctionCache

Function = Callable[..., Any]

_said = False


def njit(**options: Any) -> Callable[[Function], Any]:
    """Return a decorator that compiles a function at its first call and keeps the result on disk.

    Where the disk cannot be written, the function is compiled anew in every process, and a
    warning says so once: numba itself refuses to work there.

    Parameters
    ----------
    **options : object
        See `numba.njit`.

    Returns
    -------
    callable
        The decorator.

    Warns
    -----
    UserWarning
        If what is compiled cannot be kept.
    """

    def decorate(function: Function) -> Any:
        compiled = numba.njit(**options)(function)
        if compiled is not function:  # numba may be switched off
            try:
                compiled._cache = _Cache(function)
            except (OSError, RuntimeError) as error:
                _say(error)
        return compiled

    return decorate


class _Cache(FunctionCache):
    """Numba's files of compiled functions, without which everything works as well."""

    def load_overload(self, *arguments: Any) -> Any:
        """Return a compiled function, or None if it must be compiled."""
        try:
            return super().load_overload(*arguments)
        except Exception:  # noqa: BLE001, whatever a damaged file brings up: it is made anew
            with self._forgiven():
                self.flush()
            return None

    def save_overload(self, *arguments: Any) -> None:
        """Keep a compiled function."""
        with self._forgiven():
            super().save_overload(*arguments)

    @contextmanager
    def _forgiven(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            _say(error)
            self.disable()


def _say(error: Exception) -> None:
    global _said
    if not _said:
        _said = True
        warnings.warn(
            f"compiled functions cannot be kept on disk ({error}), so that every process compiles "
            "them anew, which takes half a minute; let NUMBA_CACHE_DIR name a folder that can be "
            "written",
            UserWarning,
            stacklevel=2,
        )
