"""Compilation by numba, with a cache on disk.

The one module that imports numba: `riemhuman.kernels.compiled` does so when there is something to
compile.
"""

from __future__ import annotations

import math
import os
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.caching import FunctionCache
from numba.extending import intrinsic

Function = Callable[..., Any]

_said = False


def njit(**options: Any) -> Callable[[Function], Any]:
    """Return a decorator that compiles a function at its first call and keeps the result on disk.

    If the disk cannot be written, the function is compiled again in every process, and one warning
    says so; numba alone would refuse to work.

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
        If the compiled function cannot be kept on disk.
    """

    def decorate(function: Function) -> Any:
        # Without an error model, every division would look whether to raise. Without a value of
        # fastmath, a function takes that of its first caller: its bits depend on who came first.
        options.setdefault("fastmath", False)
        compiled = numba.njit(error_model="numpy", **options)(function)
        if compiled is not function:  # numba may be switched off
            try:
                compiled._cache = _Cache(function, _stamp(function.__globals__))
            except (OSError, RuntimeError) as error:
                _say(error)
        return compiled

    return decorate


class _Cache(FunctionCache):
    """Numba's files of compiled functions, without which everything works as well."""

    def __init__(self, function: Function, stamp: Any) -> None:
        super().__init__(function)
        if stamp is not None:
            # Numba by itself looks at the file of the function alone.
            self._cache_file._source_stamp = stamp

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
            "them anew, which takes half a minute; set NUMBA_CACHE_DIR to a writable folder",
            UserWarning,
            stacklevel=2,
        )


def _stamp(names: dict[str, Any]) -> tuple[tuple[float, int], ...] | None:
    """Return what changes with the source of a module, or of one that it takes functions from.

    None for what is not in files, as in notebooks.
    """
    files, modules = {__file__}, [names]
    while modules:
        names = modules.pop()
        file = names.get("__file__")
        if file is None or not os.path.isfile(file):
            return None
        if file not in files:
            files.add(file)
            functions = [value for value in list(names.values()) if hasattr(value, "py_func")]
            modules += [function.py_func.__globals__ for function in functions]
    found = (os.stat(file) for file in sorted(files))
    return tuple((status.st_mtime, status.st_size) for status in found)


def polynomial(single: tuple[float, ...], double: tuple[float, ...]) -> Any:
    """Return a polynomial for compiled functions, of one multiply-add a coefficient.

    Parameters
    ----------
    single, double : tuple of float
        Coefficients for arguments in single and in double precision, constant term first.

    Returns
    -------
    callable
    """

    @intrinsic
    def evaluate_constants(typing_context: Any, x: Any) -> Any:
        coefficients = single if x == types.float32 else double

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            values = [context.get_constant(x, c) for c in coefficients]
            return _horner(builder, values, arguments[0])

        return x(x), generate

    return evaluate_constants


def _horner(builder: Any, coefficients: list[Any], argument: Any) -> Any:
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        product = builder.fmul(value, argument, flags=("contract",))
        value = builder.fadd(product, coefficient, flags=("contract",))
    return value


