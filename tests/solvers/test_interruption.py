"""An interrupt ends a long search with a KeyboardInterrupt that carries the best so far."""

import threading
from dataclasses import dataclass, field, replace

import bodies_in_motion as bodies
import numpy as np
import pytest

from riemhuman.geometry import ElasticMetric, VectorSpace
from riemhuman.kernels.threads import check_interrupt, mapped
from riemhuman.solvers import (
    BasisMean,
    BasisPath,
    Interrupted,
    SegmentEnergy,
    Status,
)
from riemhuman.solvers._lbfgs import Descent

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [5.0, 5.0]])


@dataclass(frozen=True)
class WatchedEnergy(SegmentEnergy):
    """The energy, whose values are noted until the user presses Ctrl-C at one of them."""

    last: int = 0
    values: list[float] = field(default_factory=list)
    interrupts: list[int] = field(default_factory=list)

    def value_and_gradient(self, metric, path):
        if len(self.values) + 1 == self.last and not self.interrupts:
            self.interrupts.append(self.last)
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
    for last in {max(2, second // 2), second + 1, len(values) - 1}:
        solver = BasisPath(bodies.basis(5), 11, energy=WatchedEnergy(last))
        with pytest.raises(Interrupted) as caught:
            solver.solve(metric, *ends)
        result = caught.value.result
        assert result.status is Status.INTERRUPTED
        known = values[: min(second, last - 1)]
        assert result.energy == pytest.approx(min(known), rel=1e-12)
        assert metric.energy(result.path) == pytest.approx(result.energy, rel=1e-10)


def test_no_search_of_a_median_in_batches_swallows_an_interrupt(monkeypatch):
    """Each of its searches, from a mean of a sample to a median of all, ends all of them."""
    metric, minimize = VectorSpace((2,)).metric, Descent.minimize
    for number in range(1, 4):
        calls = iter(range(1, 10))

        def interrupted(minimizer, *, number=number, calls=calls):
            minimum = minimize(minimizer)
            return replace(minimum, status=Status.INTERRUPTED) if next(calls) == number else minimum

        monkeypatch.setattr(Descent, "minimize", interrupted)
        with pytest.raises(Interrupted):
            BasisMean().solve(metric, [SQUARE[:2], SQUARE[2:]], exponent=1)


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
