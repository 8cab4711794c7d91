"""Means of points read batch by batch are those of the points in memory."""

import bodies_in_motion as bodies
import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import BasisMean, StreamingMean, StreamingMedian, streaming_mean
from riemhuman.solvers.dispersion import Dispersion
from riemhuman.statistics import FrechetMean

POINTS = load_open_bodies("coarse").points[:20:2]
WEIGHTS = np.array([1.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0, 3.0, 1.0, 1.0])


class Reader:
    """Slices of points, and how many were read at once."""

    def __init__(self, points):
        self.points, self.largest = points, 0

    def __len__(self):
        return len(self.points)

    def __getitem__(self, some):
        found = self.points[some]
        self.largest = max(self.largest, len(found))
        return found


@pytest.mark.parametrize("lengths", [(1.0, 1.0, 0.1), (0.0, 0.0, 1.0)])
@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_the_mean_is_that_of_the_points_in_memory(lengths, weights):
    metric, basis = ElasticMetric(bodies.space(), *lengths), bodies.basis(20)
    reader = Reader(POINTS)
    streaming = StreamingMean(basis, with_differences=False, sample_size=3, batch_size=4)
    found = streaming.solve(metric, reader, weights)
    origin = found.point
    whole = BasisMean(basis, with_differences=False, tolerance=1e-9).solve(
        metric, POINTS, weights, initial_point=origin
    )
    assert found.converged
    assert reader.largest == 4
    assert found.variance == pytest.approx(Dispersion(metric, POINTS, weights).value(found.point))
    assert found.variance <= whole.variance * (1 + 2e-5)


def test_a_better_mean_than_that_of_the_sample():
    metric, basis = ElasticMetric(bodies.space(), 1.0, 1.0, 0.1), bodies.basis(20)
    sample = BasisMean(basis).solve(metric, POINTS[[0, 9]])
    found = StreamingMean(basis, sample_size=2, batch_size=3).solve(metric, POINTS)
    assert found.variance < 0.99 * Dispersion(metric, POINTS).value(sample.point)


@pytest.mark.parametrize(
    ("weights", "size", "chosen"),
    [(None, 4, [0, 3, 6, 9]), (None, 99, range(10)), (WEIGHTS, 3, [0, 3, 9])],
    ids=str,
)
def test_the_sample_is_evenly_spaced_among_points_that_have_a_weight(weights, size, chosen):
    sample = streaming_mean._Sample(Reader(POINTS), weights, size)
    np.testing.assert_array_equal(sample.points, POINTS[list(chosen)])
    np.testing.assert_array_equal(sample.weights, sample.all_weights[list(chosen)])


def test_arrays_mapped_from_files_serve(tmp_path):
    np.save(tmp_path / "bodies.npy", POINTS)
    mapped = np.load(tmp_path / "bodies.npy", mmap_mode="r")
    space = bodies.space()
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.1)
    solver = StreamingMean(sample_size=5, batch_size=4)
    mean = FrechetMean(space, solver=solver).fit(mapped)
    assert mean.variance_ == pytest.approx(solver.solve(space.metric, POINTS).variance)


@pytest.mark.parametrize("setting", ["sample_size", "batch_size"])
def test_settings_are_checked(setting):
    with pytest.raises(ArgumentError, match=setting):
        StreamingMean(**{setting: 0})


@pytest.mark.parametrize("solver", [StreamingMean, StreamingMedian])
@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda body: np.nan * body, ArgumentError, "NaN"),
        (lambda body: 1000.0 * body, ArgumentError, r"points\[2\].*millimetres"),
        (lambda body: 0.0 * body, DegenerateSurfaceError, r"item \(2,\)"),
    ],
)
def test_a_wrong_body_is_named_by_its_batch(solver, change, error, message):
    points = POINTS.copy()
    points[6] = change(points[6])
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.1)
    with pytest.raises(error, match=r"^points\[4:8\]: .*" + message):
        solver(sample_size=2, batch_size=4).solve(metric, points)


def test_no_points():
    with pytest.raises(ArgumentError, match="at least one point"):
        StreamingMean().solve(ElasticMetric(bodies.space()), POINTS[:0])
