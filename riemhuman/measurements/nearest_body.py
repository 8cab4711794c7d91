r"""The nearest body with given measurements.

Sequential quadratic programming minimises d²(f₀, f) over all vertices of f subject to m_k(f) = v_k:
with M the matrix of the metric at f, g the gradient of d² and J the derivatives of the
measurements, the step p solves 2 M p + Jᵀ μ = −g, J p = v − m(f).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array, real_number, whole_number
from riemhuman.errors import ArgumentError, ConvergenceWarning, warn
from riemhuman.measurements.measuring import Measurements, as_mapping
from riemhuman.solvers.spatial_factors import SparseCholeskyFactor

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
        Number of steps.
    message : str
        Why the search ended, and which measurements missed their values.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> own = rh.measurements.Measurements(bodies.model, ["waist girth"])
    >>> metric = rh.SobolevMetric(rh.AlignedSurfaces(bodies.template), a0=1.0, a2=0.01)
    >>> waist = float(own.measure(bodies[0])["waist girth"])
    >>> found = rh.measurements.nearest_body(own, metric, bodies[0], {"waist girth": waist + 0.02})
    >>> found.point.shape
    (1202, 3)
    """

    point: ndarray
    distance: float
    before: dict[str, float]
    after: dict[str, float]
    converged: bool
    n_iterations: int
    message: str

    @property
    def changes(self) -> dict[str, float]:
        """Changes of all measurements: after less before."""
        return {name: value - self.before[name] for name, value in self.after.items()}


def nearest_body(
    measurements: Measurements,
    metric: Any,
    point: Any,
    wanted: Mapping[str, float],
    *,
    tolerance: float = 1e-4,
    max_iter: int = 60,
) -> NearestBody:
    """Return the body nearest to a given one whose measurements have given values.

    All vertices are free, and the metric decides how they move. With a first-order metric, such as
    `rh.ElasticMetric`, the surface may get a crease along the tape; a second-order term, as in
    `rh.SobolevMetric`, makes the change smooth.

    Parameters
    ----------
    measurements : Measurements
        The measurements.
    metric : RiemannianMetric
        A metric on aligned surfaces with `energy_and_gradient` and `metric_matrix`.
    point : array_like, shape (V, 3)
        The given body, metres; it is measured as it stands.
    wanted : mapping of str to float
        Values of some of the measurements; the others are free.
    tolerance : float
        Largest relative error of the values. The search stops when they are met and no coordinate
        changes by this many metres.
    max_iter : int
        Largest number of steps.

    Returns
    -------
    NearestBody

    Raises
    ------
    ArgumentError
        If a name is unknown, the metric has no matrix, or a measurement is not defined.

    Warns
    -----
    ConvergenceWarning
        If the values are not met, or `max_iter` steps were not enough.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> own = rh.measurements.Measurements(bodies.model, ["waist girth", "hip girth"])
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SobolevMetric(space, a0=1.0, a2=0.01)
    >>> slimmer = own.measure(bodies[0])["waist girth"] - 0.05
    >>> result = rh.measurements.nearest_body(own, metric, bodies[0], {"waist girth": slimmer})
    >>> round(result.changes["waist girth"], 3)
    -0.05
    """
    real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    whole_number(max_iter, "max_iter", minimum=1)
    if not metric.has_metric_matrix:
        raise ArgumentError(f"metric must have a metric_matrix; found {metric!r}")
    measured_energy: Any = metric
    start = real_array(point, "point", measured_energy.space.shape, batched=False)
    goals = as_mapping(wanted, measurements.names)
    own = Measurements(measurements.definitions, list(goals))
    values = np.array(list(goals.values()))
    f = start.copy()
    found, slopes = _measured(own, f)
    energy, gradient = 0.0, np.zeros_like(f)
    n_steps, penalty = 0, 0.0
    while n_steps < max_iter:
        n_steps += 1
        factor = SparseCholeskyFactor(2.0 * metric.metric_matrix(f))
        rows = slopes.reshape(len(values), -1)
        solved = factor.inverse(np.concatenate([rows, gradient.reshape(1, -1)]).T)
        by_rows, by_gradient = solved[:, :-1], solved[:, -1]
        gram = rows @ by_rows
        multipliers = -np.linalg.solve(gram, values - found + rows @ by_gradient)
        # The second step only meets the values; it helps at a kink of a hull.
        steps = [
            -(by_gradient + by_rows @ multipliers),
            by_rows @ np.linalg.solve(gram, values - found),
        ]
        penalty = max(penalty, 2.0 * float(np.abs(multipliers).max()))
        merit = energy + penalty * np.abs(found - values).sum()
        for step, halvings in product(steps, range(_MOST_HALVINGS)):
            moved = f + 0.5**halvings * step.reshape(f.shape)
            trial, trial_slopes = _measured(own, moved)
            trial_energy, both = measured_energy.energy_and_gradient(np.stack([start, moved]))
            if trial_energy + penalty * np.abs(trial - values).sum() < merit:
                break
        else:
            break
        f, found, slopes = moved, trial, trial_slopes
        energy, gradient = float(trial_energy), both[1]
        if _met(found, values, tolerance).all() and np.abs(step).max() < tolerance:
            break
    is_met = _met(found, values, tolerance)
    converged = bool(is_met.all()) and n_steps < max_iter
    message = f"stopped after {n_steps} steps" if n_steps == max_iter else "no step gains more"
    message += "; the values are met" if is_met.all() else ""
    if not converged:
        missed = [name for name, is_one in zip(goals, is_met, strict=True) if not is_one]
        message += f"; not met: {', '.join(missed)}" if missed else ""
        warn(message, ConvergenceWarning)
    both_measured = measurements.measure(np.stack([start, f]), missing="nan")
    before, after = (
        dict(zip(both_measured.names, row.tolist(), strict=True)) for row in both_measured.values
    )
    distance = float(np.sqrt(max(energy, 0.0)))
    return NearestBody(f, distance, before, after, converged, n_steps, message)


def _measured(own: Measurements, f: ndarray) -> tuple[ndarray, ndarray]:
    measured = own.measure(f, gradient=True)
    assert measured.gradient is not None
    return measured.values, measured.gradient


def _met(found: ndarray, values: ndarray, tolerance: float) -> ndarray:
    return np.abs(found - values) <= tolerance * np.abs(values)
