"""Results, and the one warning of a solver that has not converged."""

import dataclasses
import importlib
import pkgutil
import warnings

import numpy as np
import pytest

from riemhuman import solvers
from riemhuman.errors import ArgumentError, ConvergenceWarning
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


MODULES = [
    importlib.import_module(f"riemhuman.solvers.{module.name}")
    for module in pkgutil.iter_modules(solvers.__path__)
]
DATACLASSES = [
    cls
    for module in MODULES
    for cls in vars(module).values()
    if dataclasses.is_dataclass(cls) and getattr(cls, "__module__", "") == module.__name__
]


@pytest.mark.parametrize("cls", [c for c in DATACLASSES if not c.__name__.startswith("_")])
def test_solvers_and_results_are_frozen(cls):
    instance = object.__new__(cls)
    for field in dataclasses.fields(cls):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(instance, field.name, None)


@pytest.mark.parametrize("cls", [c for c in DATACLASSES if hasattr(c, "solve")])
def test_solvers_say_nothing_unless_asked_to(cls):
    defaults = {field.name: field.default for field in dataclasses.fields(cls)}
    assert not defaults.get("progress", False)
    assert defaults.get("callback") is None


PATH, DESCENT = {"n_nodes": 11}, {"tolerance": 1e-8, "max_iter": 50}
LADDER = {"n_rungs": 10, "exact": True, "scale": 1.0, "tolerance": 1e-10, "max_iter": 50}
DRIFT = {"remove_drift": True, "max_iter": 1000}
SEARCH = {"progress": False}
DEFAULTS = {
    "BasisMean": {**SEARCH, "with_differences": True, "tolerance": 1e-8, "max_iter": 500},
    "BasisPath": {**PATH, **DRIFT, **SEARCH, "tolerance": 1e-4},
    "ClosedFormGeodesic": PATH,
    "DiscreteExponential": {**DESCENT, "n_steps": 10},
    "DiscreteLogarithm": {**DESCENT, "n_steps": 10},
    "Disentangling": {
        **SEARCH,
        "shape_weight": 1.0,
        "pose_weight": 50.0,
        "tolerance": 1e-3,
        "max_iter": 300,
    },
    "GradientDescentMean": {"step": 1.0, "tolerance": 1e-8, "max_iter": 2000},
    "LinearPath": PATH,
    "MiddleEquation": DESCENT,
    "ModelPath": PATH,
    "PathStraightening": {
        **PATH,
        **DRIFT,
        **SEARCH,
        "coarse_segments": (2, 4),
        "tolerance": 1e-5,
    },
    "PoissonPath": PATH,
    "PoleLadder": LADDER,
    "SchildLadder": LADDER,
}


@pytest.mark.parametrize("cls", [c for c in DATACLASSES if c.__name__ in DEFAULTS])
def test_numbers_that_results_were_computed_with_stay(cls):
    """Figures that are printed without settings depend on them."""
    kinds = (bool, int, float, tuple)
    found = {field.name: field.default for field in dataclasses.fields(cls)}
    assert {k: v for k, v in found.items() if isinstance(v, kinds)} == DEFAULTS[cls.__name__]


LEAST = {"n_nodes": 2, "max_iter": 1, "n_steps": 1, "n_rungs": 1}
MODELS = ("basis", "model")
POSITIVE = ("tolerance", "scale", "step", "shape_weight", "pose_weight")


def settings_of(bounds):
    """Return solvers with the settings of theirs that are named."""
    return [
        (cls, field.name)
        for cls in DATACLASSES
        if hasattr(cls, "solve") and not cls.__name__.startswith("_")
        for field in dataclasses.fields(cls)
        if field.name in bounds
    ]


def build(cls, **settings):
    """Return a solver; none looks at its basis or model before it solves."""
    given = {field.name: None for field in dataclasses.fields(cls) if field.name in MODELS}
    return cls(**given, **settings)


@pytest.mark.parametrize(("cls", "name"), settings_of(LEAST))
def test_least_numbers_are_legal(cls, name):
    assert getattr(build(cls, **{name: LEAST[name]}), name) == LEAST[name]
    with pytest.raises(ArgumentError, match=f"{name} must be a whole number of at least"):
        build(cls, **{name: LEAST[name] - 1})


@pytest.mark.parametrize(("cls", "name"), settings_of(POSITIVE))
def test_small_numbers_above_zero_are_legal(cls, name):
    assert getattr(build(cls, **{name: 1e-300}), name) == 1e-300
    with pytest.raises(ArgumentError, match=f"{name} must be a finite number above 0"):
        build(cls, **{name: 0.0})
