"""An interrupt ends the whole call with KeyboardInterrupt, which carries the best so far."""

from dataclasses import replace

import numpy as np
import pytest

from riemhuman.geometry import FlatMetric, VectorSpace
from riemhuman.solvers import BasisMean, GradientDescentMean, Interrupted, Status
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
