"""Functions that numba compiles when they are first called, and keeps on disk.

Loading numba takes longer than a single distance, so a function marked `compiled` is compiled at
its first call, together with all functions marked so far: in the modules that define them, every
marked name, defined or imported there, is bound to its compiled function. Marked functions are
functions of modules: one composed at run time would be compiled anew in every process.
"""

from __future__ import annotations

import functools
import gc
import hashlib
import os
import sys
import threading
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import TypeAlias, TypeVar, overload

FUSED = {"contract", "nsz"}
"""Value of `fastmath` for functions in loops over pairs: products may join sums."""

SUM = {"contract", "nsz", "reassoc"}
"""Value of `fastmath` for sums: terms may also change places."""

Options: TypeAlias = dict[str, bool | str | set[str]]
"""Options of `numba.njit`."""

# Seconds of compilation after which the user is told.
_LONG = 2.0

_lock = threading.RLock()
_waiting: list[Compiled] = []


class Compiled:
    """The placeholder of a compiled function until the first call."""

    def __init__(self, function: Callable[..., object], options: Options) -> None:
        self.py_func, self._options = function, options
        self.is_inlined = bool(options.get("forceinline"))
        functools.update_wrapper(self, function)
        _waiting.append(self)

    @functools.cached_property
    def function(self) -> Callable[..., object]:
        """The compiled function."""
        return _njit(self.py_func, self._options)

    @property
    def _numba_type_(self) -> object:
        """The type of the compiled function, which numba asks of an object that code names."""
        import numba

        return numba.types.Dispatcher(self.function)

    def __call__(self, *arguments: object) -> object:
        if self.is_inlined:
            return self.py_func(*arguments)
        _bind()
        return self.function(*arguments)


Function = TypeVar("Function", bound=Callable[..., object])


@overload
def compiled(function: Function) -> Function: ...


@overload
def compiled(
    *, forceinline: bool = ..., inline: str = ..., fastmath: set[str] = ...
) -> Callable[[Function], Function]: ...


def compiled(
    function: Callable[..., object] | None = None, **options: bool | str | set[str]
) -> object:
    """Mark a function of a module to be compiled by numba when it is first called.

    It may call other marked functions of its own module, and those that its module imports by name.
    It releases the interpreter lock. Division by zero gives infinity or NaN. The Python function is
    `py_func`. If there is no writable folder in which to store compiled functions, a warning says
    so. A function that is always inlined (``forceinline=True``) is compiled only as a part of its
    callers; called from Python, it runs as Python code.

    Parameters
    ----------
    function : callable
        The function, in the part of Python and NumPy that numba understands.
    **options
        Options of `numba.njit`, such as ``fastmath``.

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
    return Compiled(function, options)


class CompilationTime:
    """The time that compilation takes in this process, and what to call once it is long."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._tell: Callable[[], None] | None = None
        self._starts: list[float] = []
        self._listens = self._collects = False

    def tell(self, function: Callable[[], None] | None) -> None:
        """Have a function called, once, when compilation has taken two seconds."""
        self._tell = function

    def listen(self) -> None:
        """Take the time from now on."""
        if self._listens:
            return
        self._listens = True
        from numba.core import event

        taken = self

        class Listener(event.Listener):
            def on_start(self, started: object) -> None:
                taken._begin()

            def on_end(self, ended: object) -> None:
                taken._end()

        event.register("numba:compile", Listener())

    def _begin(self) -> None:
        if not self._starts:
            # Numba makes many objects and keeps most: a search for unused ones takes long.
            self._collects = gc.isenabled()
            gc.disable()
        self._starts.append(time.perf_counter())

    def _end(self) -> None:
        if not self._starts:  # a function of others that calls ours, begun before we listened
            return
        # A function may wait for others that it calls.
        start = self._starts.pop()
        elapsed = self.seconds + time.perf_counter() - (self._starts or [start])[0]
        if not self._starts:
            self.seconds = elapsed
            if self._collects:
                gc.enable()
        if self._tell is not None and elapsed > _LONG:
            tell, self._tell = self._tell, None
            tell()


