"""Every refusal is a RiemhumanError, and the built-in error people expect."""

import inspect

import pytest

import riemhuman
from riemhuman import errors


def test_errors_are_what_people_expect():
    for name, error in inspect.getmembers(errors, inspect.isclass):
        if issubclass(error, errors.RiemhumanError) and error is not errors.RiemhumanError:
            expected = [base for base in error.__mro__ if base.__module__ == "builtins"]
            assert set(expected) > {Exception, BaseException, object}, name
    assert riemhuman.RiemhumanError is errors.RiemhumanError


def test_a_warning_reaches_code_that_runs_without_a_module():
    bare = {"warn": errors.warn, "category": errors.ConvergenceWarning}
    with pytest.warns(errors.ConvergenceWarning, match="slow") as caught:
        exec(compile("warn('slow', category)", "cell.py", "exec"), bare)
    assert caught[0].filename == "cell.py"
