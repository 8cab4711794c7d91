"""Compiled loops run by Python, which checks every index.

Compiled code reads and writes beyond the ends of arrays without a word.
"""

import numpy as np


def interpret(monkeypatch, modules):
    """Let Python run the compiled functions of modules."""
    module_names = {module.__name__ for module in modules}
    for module in modules:
        for name, function in list(vars(module).items()):
            if hasattr(function, "py_func") and function.py_func.__module__ in module_names:
                monkeypatch.setattr(module, name, function.py_func)


def check_bounds(monkeypatch, modules, calls):
    """Check that calls return the same arrays when Python runs the loops of modules."""
    expected = [call() for call in calls]
    interpret(monkeypatch, modules)
    for call, arrays in zip(calls, expected, strict=True):
        for result, array in zip(call(), arrays, strict=True):
            scale = np.abs(array).max()
            np.testing.assert_allclose(result, array, rtol=1e-6, atol=1e-11 * scale)
