r"""Bodies with given measurements: the most probable adult, and the body nearest to a given one.

In a fixed pose the vertices of a body model are affine in the shape coefficients, x(β) = x₀ + Bβ.
With β normal with mean μ and covariance Σ, the most probable body minimises

.. math:: (\beta - \mu)^\top \Sigma^{-1} (\beta - \mu) + \sum_k ((m_k(x(\beta)) - v_k)/\sigma_k)^2,

by Gauss–Newton steps with the derivatives of the measurements m_k.

The nearest body minimises d²(f₀, f) over all vertices of f subject to m_k(f) = v_k, by sequential
quadratic programming: with M the matrix of the metric at f, g the gradient of d² and J the
derivatives of the measurements, the step p solves 2 M p + Jᵀ μ = −g, J p = v − m(f).
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_array, real_number, whole_number
from riemhuman.errors import ArgumentError, ConvergenceWarning, warn
from riemhuman.measurements.measurement_set import DATA, open_measurements
from riemhuman.measurements.measuring import Measurements, as_mapping
from riemhuman.solvers._preconditioners import SparseCholeskyFactor

_SEXES = ("woman", "man", "adult")
# Least relative uncertainty of a value when it is compared with the others.
_LEAST_UNCERTAINTY = 0.01
# A value contradicts the others if it is this many standard deviations from their prediction.
_CONTRADICTION = 4.0
# The search ends when no shape coefficient changes by more than this.
_LEAST_STEP = 1e-6
# Default standard deviations of values: metres, and shares of areas, volumes and masses.
_LENGTH_TOLERANCE, _SHARE_TOLERANCE = 3e-4, 1e-3
_MOST_HALVINGS = 12


@dataclass(frozen=True, eq=False)
class MeasuredPerson:
    """A body found from measurements.

    Attributes
    ----------
    points : array, shape (V, 3)
        The body in the standard pose, metres.
    betas : array, shape (B,)
        Shape coefficients of the body.
    values : dict of str to float
        The requested measurements, as the body has them.
    misses : dict of str to float
        These less the requested values.
    z_scores : dict of str to float
        Each requested value less its prediction from the others, in standard deviations.
    contradictory : tuple of str
        Names of values more than four standard deviations from their prediction, the worst first.
    improbability : float
        Mahalanobis distance of the body from the mean person of the chosen sex.
    converged : bool
        Whether the search converged.
    message : str
        Which values contradict the others, and whether the search converged.

    Examples
    --------
    >>> import riemhuman as rh
    >>> person = rh.measurements.model_from_measurements({"stature": 1.70}, resolution="coarse")
    >>> person.points.shape
    (1202, 3)
    """

    points: ndarray
    betas: ndarray
    values: dict[str, float]
    misses: dict[str, float]
    z_scores: dict[str, float]
    contradictory: tuple[str, ...]
    improbability: float
    converged: bool
    message: str


def model_from_measurements(
    values: Mapping[str, float],
    sex: str = "adult",
    *,
    tolerances: Mapping[str, float] | None = None,
    resolution: str = "full",
    max_iter: int = 100,
) -> MeasuredPerson:
    """Return the most probable body of the open model with these measurements.

    Parameters
    ----------
    values : mapping of str to float
        Measurements of the open body by name, in metres, square metres, cubic metres or kilograms.
    sex : {"adult", "woman", "man"}
        Population among which the body is the most probable.
    tolerances : mapping of str to float, optional
        Standard deviations σ of the values, in their units; by default 0.3 mm for lengths, and a
        thousandth of the value for areas, volumes and masses.
    resolution : {"full", "coarse"}
        Resolution of the model.
    max_iter : int
        Largest number of steps.

    Returns
    -------
    MeasuredPerson
        Its `contradictory` and `message` name values that contradict the others.

    Raises
    ------
    ArgumentError
        If a name is unknown, or a value or tolerance is not positive.

    Examples
    --------
    >>> import riemhuman as rh
    >>> wanted = {"stature": 1.70, "waist girth": 0.80, "hip girth": 1.00}
    >>> person = rh.measurements.model_from_measurements(wanted, sex="woman", resolution="coarse")
    >>> round(person.values["waist girth"], 3)
    0.8
    """
    one_of(sex, "sex", _SEXES)
    one_of(resolution, "resolution", ("full", "coarse"))
    whole_number(max_iter, "max_iter", minimum=1)
    description = open_measurements(resolution)
    assert description is not None, "the open model has measurements"
    wanted = as_mapping(values, description.names)
    for name, value in wanted.items():
        real_number(value, name, minimum=0.0, strict=True)
    own = Measurements(description, list(wanted))
    spread = {
        name: _LENGTH_TOLERANCE if unit == "m" else _SHARE_TOLERANCE * wanted[name]
        for name, unit in zip(own.names, own.units, strict=True)
    }
    for name, tolerance in as_mapping(tolerances, own.names).items() if tolerances else ():
        spread[name] = real_number(tolerance, f"tolerance of {name}", minimum=0.0, strict=True)
    return _Search(own, _adults()[sex], wanted, spread).solve(max_iter)


@lru_cache(maxsize=1)
def _adults() -> dict[str, tuple[ndarray, ndarray]]:
    """Return mean and covariance of the shape coefficients among women, men and both."""
    record = json.loads((DATA / "adults.json").read_text(encoding="utf-8"))
    return {
        sex: (np.array(entry["mean"]), np.array(entry["covariance"]))
        for sex, entry in record.items()
    }


class _Search:
    """The search for the most probable body."""

    def __init__(
        self,
        own: Measurements,
        adults: tuple[ndarray, ndarray],
        wanted: Mapping[str, float],
        spread: Mapping[str, float],
    ) -> None:
        model = own.definitions.model
        assert model is not None
        self._own, self._names = own, list(wanted)
        self._wanted = np.array([wanted[name] for name in self._names])
        self._spread = np.array([spread[name] for name in self._names])
        self._mean, self._covariance = adults
        pose = own.definitions.standard_pose_vector
        bodies = model(np.concatenate([np.zeros((1, model.n_betas)), np.eye(model.n_betas)]), pose)
        self._rest, self._directions = bodies[0], bodies[1:] - bodies[0]
        self._precision = np.linalg.inv(self._covariance)

    def solve(self, max_iter: int) -> MeasuredPerson:
        betas, converged = self._mean, False
        values, slopes = self._measured(betas)
        cost, damping = self._cost(betas, values), 1e-3
        for _ in range(max_iter):
            scaled = slopes / self._spread[:, np.newaxis]
            matrix = scaled.T @ scaled + self._precision
            right = scaled.T @ ((self._wanted - values) / self._spread)
            right -= self._precision @ (betas - self._mean)
            while True:
                damped = matrix + damping * np.diag(np.diag(matrix))
                step = np.linalg.solve(damped, right)
                if np.abs(step).max() < _LEAST_STEP:
                    converged = True
                    break
                trial, trial_slopes = self._measured(betas + step)
                trial_cost = self._cost(betas + step, trial)
                if trial_cost < cost:
                    betas, values, slopes, cost = betas + step, trial, trial_slopes, trial_cost
                    damping = max(damping / 10.0, 1e-9)
                    break
                damping *= 10.0
            if converged:
                break
        return self._person(betas, values, slopes, converged)

    def _body(self, betas: ndarray) -> ndarray:
        return self._rest + np.tensordot(betas, self._directions, axes=1)

    def _measured(self, betas: ndarray) -> tuple[ndarray, ndarray]:
        """Return values and their derivatives by the betas; NaN where a measurement fails."""
        measured = self._own.measure(self._body(betas), axes="space", gradient=True, missing="nan")
        assert measured.gradient is not None
        return measured.values, np.einsum("mvx,bvx->mb", measured.gradient, self._directions)

    def _cost(self, betas: ndarray, values: ndarray) -> float:
        deviation = betas - self._mean
        misses = (values - self._wanted) / self._spread
        cost = deviation @ self._precision @ deviation + np.sum(misses**2)
        return float(cost) if np.isfinite(cost) else np.inf

    def _person(
        self, betas: ndarray, values: ndarray, slopes: ndarray, converged: bool
    ) -> MeasuredPerson:
        deviation = betas - self._mean
        improbability = float(np.sqrt(deviation @ self._precision @ deviation))
        scores = self._scores(betas, values, slopes)
        order = np.argsort(-np.abs(scores))
        contradictory = tuple(self._names[k] for k in order if abs(scores[k]) > _CONTRADICTION)
        remarks = [] if converged else ["the search did not converge"]
        if contradictory:
            worst = order[0]
            agreeing = self._wanted[worst] - self._gaps[worst]
            remarks.append(
                f"{contradictory[0]} of {self._wanted[worst]:.4g} contradicts the other values "
                f"most; about {agreeing:.4g} would agree with them"
            )
        if len(contradictory) > 1:
            remarks.append(f"so do {', '.join(contradictory[1:])}")
        return MeasuredPerson(
            points=self._body(betas),
            betas=betas,
            values=dict(zip(self._names, values.tolist(), strict=True)),
            misses=dict(zip(self._names, (values - self._wanted).tolist(), strict=True)),
            z_scores=dict(zip(self._names, scores.tolist(), strict=True)),
            contradictory=contradictory,
            improbability=improbability,
            converged=converged,
            message="; ".join(remarks) or "the values agree with each other",
        )

    def _scores(self, betas: ndarray, values: ndarray, slopes: ndarray) -> ndarray:
        """Compare each value with its prediction from the others, to first order.

        If values y are normal with mean 0 and covariance C, then y_k less its mean given the others
        is (C⁻¹y)_k/(C⁻¹)_kk, with variance 1/(C⁻¹)_kk.
        """
        noise = np.maximum(self._spread, _LEAST_UNCERTAINTY * self._wanted)
        covariance = slopes @ self._covariance @ slopes.T + np.diag(noise**2)
        precision = np.linalg.inv(covariance)
        expected = values + slopes @ (self._mean - betas)
        pull = precision @ (self._wanted - expected)
        self._gaps = pull / np.diag(precision)
        return pull / np.sqrt(np.diag(precision))


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
    `rh.ElasticMetric`, the surface may get a crease along the measurement line; a second-order
    term, as in `rh.SobolevMetric`, makes the change smooth.

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
    start = real_array(point, "point", metric.space.shape, batched=False)
    goals = as_mapping(wanted, measurements.names)
    own = Measurements(measurements.definitions, list(goals))
    targets = np.array(list(goals.values()))
    f = start.copy()
    values, slopes = _measured(own, f)
    energy, gradient = 0.0, np.zeros_like(f)
    n_steps, penalty = 0, 0.0
    while n_steps < max_iter:
        n_steps += 1
        factor = SparseCholeskyFactor(2.0 * metric.metric_matrix(f))
        rows = slopes.reshape(len(targets), -1)
        solved = factor.inverse(np.concatenate([rows, gradient.reshape(1, -1)]).T)
        by_rows, by_gradient = solved[:, :-1], solved[:, -1]
        gram = rows @ by_rows
        multipliers = -np.linalg.solve(gram, targets - values + rows @ by_gradient)
        # The second step only meets the values; it helps at a kink of a hull.
        steps = [
            -(by_gradient + by_rows @ multipliers),
            by_rows @ np.linalg.solve(gram, targets - values),
        ]
        penalty = max(penalty, 2.0 * float(np.abs(multipliers).max()))
        merit = energy + penalty * np.abs(values - targets).sum()
        for step, halvings in product(steps, range(_MOST_HALVINGS)):
            moved = f + 0.5**halvings * step.reshape(f.shape)
            trial, trial_slopes = _measured(own, moved)
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
    message = f"stopped after {n_steps} steps" if n_steps == max_iter else "no step gains more"
    message += "; the values are met" if is_met.all() else ""
    if not converged:
        missed = [name for name, met in zip(goals, is_met, strict=True) if not met]
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


def _met(values: ndarray, targets: ndarray, tolerance: float) -> ndarray:
    return np.abs(values - targets) <= tolerance * np.abs(targets)