compilation_time = CompilationTime()


def _njit(function: Callable[..., object], options: Options) -> Callable[..., object]:
    import numba

    compilation_time.listen()
    # With Python's error model, every division would check whether to raise. Unless fastmath is
    # set, a function inherits it from its first caller: its bits would depend on that caller.
    # Compiling C-callable wrappers, and Python wrappers of inlined functions, is slow.
    options = {"fastmath": False, "error_model": "numpy", "nogil": True, **options}
    options["no_cfunc_wrapper"] = True
    compiled_function: Callable[..., object]
    if options.get("forceinline"):  # kept on disk as a part of its callers
        compiled_function = numba.njit(no_cpython_wrapper=True, **options)(function)
        return compiled_function
    cached = _beside_cache(function)
    try:
        compiled_function = numba.njit(cache=True, **options)(cached)
    except (OSError, RuntimeError):  # numba has no folder that it can write to
        _warn_once()
        compiled_function = numba.njit(**options)(function)
    return compiled_function


def _beside_cache(function: Callable[..., object]) -> Callable[..., object]:
    """Return the function as if its file were a copy of it in the user's cache folder.

    Numba keeps compiled functions beside their file, and checks that file alone. The folder of the
    copy has the digest of all files that the function depends on as its name: processes, runs and
    environments of the same sources share it, and others never read it.
    """
    assert isinstance(function, FunctionType)
    digest = _digest(function.__globals__)
    if digest is None:
        return function
    source = Path(function.__globals__["__file__"])
    copy = _cache_folder() / digest / source.name
    try:
        if not copy.exists():
            copy.parent.mkdir(parents=True, exist_ok=True)
            # Under a name of its own first: another process may do the same.
            partial = copy.with_name(f"{source.stem}-{os.getpid()}-{threading.get_ident()}")
            partial.write_bytes(source.read_bytes())
            os.replace(partial, copy)
    except OSError:  # beside the file itself, or wherever numba can write
        return function
    function.__code__ = function.__code__.replace(co_filename=str(copy))
    return function


def _cache_folder() -> Path:
    """Return the folder of compiled functions: that of numba if it is set, or the user's."""
    chosen = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    if chosen:
        return Path(chosen, "riemhuman")
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home()), "riemhuman", "cache")
    return Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache") / "riemhuman"


@functools.cache
def _warn_once() -> None:
    warnings.warn(
        "compiled functions cannot be stored on disk, so every process compiles them again, "
        "which takes half a minute; set NUMBA_CACHE_DIR to a writable folder",
        UserWarning,
        stacklevel=2,
    )


def _digest(names: dict[str, object]) -> str | None:
    """Return what changes with the files that a module depends on; None in notebooks."""
    # Constants come from other modules of kernels and terms, too.
    folders = Path(__file__).parent, Path(__file__).parents[1] / "terms"
    files = {str(file) for folder in folders for file in folder.glob("*.py")}
    modules = [names]
    while modules:
        names = modules.pop()
        file = names.get("__file__")
        if not isinstance(file, str) or not os.path.isfile(file):
            return None
        if file not in files:
            files.add(file)
            functions = [value for value in list(names.values()) if hasattr(value, "py_func")]
            modules += [function.py_func.__globals__ for function in functions]
    import numba

    contents = b"".join(sorted(_digest_of_file(file) for file in files))
    return hashlib.sha256(contents + numba.__version__.encode()).hexdigest()[:16]


@functools.cache
def _digest_of_file(file: str) -> bytes:
    return hashlib.sha256(Path(file).read_bytes()).digest()


def _bind() -> None:
    """Bind names to compiled functions in all modules that define some."""
    with _lock:
        modules = {}
        for placeholder in _waiting:
            names = placeholder.py_func.__globals__
            modules[id(names)] = names
        # Numba looks names up when it compiles, so all of them are bound before the first call.
        for names in modules.values():
            for name, value in list(names.items()):
                if isinstance(value, Compiled) and not value.is_inlined:
                    names[name] = value.function
        _waiting.clear()
