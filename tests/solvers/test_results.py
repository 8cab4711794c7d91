"""Results, and the one warning of a solver that has not converged."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from cases import CASES

from riemhuman import solvers
from riemhuman.errors import (
    ArgumentTypeError,
    ConvergenceWarning,
    FileFormatError,
)
from riemhuman.geometry import ElasticMetric, VectorSpace
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.solvers import (
    BasisMean,
    FrechetMean,
    GeometricMedian,
    GradientDescentMean,
    PathStraightening,
    TangentPCA,
)
from riemhuman.solvers._lbfgs import Minimum
from riemhuman.solvers.logarithm import LogarithmResult
from riemhuman.solvers.parallel_transport import TransportResult
from riemhuman.solvers.results import MeanResult, PathResult, Status


def test_a_solver_that_has_not_converged_warns_its_caller_once():
    case = CASES["pose open"]
    with pytest.warns(ConvergenceWarning) as caught:
        result = PathStraightening(max_iter=1).solve(case.metric, *case.points[:2])
    (warning,) = caught
    assert str(warning.message) == (
        "PathStraightening stopped without converging after 1 iteration: the maximum "
        "number of iterations was reached"
    )
    assert warning.filename == __file__
    assert (result.converged, result.n_iterations) == (False, 1)


def test_what_is_given_in_place_of_the_metric_is_refused():
    case = CASES["mixed open"]
    metric, points, space = case.metric, case.points, case.space
    calls = {
        "ndarray": lambda: solvers.LinearPath().solve(*points[:2], metric),
        "AlignedSurfaces": lambda: solvers.PathStraightening().solve(space, *points[:2]),
        "the class ElasticMetric": lambda: BasisMean().solve(ElasticMetric, points),
        "list": lambda: solvers.LinearPath().solve_many([points[:2]], metric),
        "int": lambda: solvers.DiscreteExponential().solve(3, *points[:2]),
        "float": lambda: solvers.DiscreteLogarithm().solve(0.5, *points[:2]),
        "tuple": lambda: GradientDescentMean().solve((), points),
        "str": lambda: solvers.PoleLadder().solve("metric", *points[:2], end_point=points[2]),
        "dict": lambda: solvers.NearestSurface().solve({}, *points[:2]),
        "set": lambda: solvers.Disentangling().solve(set(), set(), *points[:2]),
    }
    for found, call in calls.items():
        with pytest.raises(ArgumentTypeError, match=f"metric must be a metric, .*; found {found}$"):
            call()
    with pytest.raises(ArgumentTypeError, match="space must be a space of surfaces.*ElasticMetric"):
        solvers.ShapeTransfer().solve(metric, *points[:3])
    for estimator in (FrechetMean(metric, BasisMean), TangentPCA(metric, mean=BasisMean)):
        with pytest.raises(ArgumentTypeError, match="with a method solve.*the class BasisMean"):
            estimator.fit(points)


RESULTS = [
    PathResult(np.arange(6.0).reshape(3, 2), 0.5, np.array([2.0, 0.5]), n_iterations=1),
    MeanResult(np.ones(2), 0.25, np.array([0.25]), status=Status.MAX_ITER, message="out of time"),
    Minimum(np.zeros(2), 1.0, np.ones(3), status=Status.INTERRUPTED, n_evaluations=4),
    TransportResult(np.ones(2), np.ones((3, 2)), np.zeros((3, 2)), message="closed form"),
    solvers.ExponentialResult(np.ones((3, 2)), np.ones(2), 4, complete=False),
    solvers.LogarithmResult(np.ones(2), np.ones((3, 2)), 0.5, end_error=1e-9),
    solvers.DisentanglingResult(np.ones((4, 3)), np.zeros((4, 3)), 2.0, np.ones(2), 0.5, 0.25),
    solvers.PathDistances(np.ones((2, 2)), np.zeros((2, 2)), np.full((2, 2), np.nan)),
]


@pytest.mark.parametrize("result", RESULTS, ids=lambda result: type(result).__name__)
def test_results_are_kept_in_files(tmp_path, result):
    result.save(tmp_path / "result.npz")
    found = type(result).load(tmp_path / "result.npz")
    for field in dataclasses.fields(result):
        expected = getattr(result, field.name)
        assert type(getattr(found, field.name)) is type(expected)
        np.testing.assert_array_equal(getattr(found, field.name), expected)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("status", "perfect", "perfect"),
        ("result_class", "Path" * 50, r"must hold a PathResult; found a (Path){15}$"),
        ("status", 2, "2 is not a valid Status"),
    ],
)
def test_files_of_another_content_are_refused(tmp_path, name, value, message):
    path = tmp_path / "result.npz"
    PathResult(np.zeros((2, 2)), 0.0, np.zeros(1)).save(path)
    with pytest.raises(FileFormatError, match="must hold a MeanResult; found a PathResult"):
        MeanResult.load(path)
    save_arrays(path, load_arrays(path, []) | {name: np.array(value)})
    with pytest.raises(FileFormatError, match=message):
        PathResult.load(path)


def test_files_that_lack_a_field(tmp_path):
    path = tmp_path / "result.npz"
    PathResult(np.zeros((2, 2)), 0.5, np.zeros(1), lower_bound=0.25, gap=1.0).save(path)
    arrays = load_arrays(path, [])
    for left_out in ("lower_bound", "gap"):  # files of earlier releases
        del arrays[left_out]
    save_arrays(path, arrays)
    assert (PathResult.load(path).energy, PathResult.load(path).lower_bound) == (0.5, 0.0)
    del arrays["path"]
    save_arrays(path, arrays)
    with pytest.raises(FileFormatError, match=r"result.npz: lacks the fields path; found"):
        PathResult.load(path)


class Straight:
    """A user's solver, whose results have what the protocol asks for and no more."""

    def solve(self, metric, start, end):
        path = np.linspace(start, end, 5)
        return SimpleNamespace(path=path.tolist(), energy=metric.energy(path))


