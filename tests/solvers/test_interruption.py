"""An interrupt ends the whole call with KeyboardInterrupt, which carries the best so far."""

import threading
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import count

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.geometry import AlignedSurfaces, ElasticMetric, FlatMetric, VectorSpace
from riemhuman.kernels.threads import check_interrupt, mapped
from riemhuman.solvers import (
    BasisMean,
    BasisPath,
    DiscreteExponential,
    DiscreteLogarithm,
    Disentangling,
    GeodesicRegression,
    GradientDescentMean,
    Interrupted,
    LinearPath,
    ModelParameters,
    ModelPath,
    NearestSurface,
    PathStraightening,
    PoissonPath,
    PoleLadder,
    SegmentEnergy,
    Status,
    TangentPCA,
)
from riemhuman.solvers._lbfgs import Descent


class InterruptedVectors(FlatMetric):
    """Vectors, with an interrupt in one of the calls of a method."""

    def __init__(self, name, number):
        super().__init__(VectorSpace((2,)))
        method, calls = getattr(self, name), iter(range(1, 10**6))

        def interrupted(*arguments, **options):
            if next(calls) == number:
                raise KeyboardInterrupt
            return method(*arguments, **options)

        setattr(self, name, interrupted)


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [5.0, 5.0]])


@pytest.mark.parametrize("number", [1, 2, 4, 6])
def test_a_descent_ends_with_the_best_so_far(number):
    metric = InterruptedVectors("log", number)
    with pytest.raises(Interrupted) as caught:
        GradientDescentMean().solve(metric, SQUARE, exponent=1)
    result = caught.value.result
    assert result.status is Status.INTERRUPTED
    assert result.variance == pytest.approx(np.mean(metric.squared_dist(result.point, SQUARE)))


def test_no_search_of_a_median_in_batches_swallows_an_interrupt():
    """Each of its searches, from a mean of a sample to a median of all, ends all of them."""
    interrupts, metric = 0, VectorSpace((2,)).metric
    minimize = Descent.minimize
    for number in range(1, 4):
        calls = iter(range(1, 10))

        def interrupted(minimizer, *arguments, number=number, calls=calls, **options):
            minimum = minimize(minimizer, *arguments, **options)
            return replace(minimum, status=Status.INTERRUPTED) if next(calls) == number else minimum

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(Descent, "minimize", interrupted)
            try:
                BasisMean().solve(metric, [SQUARE[:2], SQUARE[2:]], exponent=1)
            except Interrupted:
                interrupts += 1
    assert interrupts == 3


# On surfaces: an interrupt in any evaluation of the metric.

EVALUATIONS = (
    *("energy", "energy_and_gradient", "squared_dist", "squared_dists_and_gradient"),
    *("metric_matrix", "dist_pairwise", "features", "map"),
)


@contextmanager
def interrupt_at(number):
    """Raise a KeyboardInterrupt in an evaluation of elastic metrics, the first of which is 1."""
    numbers = count(1)
    with pytest.MonkeyPatch.context() as patch:
        for name in EVALUATIONS:
            method = getattr(ElasticMetric, name)

            def evaluated(metric, *arguments, method=method, **options):
                if next(numbers) == number:
                    raise KeyboardInterrupt
                return method(metric, *arguments, **options)

            patch.setattr(ElasticMetric, name, evaluated)
        yield numbers


def elastic(a, lam, c):
    space = AlignedSurfaces(sphere_template(), equip=False)
    return space.equip_with_metric(ElasticMetric, a=a, lam=lam, c=c).metric


SURFACES = surfaces(sphere_template(), 5, rng=3, size=0.05)
IMAGES = elastic(1.0, 1.0, 1.0).map(SURFACES[1:2])
LIMBS = (bodies.body("resting"), bodies.body("arm raised"))


def path_of_bodies():
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.0)
    solver = BasisPath(bodies.basis(5), 4)
    return solver.solve(metric, *bodies.swung_arms(1))


def path_from_path():
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.1)
    solver = BasisPath(bodies.basis(5), 4, initial=BasisPath(bodies.basis(3), 4))
    return solver.solve(metric, *LIMBS)


def path_of_poisson():
    return PoissonPath(4).solve(ElasticMetric(bodies.space(), 1.0, 1.0, 0.1), *LIMBS)


def path_of_model():
    parameters = ModelParameters(np.zeros(1), np.zeros((1, 3)), np.zeros(3))

    def posed(*given):
        return np.stack([LIMBS[0], LIMBS[0], LIMBS[1], LIMBS[1]])

    solver = ModelPath(posed, 4, parameters=lambda surface: parameters)
    return solver.solve(ElasticMetric(bodies.space(), 1.0, 1.0, 0.1), *LIMBS)


