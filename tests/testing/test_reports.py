"""Reports of checks: what fails, and the table that they print."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.testing import PropertyCheck, PropertyReport
from riemhuman.testing.reports import difference, excess, report_of, share


def refuse():
    raise ArgumentError("it has none")


def test_what_is_refused_or_not_a_number_fails():
    properties = {"exact": lambda: 0.0, "rough": lambda: 0.2, "odd": lambda: np.nan, "none": refuse}
    report = report_of([], properties, 0.1, {"rough": 0.2})
    assert [check.name for check in report.failures] == ["odd", "none"]
    assert not report.passed
    first, *lines = str(report).splitlines()
    assert first == "list: 2 of 4 properties hold"
    assert [line.split()[0] for line in lines] == ["holds", "holds", "FAILS", "FAILS"]
    assert PropertyReport("Nothing", ()).passed
    assert [PropertyCheck("any", error, 1.0).holds for error in (1.0, np.nan)] == [True, False]


def test_other_errors_are_those_of_the_check():
    with pytest.raises(ZeroDivisionError):
        report_of([], {"any": lambda: 1 / 0}, 0.1)


def test_differences_are_relative():
    assert difference([1.0, 2.0], [1.0, 4.0]) == 0.5
    assert difference([1.0, 2.0], [1.0, 4.0], size=1.0) == 2.0
    assert difference(np.zeros(2), np.zeros(2)) == 0.0
    assert difference(np.zeros(2), np.zeros((2, 1))) == np.inf
    assert excess([1.0, 3.0], [2.0, 2.0], 10.0) == pytest.approx(0.1)
    assert share([True, False, False, True]) == 0.5
