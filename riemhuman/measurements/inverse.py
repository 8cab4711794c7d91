r"""The most probable body with given measurements, among the adults of the open body model.

In a fixed pose the vertices of a body model are affine in the shape coefficients, x(β) = x₀ + Bβ.
With β normal with mean μ and covariance Σ, the most probable body minimises

.. math:: (\beta - \mu)^\top \Sigma^{-1} (\beta - \mu) + \sum_k ((m_k(x(\beta)) - v_k)/\sigma_k)^2,

by Gauss–Newton steps with the derivatives of the measurements m_k.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_number, whole_number
from riemhuman.datasets import load_open_model
from riemhuman.measurements.measuring import Measurements, as_mapping
from riemhuman.measurements.open_body import FOLDER, open_measurements
from riemhuman.measurements.standard_pose import standard_pose_vector

SEXES = ("woman", "man", "adult")
# Least relative uncertainty of a value when it is compared with the others.
_COARSENESS = 0.01
# A value contradicts the others if it is this many standard deviations from their prediction.
_CONTRADICTION = 4.0
_AT_REST = 1e-6
_LENGTH_TOLERANCE, _SHARE_TOLERANCE = 3e-4, 1e-3


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
    one_of(sex, "sex", SEXES)
    whole_number(max_iter, "max_iter", minimum=1)
    description = open_measurements(load_open_model(resolution))
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
    search = _Search(own, standard_pose_vector(description), _adults()[sex], wanted, spread)
    return search.solve(max_iter)


@lru_cache(maxsize=1)
def _adults() -> dict[str, tuple[ndarray, ndarray]]:
    """Return mean and covariance of the shape coefficients among women, men and both."""
    record = json.loads((FOLDER / "adults.json").read_text(encoding="utf-8"))
    return {
        sex: (np.array(entry["mean"]), np.array(entry["covariance"]))
        for sex, entry in record.items()
    }


class _Search:
    """The search for the most probable body."""

    def __init__(
        self,
        own: Measurements,
        pose: ndarray,
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
        bodies = model(np.concatenate([np.zeros((1, model.n_betas)), np.eye(model.n_betas)]), pose)
        self._rest, self._directions = bodies[0], bodies[1:] - bodies[0]
        self._precision = np.linalg.inv(self._covariance)

    def solve(self, max_iter: int) -> MeasuredPerson:
        betas, converged = self._mean, False
        found, slopes = self._measured(betas)
        cost, damping = self._cost(betas, found), 1e-3
        for _ in range(max_iter):
            scaled = slopes / self._spread[:, np.newaxis]
            matrix = scaled.T @ scaled + self._precision
            right = scaled.T @ ((self._wanted - found) / self._spread)
            right -= self._precision @ (betas - self._mean)
            while True:
                damped = matrix + damping * np.diag(np.diag(matrix))
                step = np.linalg.solve(damped, right)
                if np.abs(step).max() < _AT_REST:
                    converged = True
                    break
                trial, trial_slopes = self._measured(betas + step)
                trial_cost = self._cost(betas + step, trial)
                if trial_cost < cost:
                    betas, found, slopes, cost = betas + step, trial, trial_slopes, trial_cost
                    damping = max(damping / 10.0, 1e-9)
                    break
                damping *= 10.0
            if converged:
                break
        return self._person(betas, found, slopes, converged)

    def _body(self, betas: ndarray) -> ndarray:
        return self._rest + np.tensordot(betas, self._directions, axes=1)

    def _measured(self, betas: ndarray) -> tuple[ndarray, ndarray]:
        """Return values and their derivatives by the betas; NaN where a measurement fails."""
        measured = self._own.measure(self._body(betas), axes="space", gradient=True, missing="nan")
        assert measured.gradient is not None
        return measured.values, np.einsum("mvx,bvx->mb", measured.gradient, self._directions)

    def _cost(self, betas: ndarray, found: ndarray) -> float:
        away = betas - self._mean
        cost = away @ self._precision @ away + np.sum(((found - self._wanted) / self._spread) ** 2)
        return float(cost) if np.isfinite(cost) else np.inf

    def _person(
        self, betas: ndarray, found: ndarray, slopes: ndarray, converged: bool
    ) -> MeasuredPerson:
        away = betas - self._mean
        improbability = float(np.sqrt(away @ self._precision @ away))
        scores = self._scores(betas, found, slopes)
        order = np.argsort(-np.abs(scores))
        contradictory = tuple(self._names[k] for k in order if abs(scores[k]) > _CONTRADICTION)
        said = [] if converged else ["the search did not converge"]
        if contradictory:
            worst = order[0]
            agreeing = self._wanted[worst] - self._gaps[worst]
            said.append(
                f"{contradictory[0]} of {self._wanted[worst]:.4g} contradicts the other values "
                f"most; about {agreeing:.4g} would agree with them"
            )
        if len(contradictory) > 1:
            said.append(f"so do {', '.join(contradictory[1:])}")
        return MeasuredPerson(
            points=self._body(betas),
            betas=betas,
            values=dict(zip(self._names, found.tolist(), strict=True)),
            misses=dict(zip(self._names, (found - self._wanted).tolist(), strict=True)),
            z_scores=dict(zip(self._names, scores.tolist(), strict=True)),
            contradictory=contradictory,
            improbability=improbability,
            converged=converged,
            message="; ".join(said) or "the values agree with each other",
        )

    def _scores(self, betas: ndarray, found: ndarray, slopes: ndarray) -> ndarray:
        """Compare each value with its prediction from the others, to first order.

        If values y are normal with mean 0 and covariance C, then y_k less its mean given the others
        is (C⁻¹y)_k/(C⁻¹)_kk, with variance 1/(C⁻¹)_kk.
        """
        noise = np.maximum(self._spread, _COARSENESS * self._wanted)
        covariance = slopes @ self._covariance @ slopes.T + np.diag(noise**2)
        precision = np.linalg.inv(covariance)
        expected = found + slopes @ (self._mean - betas)
        pull = precision @ (self._wanted - expected)
        self._gaps = pull / np.diag(precision)
        return pull / np.sqrt(np.diag(precision))