SOLVED = {
    "path": lambda: PathStraightening(4).solve(elastic(1.0, 1.0, 0.1), *SURFACES[:2]),
    "path of bodies": path_of_bodies,
    "path from a path": path_from_path,
    "path of Poisson's equation": path_of_poisson,
    "path of a model": path_of_model,
    "mean": lambda: BasisMean().solve(elastic(1.0, 1.0, 0.1), SURFACES),
    "median": lambda: BasisMean().solve(elastic(1.0, 1.0, 0.0), SURFACES, exponent=1),
    "means of batches": lambda: BasisMean().solve(elastic(1, 1, 0), [SURFACES[:2], SURFACES[2:]]),
    "logarithm": lambda: DiscreteLogarithm(None, 3).solve(elastic(1.0, 1.0, 1.0), *SURFACES[:2]),
    "exponential": lambda: DiscreteExponential(None, 3).solve(
        elastic(1.0, 1.0, 1.0), SURFACES[1] - SURFACES[0], SURFACES[0]
    ),
    "transport": lambda: PoleLadder(geodesic_solver=PathStraightening(4)).solve(
        elastic(1.0, 1.0, 1.0), SURFACES[2] - SURFACES[0], SURFACES[0], end_point=SURFACES[1]
    ),
    "disentangling": lambda: Disentangling().solve(
        elastic(1.0, 1.0, 0.0), elastic(0.0, 0.0, 1.0), *SURFACES[:2]
    ),
    "components": lambda: TangentPCA(elastic(1.0, 1.0, 1.0).space, 2).fit(SURFACES),
    "regression": lambda: GeodesicRegression(elastic(1.0, 1.0, 1.0).space).fit(
        np.arange(5.0), SURFACES
    ),
    "nearest surface": lambda: NearestSurface().solve(elastic(1.0, 1.0, 1.0), IMAGES, SURFACES[0]),
}


@pytest.mark.parametrize("name", SOLVED)
def test_an_interrupt_at_any_time_keeps_the_best(name):
    """From the first evaluation on; at worst the straight path, or a point as it was given."""
    solve = SOLVED[name]
    with interrupt_at(0) as numbers:
        solve()
    n_evaluations = next(numbers) - 1
    assert n_evaluations > 0
    numbers = {1, 2, 3, n_evaluations, *np.geomspace(1, n_evaluations, 8).astype(int)}
    for number in sorted(numbers & set(range(1, n_evaluations + 1))):
        with interrupt_at(number), pytest.raises(Interrupted) as caught:
            solve()
        result = caught.value.result
        assert result.status is Status.INTERRUPTED
        check_result(name, result)


def check_result(name, result):
    if name.startswith("path"):
        assert np.all(np.isfinite(result.path))
        assert len(result.path) == 4
        assert result.energies[-1] == pytest.approx(result.energy)
        space = bodies.space() if len(result.path[0]) > 1000 else elastic(1.0, 1.0, 0.1).space
        c = 0.0 if name == "path of bodies" else 0.1
        metric = ElasticMetric(space, 1.0, 1.0, c)
        assert metric.energy(result.path) == pytest.approx(result.energy)
        straight = LinearPath(4).solve(metric, result.path[0], result.path[-1])
        assert result.energy <= straight.energy * (1 + 1e-9)
        return
    solution = {
        "logarithm": "tangent_vec",
        "transport": "tangent_vec",
        "exponential": "path",
        "disentangling": "surface",
    }.get(name, "point")
    assert np.all(np.isfinite(getattr(result, solution)))


@dataclass(frozen=True)
class WatchedEnergy(SegmentEnergy):
    """The energy, whose values are noted until the user presses Ctrl-C at one of them."""

    last: int = 0
    values: list[float] = field(default_factory=list)

    def value_and_gradient(self, metric, path):
        if len(self.values) + 1 == self.last:
            raise KeyboardInterrupt
        value, gradient = super().value_and_gradient(metric, path)
        self.values.append(value)
        return value, gradient


def test_finished_starts_are_kept():
    """An arm may turn either way: the result is that of the best start so far, not of the last.

    That a start has converged, as far as the comparison goes, is not the end.
    """
    metric, ends = ElasticMetric(bodies.space(), 0.0, 0.0, 1.0), bodies.swung_arms(7)
    watched = WatchedEnergy()
    BasisPath(bodies.basis(5), 11, energy=watched).solve(metric, *ends)
    values = watched.values
    second = int(np.argmax(np.diff(values))) + 1
    assert 0 < second < len(values) - 1
    for last in range(second + 1, len(values)):
        solver = BasisPath(bodies.basis(5), 11, energy=WatchedEnergy(last))
        with pytest.raises(Interrupted) as caught:
            solver.solve(metric, *ends)
        result = caught.value.result
        assert result.status is Status.INTERRUPTED
        assert result.energy == pytest.approx(min(values[:second]), rel=1e-12)
        assert result.n_iterations == len(result.energies) - 1
        assert result.energies[-1] == pytest.approx(result.energy)
        assert metric.energy(result.path) == pytest.approx(result.energy, rel=1e-10)


def test_threads_end_with_the_main_one():
    """Tasks that run for long stop at their next check."""
    started, ended = threading.Event(), threading.Event()

    def task(number):
        if number == 0:
            started.wait(300)
            raise KeyboardInterrupt
        started.set()
        try:
            while True:
                check_interrupt()
        except KeyboardInterrupt:
            ended.set()
            raise

    with pytest.raises(KeyboardInterrupt):
        list(mapped(task, range(2), 2))
    assert ended.is_set()
