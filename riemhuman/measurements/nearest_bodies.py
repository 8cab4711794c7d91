r"""The nearest body with given measurements.

The nearest body minimises d²(f₀, f) over all vertices of f subject to m_k(f) = v_k, by sequential
quadratic programming: with M the matrix of the metric at f, g the gradient of d² and J the
derivatives of the measurements, the step p solves 2 M p + Jᵀ μ = −g, J p = v − m(f).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from riemhuman.arrays import Array, Booleans
from riemhuman.checks import real_array, real_number, whole_number
from riemhuman.errors import ArgumentError, ConvergenceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.measurements.measuring import Measurements, as_mapping
from riemhuman.memory import enough_memory
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


@enough_memory("the nearest body with these measurements", "take coarser bodies")
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
        Values of some of the measurements; the others are free.
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
    real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    whole_number(max_iter, "max_iter", minimum=1)
    if not metric.has_metric_matrix:
        raise ArgumentError(f"metric must have a metric_matrix; found {metric!r}")
    start = real_array(point, "point", metric.space.shape, batched=False)
    goals = as_mapping(wanted, measurements.names)
    wanted_measurements = Measurements(measurements.definitions, list(goals))
    targets = np.array(list(goals.values()))
    f = start.copy()
    values, slopes = _measured(wanted_measurements, f)
    energy, gradient = 0.0, np.zeros_like(f)
    n_steps, penalty = 0, 0.0
    while n_steps < max_iter:
        n_steps += 1
        hessian = 2.0 * metric.metric_matrix(f)
        steps, multipliers = _newton_steps(hessian, gradient, slopes, targets - values)
        penalty = max(penalty, 2.0 * float(np.abs(multipliers).max()))
        merit = energy + penalty * np.abs(values - targets).sum()
        for step, halvings in product(steps, range(_MOST_HALVINGS)):
            moved = f + 0.5**halvings * step.reshape(f.shape)
            try:
                trial, trial_slopes = _measured(wanted_measurements, moved)
            except ArgumentError:  # the step is too long: no body can be measured there
                continue
            trial_energy, both = metric.energy_and_gradient(np.stack([start, moved]))
            if trial_energy + penalty * np.abs(trial - targets).sum() < merit:
                break
        else:
            break
        f, values, slopes = moved, trial, trial_slopes
        energy, gradient = float(trial_energy), both[1]
        if _met(values, targets, tolerance).all() and np.abs(step).max() < tolerance:
            break
    is_met = _met(values, targets, tolerance)
    converged = bool(is_met.all()) and n_steps < max_iter
    message = (
        f"stopped after {n_steps} steps" if n_steps == max_iter else "no step improves the result"
    )
    message += "; the values are reached" if is_met.all() else ""
    if not converged:
        missed = [name for name, met in zip(goals, is_met, strict=True) if not met]
        message += f"; not reached: {', '.join(missed)}" if missed else ""
        warn(message, ConvergenceWarning)
    both_measured = measurements.measure(np.stack([start, f]), missing="nan")
    before, after = (
        dict(zip(both_measured.names, row.tolist(), strict=True)) for row in both_measured.values
    )
    distance = float(np.sqrt(max(energy, 0.0)))
    return NearestBody(f, distance, before, after, converged, n_steps, message)


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


def _measured(measurements: Measurements, f: Array) -> tuple[Array, Array]:
    measured = measurements.measure(f, gradient=True)
    assert measured.gradient is not None
    return measured.values, measured.gradient


def _met(values: Array, targets: Array, tolerance: float) -> Booleans:
    return np.abs(values - targets) <= tolerance * np.abs(targets)
