"""How `sabotage` has pytest run tests: recorded, interpreted, or some alone."""

from __future__ import annotations

import json
import math
import os
import signal
import sys
import time
from pathlib import Path
from types import CodeType
from typing import Any, NoReturn

import numpy as np
import pytest

# Seconds for a test that runs interpreted.
_INTERPRETED = 10


class Recorder:
    """Writes down which functions of the package every test runs, and how long it takes."""

    def __init__(self, package: Path, path: Path) -> None:
        self._package, self._path = f"{package}{os.sep}", path
        # By their ids: hashes of code are those of its text, which takes time at every call.
        self._run: dict[int, CodeType] = {}
        self._tests: dict[str, Any] = {}
        self._failed: set[str] = set()

    def _watch(self) -> None:
        self._run = ran = {}

        def note(frame: Any, event: str, _: Any) -> None:
            code = frame.f_code
            ran[id(code)] = code

        sys.settrace(note)

    def _functions(self) -> list[tuple[str, int]]:
        """Return what ran since `_watch`: files of the package, and first lines."""
        sys.settrace(None)
        ours = [code for code in self._run.values() if code.co_filename.startswith(self._package)]
        names = [code.co_filename.removeprefix(self._package) for code in ours]
        return sorted({*zip(names, (code.co_firstlineno for code in ours), strict=True)})

    @pytest.hookimpl(wrapper=True)
    def pytest_make_collect_report(self, collector: Any) -> Any:
        # What a file of tests makes for all of them.
        self._watch()
        report = yield
        if functions := self._functions():
            self._tests[collector.nodeid] = (0.0, functions)
        return report

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: Any) -> Any:
        began = time.monotonic()
        self._watch()
        result = yield
        self._tests[item.nodeid] = (time.monotonic() - began, self._functions())
        return result

    def pytest_runtest_logreport(self, report: Any) -> None:
        if not report.passed:
            self._failed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        passed = {test: ran for test, ran in self._tests.items() if test not in self._failed}
        self._path.write_text(json.dumps(passed), encoding="utf-8")


def _horner(coefficients: Any, x: Any) -> Any:
    """Return the polynomial in x with these coefficients, constant term first."""
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value = value * x + coefficient
    return value


def _split(x: Any) -> Any:
    """Return k and 2⁻ᵏ such that 2⁻ᵏ x lies in [√½, √2)."""
    mantissa, exponent = math.frexp(x)
    exponent -= mantissa < math.sqrt(0.5)
    return float(exponent), 2.0**-exponent


def _squared_differences(a: Any, b: Any, i: Any, j: Any, first: int, last: int) -> Any:
    """Return Σ_t (a[k, t] − b[m, t])² over first ≤ t < last, for all k in i and m in j."""
    pairs = ((a[k, first:last], b[m, first:last]) for k in i for m in j)
    return tuple(np.sum((one - other) ** 2) for one, other in pairs)


class Interpreted:
    """Runs compiled functions as Python, every test for some seconds at most."""

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        from riemhuman.kernels import compilation

        def polynomial(single: Any, double: Any) -> Any:
            return lambda x: _horner(single if isinstance(x, np.float32) else double, x)

        compilation.polynomial = polynomial
        compilation.evaluate = _horner
        compilation.split = _split
        compilation.squared_differences = _squared_differences
        signal.signal(signal.SIGALRM, self._end)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Any:
        signal.alarm(_INTERPRETED)
        try:
            with np.errstate(all="ignore"):
                return (yield)
        finally:
            signal.alarm(0)

    @staticmethod
    def _end(*_: Any) -> NoReturn:
        raise TimeoutError


class Chosen:
    """Runs some tests alone, in an order."""

    def __init__(self, tests: list[str]) -> None:
        self._places = {test: number for number, test in enumerate(tests)}

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        chosen = [item for item in items if item.nodeid in self._places]
        items[:] = sorted(chosen, key=lambda item: self._places[item.nodeid])