class Middle:
    """A user's mean solver."""

    def solve(self, metric, points, weights=None, initial_point=None, exponent=2):
        point = np.average(points, axis=0, weights=weights)
        return SimpleNamespace(point=point, variance=np.mean(metric.squared_dist(points, point)))


class Adding:
    """A user's exponential solver."""

    def solve(self, metric, tangent_vec, base_point):
        return SimpleNamespace(end=base_point + tangent_vec)


def test_bare_results_of_geodesic_solvers_suffice():
    case = CASES["mixed sphere"]
    start, end = case.points[:2]
    (row,) = solvers.compare_paths({"m": case.metric}, start, end, {"straight": (Straight(), "m")})
    assert row.result.converged
    assert row.result.n_iterations == row.as_row()["n_iterations"] == 0
    np.testing.assert_array_equal(row.result.energies, [row.result.energy])
    with pytest.warns(ConvergenceWarning, match="the exponential ends"):
        log = solvers.DiscreteLogarithm(geodesic_solver=Straight()).solve(case.metric, end, start)
    assert log.path.shape == (5, *case.space.shape)
    path = np.linspace(start, end, 5)
    metric = ElasticMetric(case.space, 1.0, 0.1, 0.1, geodesic_solver=Straight())
    np.testing.assert_allclose(metric.geodesic(start, end)(np.linspace(0, 1, 5)), path, atol=1e-15)


def test_bare_results_of_other_solvers_suffice():
    space = VectorSpace((2,))
    points = space.random_point(5, rng=1)
    mean = FrechetMean(space, Middle()).fit(points)
    assert isinstance(mean.result_, MeanResult)
    assert mean.n_iter_ == 0
    assert np.isfinite(GeometricMedian(space, Middle()).fit(points).estimate_).all()
    case = CASES["mixed sphere"]
    metric = ElasticMetric(case.space, 1.0, 0.1, 0.1, exp_solver=Adding())
    found = metric.exp(case.tangent_vecs, case.points)
    np.testing.assert_array_equal(found, case.points + case.tangent_vecs)


def test_notebooks_draw_surfaces_and_list_all_fields(monkeypatch):
    """Paths rather than velocities; points that are no surfaces are not drawn."""
    drawn = []
    pictures = SimpleNamespace(surfaces_html=lambda surfaces, *_: drawn.append(surfaces) or "<img>")
    monkeypatch.setattr("riemhuman.solvers.results.notebook_pictures", lambda: pictures)
    path, vectors = np.random.default_rng(0).normal(size=(2, 3, 150, 3))
    for result, expected in (
        (LogarithmResult(vectors[0], path, 1.0), path),
        (TransportResult(vectors[0], vectors, path), path),
        (PathResult(path, 1.0, np.ones(1)), path),
        (MeanResult(path[0], 1.0, np.ones(1)), path[:1]),
    ):
        html = result._repr_html_()
        np.testing.assert_array_equal(drawn.pop(), expected)
        assert all(f"<th>{field.name}</th>" in html for field in dataclasses.fields(result))
    assert "<img>" not in PathResult(np.zeros((4, 2, 3)), 1.0, np.ones(1))._repr_html_()
    assert "1 &lt; 2" in solvers.Result(message="1 < 2")._repr_html_()
