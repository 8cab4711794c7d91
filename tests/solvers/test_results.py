"""Results, and the one warning of a solver that has not converged."""

import dataclasses
import warnings

import numpy as np
import pytest

from riemhuman.errors import ConvergenceWarning
from riemhuman.solvers.results import MeanResult, PathResult, warn_unless_converged


class Solver:
    def solve(self, converged):
        result = PathResult(np.zeros((2, 1)), 1.0, np.array([1.0]), 7, 9, converged, "out of time")
        warn_unless_converged(self, result)
        return result


def test_a_solver_that_has_not_converged_warns_its_caller_once():
    with pytest.warns(ConvergenceWarning) as caught:
        Solver().solve(converged=False)
    (warning,) = caught
    assert str(warning.message) == (
        "Solver stopped without converging after 7 iterations: out of time"
    )
    assert warning.filename == __file__


def test_a_solver_that_has_converged_is_silent():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Solver().solve(converged=True)


@pytest.mark.parametrize("result_class", [PathResult, MeanResult])
def test_results_do_not_change(result_class):
    result = result_class(np.zeros(1), 0.0, np.zeros(1), 0, 1, True, "")
    for field in dataclasses.fields(result):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(result, field.name, None)