@intrinsic
def evaluate(typing_context: Any, coefficients: Any, x: Any) -> Any:
    """Return the polynomial in x with these coefficients.

    Parameters
    ----------
    typing_context : object
        Numba's.
    coefficients : tuple
        Type of the coefficients, constant term first.
    x : type
        Type of the argument.

    Returns
    -------
    signature, code generator
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        packed, argument = arguments
        values = [builder.extract_value(packed, k) for k in range(coefficients.count)]
        return _horner(builder, values, argument)

    return x(coefficients, x), generate


@intrinsic
def split(typing_context: Any, x: Any) -> Any:
    """Return k and 2⁻ᵏ, for x > 0, such that 2⁻ᵏ x lies in [√½, √2).

    Parameters
    ----------
    typing_context : object
        Numba's.
    x : type
        Type of the argument.

    Returns
    -------
    signature, code generator
    """
    n_digits, bias = (23, 127) if x == types.float32 else (52, 1023)
    integer = types.int32 if x == types.float32 else types.int64
    lowest = int(np.asarray(math.sqrt(0.5), str(x)).view(str(integer)))

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def constant(value: int) -> Any:
            return context.get_constant(integer, value)

        bits = builder.bitcast(arguments[0], context.get_value_type(integer))
        exponent = builder.ashr(builder.sub(bits, constant(lowest)), constant(n_digits))
        scale = builder.shl(builder.sub(constant(bias), exponent), constant(n_digits))
        real = arguments[0].type
        pair = (builder.sitofp(exponent, real), builder.bitcast(scale, real))
        return context.make_tuple(builder, signature.return_type, pair)

    return types.UniTuple(x, 2)(x), generate


@intrinsic
def squared_differences(
    typing_context: Any, a: Any, b: Any, i: Any, j: Any, first: Any, last: Any
) -> Any:
    """Return Σ_t (a[k, t] − b[m, t])² over first ≤ t < last, for all k in i and m in j.

    Of what is read, each number serves a whole block of sums, as in a product of matrices. It goes
    through vectors of 64 bytes; those that LLVM finds by itself have half of that, and take longer
    to compile. The order of a sum does not depend on the block: one partial sum for each place of a
    vector, then halves added to halves.

    Parameters
    ----------
    typing_context : object
        Numba's.
    a, b : type
        Types of C-contiguous arrays of float32 or float64.
    i, j : type
        Types of tuples of row numbers.
    first, last : type
        Types of column numbers, whole vectors apart.

    Returns
    -------
    signature, code generator
    """
    real = a.dtype
    lanes = 512 // real.bitwidth

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        start, end = arguments[4:]
        register = ir.VectorType(context.get_value_type(real), lanes)

        def row_starts(kind: Any, array: Any, numbers: Any) -> list[Any]:
            view = context.make_array(kind)(context, builder, array)
            _, length = cgutils.unpack_tuple(builder, view.shape, 2)
            rows = cgutils.unpack_tuple(builder, numbers)
            return [builder.gep(view.data, [builder.mul(row, length)]) for row in rows]

        def load(row: Any) -> Any:
            place = builder.bitcast(builder.gep(row, [position]), register.as_pointer())
            return builder.load(place, align=real.bitwidth // 8)

        ours, others = row_starts(a, *arguments[:3:2]), row_starts(b, *arguments[1:4:2])
        before = builder.block
        loop, after = builder.append_basic_block(), builder.append_basic_block()
        builder.branch(loop)
        builder.position_at_end(loop)
        position = builder.phi(start.type)
        totals = [builder.phi(register) for _ in range(i.count * j.count)]
        values, other_values = [load(row) for row in ours], [load(row) for row in others]
        pairs = ((one, other) for one in values for other in other_values)
        sums = []
        for total, (one, other) in zip(totals, pairs, strict=True):
            gap = builder.fsub(one, other)
            sums.append(
                builder.fadd(
                    total, builder.fmul(gap, gap, flags=("contract",)), flags=("contract",)
                )
            )
            total.add_incoming(ir.Constant(register, [0.0] * lanes), before)
            total.add_incoming(sums[-1], loop)
        following = builder.add(position, ir.Constant(start.type, lanes))
        position.add_incoming(start, before)
        position.add_incoming(following, loop)
        builder.cbranch(builder.icmp_signed("<", following, end), loop, after)
        builder.position_at_end(after)
        found = [_sum_of_vector(builder, total) for total in sums]
        return context.make_tuple(builder, signature.return_type, found)

    return types.UniTuple(real, i.count * j.count)(a, b, i, j, first, last), generate


def _sum_of_vector(builder: Any, vector: Any) -> Any:
    index = ir.IntType(32)
    while (count := vector.type.count // 2) > 0:
        nothing = ir.Constant(vector.type, ir.Undefined)
        low, high = (
            ir.Constant(ir.VectorType(index, count), list(range(k, k + count))) for k in (0, count)
        )
        vector = builder.fadd(
            builder.shuffle_vector(vector, nothing, low),
            builder.shuffle_vector(vector, nothing, high),
        )
    return builder.extract_element(vector, ir.Constant(index, 0))
