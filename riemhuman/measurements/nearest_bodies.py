r"""The nearest body with given measurements.

The nearest body minimises d²(f₀, f) over all vertices of f subject to m_k(f) = v_k, by sequential
quadratic programming: with M the matrix of the metric at f, g the gradient of d² and J the
derivatives of the measurements, the step p solves 2 M p + Jᵀ μ = −g, J p = v − m(f).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from riemhuman.arrays import Array, Booleans
from riemhuman.checks import checked, instance, positive, real_array, whole
from riemhuman.errors import ArgumentError, ConvergenceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.measurements.adults import check_values
from riemhuman.measurements.measuring import Measurements, as_mapping
from riemhuman.solvers._preconditioners import SparseCholeskyFactor

_MOST_HALVINGS = 12


@dataclass(frozen=True, eq=False)
class NearestBody:
    """The nearest body with given measurements.

    Attributes
    ----------
    point : array, shape (V, 3)
        The body, metres.
    distance : float
        Its distance from the given body.
    before, after : dict of str to float
        Measurements of the given body and of this one.
    converged : bool
        Whether the measurements have the given values and the search converged.
    n_iterations : int
    message : str
        Why the search ended, and which measurements did not reach their values.

    Examples
    --------
    See `nearest_body`.
    """

    point: Array
    distance: float
    before: dict[str, float]
    after: dict[str, float]
    converged: bool
    n_iterations: int
    message: str

    @property
    def changes(self) -> dict[str, float]:
        """Changes of all measurements: after minus before."""
        return {name: value - self.before[name] for name, value in self.after.items()}


@checked(
    measurements=instance(Measurements),
    metric=instance(RiemannianMetric, "a metric, such as ElasticMetric(space)"),
    tolerance=positive,
    max_iter=whole(minimum=1),
)
def nearest_body(
    measurements: Measurements,
    metric: RiemannianMetric,
    point: ArrayLike,
    wanted: Mapping[str, float],
    *,
    tolerance: float = 1e-4,
    max_iter: int = 60,
) -> NearestBody:
    """Return the body nearest to a given one whose measurements have given values.

    All vertices are free, and the metric decides how they move. With a first-order metric, such as
    `rh.ElasticMetric`, the surface may get a crease along the measurement line; a second-order
    term, as in `rh.SobolevMetric`, makes the change smooth.

    Parameters
    ----------
    measurements : Measurements
        The measurements.
    metric : RiemannianMetric
        A metric on aligned surfaces with `energy_and_gradient` and `metric_matrix`.
    point : array_like, shape (V, 3)
        The given body, metres; it is measured in its own pose.
    wanted : mapping of str to float
        Values of some of the measurements; the others are free. Values that nobody has raise an
        error that suggests another unit.
    tolerance : float
        Largest relative error of the values. The search stops when the values are reached and no
        coordinate changes by more than this many metres.
    max_iter : int
        Largest number of steps; a warning says if they were not enough.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> girths = rh.measurements.Measurements(bodies.model, ["waist girth", "hip girth"])
    >>> metric = rh.SobolevMetric(rh.AlignedSurfaces(bodies.template), a0=1.0, a2=0.01)
    >>> result = rh.measurements.nearest_body(girths, metric, bodies[0], {"waist girth": 0.7})
    >>> round(result.after["waist girth"], 3)
    0.7
    """
    if not metric.has_metric_matrix:
        raise ArgumentError(f"metric must have a metric_matrix; found {metric!r}")
    start = real_array(point, "point", metric.space.shape, batched=False)
    goals = as_mapping(wanted, measurements.names)
    check_values(goals)
    wanted_measurements = Measurements(measurements.definitions, list(goals))
    targets = np.array(list(goals.values()))
    problem = _Problem(wanted_measurements, metric, start, targets)
    body, n_steps, ending = _search(problem, tolerance, max_iter)
    is_met = _met(body.values, targets, tolerance)
    converged = bool(is_met.all()) and ending is not _Ending.MAX_STEPS
    if is_met.all():
        message = f"{ending.value}; the values are reached"
    else:
        missed = [name for name, met in zip(goals, is_met, strict=True) if not met]
        message = f"{ending.value}; not reached: {', '.join(missed)}"
    if not converged:
        warn(message, ConvergenceWarning)
    both = measurements.measure(np.stack([start, body.point]), missing="nan")
    before, after = (dict(zip(both.names, row.tolist(), strict=True)) for row in both.values)
    distance = float(np.sqrt(max(body.energy, 0.0)))
    return NearestBody(body.point, distance, before, after, converged, n_steps, message)


class _Ending(Enum):
    """Why a search ended."""

    SMALL_STEP = "the last step was smaller than the tolerance"
    NO_STEP = "no step improves the result"
    MAX_STEPS = "stopped after the largest number of steps"


@dataclass(frozen=True, eq=False)
class _Problem:
    """A body, the metric, and the measurements that a near body should have."""

    measurements: Measurements
    metric: RiemannianMetric
    start: Array
    targets: Array

    def at(self, point: Array) -> _Body:
        """Return the values and the energy of a body, and their derivatives."""
        measured = self.measurements.measure(point, gradient=True)
        assert measured.gradient is not None
        energy, slopes = self.metric.energy_and_gradient(np.stack([self.start, point]))
        return _Body(point, measured.values, measured.gradient, float(energy), slopes[1])

    def merit(self, body: _Body, penalty: float) -> float:
        return body.energy + penalty * float(np.abs(body.values - self.targets).sum())


@dataclass(frozen=True, eq=False)
class _Body:
    """A body on the way, its values and squared distance, and the derivatives of both."""

    point: Array
    values: Array
    slopes: Array
    energy: float
    gradient: Array


def _search(problem: _Problem, tolerance: float, max_iter: int) -> tuple[_Body, int, _Ending]:
    """Return the last body, the number of steps, and why the search ended."""
    body = problem.at(problem.start)
    penalty = 0.0
    for n_steps in range(1, max_iter + 1):
        hessian = 2.0 * problem.metric.metric_matrix(body.point)
        steps, multipliers = _newton_steps(
            hessian, body.gradient, body.slopes, problem.targets - body.values
        )
        penalty = max(penalty, 2.0 * float(np.abs(multipliers).max()))
        better = _better_body(problem, body, steps, penalty)
        if better is None:
            return body, n_steps, _Ending.NO_STEP
        body, step = better
        if _met(body.values, problem.targets, tolerance).all() and np.abs(step).max() < tolerance:
            return body, n_steps, _Ending.SMALL_STEP
    return body, max_iter, _Ending.MAX_STEPS


def _better_body(
    problem: _Problem, body: _Body, steps: list[Array], penalty: float
) -> tuple[_Body, Array] | None:
    """Return the first better body along some steps, whole or halved, and its whole step."""
    merit = problem.merit(body, penalty)
    for step, halvings in product(steps, range(_MOST_HALVINGS)):
        try:
            trial = problem.at(body.point + 0.5**halvings * step.reshape(body.point.shape))
        except ArgumentError:  # the step is too long: no body can be measured there
            continue
        if problem.merit(trial, penalty) < merit:
            return trial, step
    return None


def _newton_steps(
    hessian: sparse.csr_array, gradient: Array, slopes: Array, missing: Array
) -> tuple[list[Array], Array]:
    """Return two steps that bring the missing change of values, and Lagrange's multipliers.

    The first also lowers the energy; the second only meets the values, which helps at a kink of a
    hull.
    """
    rows = slopes.reshape(len(missing), -1)
    solved: Array = SparseCholeskyFactor(hessian).inverse(
        np.concatenate([rows, gradient.reshape(1, -1)]).T
    )
    by_rows, by_gradient = solved[:, :-1], solved[:, -1]
    gram = rows @ by_rows
    multipliers = -np.linalg.solve(gram, missing + rows @ by_gradient)
    lowering = -(by_gradient + by_rows @ multipliers)
    return [lowering, by_rows @ np.linalg.solve(gram, missing)], np.asarray(multipliers, np.float64)


def _met(values: Array, targets: Array, tolerance: float) -> Booleans:
    return np.abs(values - targets) <= tolerance * np.abs(targets)
