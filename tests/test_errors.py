"""Every refusal is a RiemhumanError, and the built-in error people expect."""

import inspect

import pytest

import riemhuman
from riemhuman import errors

EXPECTED = {
    "ArgumentError": ValueError,
    "ArgumentTypeError": TypeError,
    "DegenerateSurfaceError": ValueError,
    "NotDefinedError": NotImplementedError,
    "OutsideManifoldError": ValueError,
    "FrameIndexError": IndexError,
    "UnknownNameError": KeyError,
    "FileError": OSError,
    "FileFormatError": ValueError,
    "OutOfMemoryError": MemoryError,
    "MissingDependencyError": ImportError,
    "ClusterError": RuntimeError,
}


@pytest.mark.parametrize(("name", "built_in"), EXPECTED.items())
def test_errors_are_what_people_expect(name, built_in):
    error = getattr(errors, name)
    assert issubclass(error, errors.RiemhumanError)
    assert issubclass(error, built_in)


def test_none_is_forgotten():
    classes = {
        name
        for name, member in inspect.getmembers(errors, inspect.isclass)
        if issubclass(member, errors.RiemhumanError) and member is not errors.RiemhumanError
    }
    assert classes == set(EXPECTED)
    assert issubclass(errors.DegenerateSurfaceError, errors.ArgumentError)
    assert riemhuman.RiemhumanError is errors.RiemhumanError


def test_a_warning_reaches_code_that_runs_without_a_module():
    bare = {"warn": errors.warn, "category": errors.ConvergenceWarning}
    with pytest.warns(errors.ConvergenceWarning, match="slow") as caught:
        exec(compile("warn('slow', category)", "cell.py", "exec"), bare)
    assert caught[0].filename == "cell.py"
