"""Functions that are compiled when they are first called, not when they are imported.

Loading numba takes longer than a single distance, so a function marked `compiled` is compiled at
its first call, together with all functions marked so far: in the modules that define them, every
marked name, defined or imported there, is bound to its compiled function. Machine code is read from
disk if it is there; see `riemhuman.kernels.compilation`. Marked functions are functions of modules:
one composed at run time would be compiled anew in every process.
"""

from __future__ import annotations

import functools
import os
import sys
import threading
from collections.abc import Callable
from typing import Any

FUSED = {"contract", "nsz"}
"""Value of `fastmath` for functions in loops over pairs: products may join sums."""

SUM = {"contract", "nsz", "reassoc"}
"""Value of `fastmath` for sums: terms may also change places."""

_lock = threading.RLock()
_waiting: list[Compiled] = []


class Compiled:
    """The placeholder of a compiled function until the first call.

    Parameters
    ----------
    build : callable
        Returns the compiled function.
    module_names : dict
        The global names of the module that defines it.
    """

    def __init__(self, build: Callable[[], Any], module_names: dict[str, Any]) -> None:
        self.build, self.module_names = build, module_names
        _waiting.append(self)

    @functools.cached_property
    def function(self) -> Any:
        """The compiled function."""
        return self.build()

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function.

        Parameters
        ----------
        *arguments
            Its arguments.

        Returns
        -------
        object
            What it returns.
        """
        _bind()
        return self.function(*arguments)


def compiled(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Mark a function of a module to be compiled by numba when it is first called.

    It may call other marked functions, its own module's and those that its module imports by name.
    It releases the interpreter lock. Division by zero gives infinity or NaN, as in NumPy.

    Parameters
    ----------
    function : callable
        The function, in the part of Python and NumPy that numba understands.
    **options
        Options of `numba.njit`, such as ``fastmath``.

    Returns
    -------
    callable
        With the Python function as its attribute `py_func`.

    Examples
    --------
    >>> from riemhuman.terms import compiled
    >>> @compiled
    ... def double(x):
    ...     return 2.0 * x
    >>> double.py_func(1.5)
    3.0
    """
    if function is None:
        return functools.partial(compiled, **options)

    def build() -> Any:
        from riemhuman.kernels.compilation import njit

        return njit(nogil=True, **options)(function)

    marked = Compiled(build, function.__globals__)
    functools.update_wrapper(marked, function)
    marked.py_func = function  # type: ignore[attr-defined]
    return marked


def polynomial(single: tuple[float, ...], double: tuple[float, ...]) -> Any:
    """Return a polynomial for the marked functions of a module to call.

    Parameters
    ----------
    single, double : tuple of float
        Coefficients for arguments in single and in double precision, constant term first.

    Returns
    -------
    callable
    """

    def build() -> Any:
        from riemhuman.kernels import compilation

        return compilation.polynomial(single, double)

    return Compiled(build, sys._getframe(1).f_globals)


def _of_compilation(name: str) -> Compiled:
    def build() -> Any:
        from riemhuman.kernels import compilation

        return getattr(compilation, name)

    return Compiled(build, globals())


evaluate = _of_compilation("evaluate")
"""``evaluate(coefficients, x)`` in marked functions: the polynomial, constant term first."""

split = _of_compilation("split")
"""``split(x)`` in marked functions: k and 2⁻ᵏ, for x > 0, such that 2⁻ᵏ x lies in [√½, √2)."""

squared_differences = _of_compilation("squared_differences")
"""``squared_differences(a, b, i, j, first, last)`` in marked functions, for tuples of rows i and j:
Σ_t (a[k, t] − b[m, t])² over first ≤ t < last, for all k in i and m in j, row by row. Arrays are
C-contiguous, and `last` − `first` is a positive multiple of 16. The bits of a sum depend on its own
two rows alone."""


def _bind() -> None:
    """Bind names to compiled functions in all modules that define some."""
    with _lock:
        modules = {id(marked.module_names): marked.module_names for marked in _waiting}
        # Numba looks names up when it compiles, so all are bound before the first is called.
        for names in modules.values():
            for name, value in list(names.items()):
                if isinstance(value, Compiled):
                    names[name] = value.function
        _waiting.clear()


def _renew_lock() -> None:
    global _lock
    _lock = threading.RLock()


if hasattr(os, "register_at_fork"):
    # Who held it has not survived the fork.
    os.register_at_fork(after_in_child=_renew_lock)
