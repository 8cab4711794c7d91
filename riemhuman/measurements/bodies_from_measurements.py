r"""The most probable body with given measurements.

In a fixed pose the vertices of a body model are affine in the shape coefficients, x(β) = x₀ + Bβ.
The most probable body minimises

.. math:: (\beta - \mu)^\top \Sigma^{-1} (\beta - \mu) + \sum_k ((m_k(x(\beta)) - v_k)/\sigma_k)^2

by Gauss–Newton steps with the derivatives of the measurements m_k. These jump where a line passes a
vertex; so steps follow such kinks, see `riemhuman.measurements._kinks`. β is normal among adults,
the given values v have small σ, and those that are predicted from them have a third of their
standard deviations, so that they count more than the shapes of adults.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Booleans
from riemhuman.checks import checked, choice, whole
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.measurements._kinks import least_squares_with_kinks
from riemhuman.measurements._vertex_slopes import slopes_along
from riemhuman.measurements.adults import SEXES, adults, given_values
from riemhuman.measurements.measurement_set import load_json, open_measurements
from riemhuman.measurements.measuring import Measurements, values_and_slopes
from riemhuman.measurements.predicted_measurements import (
    PredictedMeasurements,
    errors_of_values,
    predict,
)

# Share of adults below which a remark says that hardly anyone has such values.
_RARE = 0.001
# The body meets predicted values to this share of their standard deviations.
_OF_PREDICTED = 0.3
# Messages name given values that the body misses by more standard deviations than this.
_MOST_MISSED = 3.0
_WAIST, _OMPHALION = "waist girth", "waist girth (omphalion)"


@dataclass(frozen=True, eq=False)
class ProbableBody:
    """A body found from measurements.

    Attributes
    ----------
    points : array, shape (V, 3)
        The body in the standard pose, metres.
    betas : array, shape (B,)
        Shape coefficients of the body.
    values, misses : dict of str to float
        The given measurements of the body, and their differences from the given values.
    predicted, predicted_std : dict of str to float
        The other measurements, standing and seated, predicted by linear regression on ANSUR II,
        and the standard deviations of their errors: 90 per cent of people lie within 1.645 of
        these. The body comes as near to them as its shape coefficients allow.
    sexes : dict of str to float
        Probabilities of "woman" and "man" given the values.
    z_scores : dict of str to float
        Each given value minus its prediction from the others (for a single value, minus the mean
        among adults), as a t-value.
    contradictory : tuple of str
        Names of values that do not fit the others in at most 1 of 100 people, the worst first.
    improbability : float
        Mahalanobis distance of the body from the mean adult of the sex.
    cost : float
        Half the sum that is minimised: the square of `improbability`, and those of what the body
        misses of given and predicted values, over their standard deviations.
    converged : bool
        Whether the search converged.
    message : str
        Which two values contradict each other, whether no adult has such values, which waist was
        given, whether the search converged, and which values the body misses.

    Examples
    --------
    See `model_from_measurements`.
    """

    points: Array
    betas: Array
    values: dict[str, float]
    misses: dict[str, float]
    predicted: dict[str, float]
    predicted_std: dict[str, float]
    sexes: dict[str, float]
    z_scores: dict[str, float]
    contradictory: tuple[str, ...]
    improbability: float
    cost: float
    converged: bool
    message: str


@checked(
    sex=choice("adult", *SEXES),
    resolution=choice("full", "coarse"),
    max_iter=whole(minimum=1),
)
def model_from_measurements(
    values: Mapping[str, float],
    sex: str = "adult",
    *,
    tolerances: Mapping[str, float] | None = None,
    resolution: str = "full",
    max_iter: int = 100,
) -> ProbableBody:
    """Return the most probable body of the open model with these measurements.

    Parameters
    ----------
    values : mapping of str to float
        Measurements of the open body by name, in metres, square metres, cubic metres or kilograms.
        Values that nobody has raise an error that suggests another unit. Seated measurements have
        an effect through the standing measurements that they predict.
    sex : {"adult", "woman", "man"}
        Population in which the body is the most probable; for "adult", both sexes count by their
        probability given the values.
    tolerances : mapping of str to float, optional
        Standard deviations σ of the values, in their units; by default 0.1 mm for lengths, and a
        two-thousandth of the value for areas, volumes and masses. If there are many values, use
        larger tolerances, because the model's measurements differ from those of ANSUR by up to
        centimetres.
    resolution : {"full", "coarse"}
        Resolution of the model.
    max_iter : int
        Largest number of steps.

    Examples
    --------
    >>> wanted = {"stature": 1.70, "waist girth (omphalion)": 0.85, "hip girth": 1.00}
    >>> person = rh.measurements.model_from_measurements(wanted, sex="woman", resolution="coarse")
    >>> round(person.values["hip girth"], 3)
    1.0
    """
    # Products of a step are so small that threads of BLAS cost more than they gain.
    with single_threaded_libraries():
        given = given_values(values, sex)
        errors = errors_of_values(given, tolerances)
        return _probable_body(given, errors, sex, resolution, max_iter)


def _probable_body(
    given: dict[str, float],
    errors: dict[str, float],
    sex: str,
    resolution: str,
    max_iter: int,
) -> ProbableBody:
    standing = open_measurements(resolution)
    assert standing is not None, "the open model has measurements"
    units = dict(zip(standing.names, Measurements(standing).units, strict=True))
    prediction = predict(given, sex, errors)
    sexes, goals = prediction.sexes, dict(given)
    spread = {name: _OF_PREDICTED * std for name, std in prediction.std.items()} | errors
    for name, mean in prediction.values.items():
        offsets = (share * adults()[k]["offsets"].get(name, 0.0) for k, share in sexes.items())
        goals[name] = mean + sum(offsets)
    measurements = Measurements(standing, [name for name in standing.names if name in goals])
    wanted = np.array([goals[name] for name in measurements.names])
    allowed = np.array([spread[name] for name in measurements.names])
    is_given = np.array([name in given for name in measurements.names])
    search = _nearest_betas(measurements, sexes, wanted, allowed, is_given, max_iter)
    measured = measurements.measure(search.points, axes="space", missing="nan").to_dict()
    in_body = {name: float(measured[name]) for name in given if name in measured}
    misses = {name: value - given[name] for name, value in in_body.items()}
    missed = [n for n, miss in misses.items() if abs(miss) > _MOST_MISSED * errors[n]]
    missed.sort(key=lambda name: -abs(misses[name]) / errors[name])
    remarks = _remarks(given, sex, prediction, search.converged)
    if missed:
        some = ", ".join(f"{n} by {misses[n]:+.2g} {units[n]}" for n in missed[:3])
        more = f" and {len(missed) - 3} more" if len(missed) > 3 else ""
        remarks.append(f"the body misses {some}{more}: larger tolerances give a likelier body")
    return ProbableBody(
        points=search.points,
        betas=search.betas,
        values=in_body,
        misses=misses,
        predicted=prediction.values,
        predicted_std=prediction.std,
        sexes=sexes,
        z_scores=prediction.z_scores,
        contradictory=prediction.contradictory,
        improbability=search.improbability,
        cost=search.cost,
        converged=search.converged,
        message="; ".join(remarks),
    )


def _remarks(
    given: Mapping[str, float], sex: str, prediction: PredictedMeasurements, converged: bool
) -> list[str]:
    remarks = [] if converged else ["the search did not converge"]
    if prediction.pair is not None:
        first, second, agreeing = prediction.pair
        remarks.append(
            f"{first} of {given[first]:.4g} contradicts {second} of {given[second]:.4g}: at most 1 "
            f"in 100 adults combines such values; {first} of about {agreeing:.4g} would agree"
        )
    elif prediction.contradictory:
        name = prediction.contradictory[0]
        remarks.append(f"{name} of {given[name]:.4g}: at most 1 in 100 adults has such a value")
    if not prediction.contradictory and len(given) > 1:
        rare = ", but at most 1 in 1000 adults is so far from the mean"
        remarks.append(
            "the values agree with each other" + (rare if prediction.rarity < _RARE else "")
        )
    if _WAIST in given and _OMPHALION not in given:
        remark = (
            "the waist is the natural waist; if yours was measured at the navel, as in ANSUR, "
            f"name it {_OMPHALION!r}"
        )
        renamed = {_OMPHALION if name == _WAIST else name: v for name, v in given.items()}
        if prediction.contradictory and not predict(renamed, sex).contradictory:
            remark += ", with which the values would agree"
        remarks.append(remark)
    return remarks


@dataclass(frozen=True, eq=False)
class _Search:
    """Shape coefficients, their body, its distance from the mean adult, and the cost."""

    betas: Array
    points: Array
    improbability: float
    cost: float  # half the sum that is minimised
    converged: bool


def _mixture_of_adults(sexes: Mapping[str, float]) -> tuple[Array, Array]:
    """Return mean and covariance of shape coefficients of adults, by the shares of the sexes."""
    means, covariances = (
        np.array([load_json("adults.json")[sex][moment] for sex in sexes])
        for moment in ("mean", "covariance")
    )
    shares = np.array(list(sexes.values()))
    mean = shares @ means
    away = means - mean
    return mean, np.tensordot(shares, covariances, axes=1) + (shares * away.T) @ away


def _nearest_betas(
    measurements: Measurements,
    sexes: Mapping[str, float],
    goals: Array,
    spread: Array,
    is_given: Booleans,
    max_iter: int,
) -> _Search:
    """Find the shape coefficients whose measurements are nearest to the goals, and their body."""
    model, pose = measurements.definitions.model, measurements.definitions.standard_pose_vector
    assert model is not None
    mean, covariance = _mixture_of_adults(sexes)
    # Coordinates z have unit variance among adults.
    root = np.linalg.cholesky(covariance)
    bodies = model(np.concatenate([mean[np.newaxis], mean + root.T]), pose)
    middle, definitions = bodies[0], measurements.definitions
    directions = np.ascontiguousarray((bodies[1:] - middle).reshape(len(mean), -1).T)

    def body(z: Array) -> Array:
        surface: Array = middle + (directions @ z).reshape(middle.shape)
        return surface

    def compared(z: Array, values: Array) -> Array:
        # A predicted measurement that is not defined does not count; a given one refuses the step.
        measured = np.where(np.isnan(values) & ~is_given, goals, values)
        return np.concatenate([z, (measured - goals) / spread])

    def linearisation(z: Array) -> tuple[Array, Array]:
        values, slopes = values_and_slopes(definitions, body(z)[np.newaxis], "space")
        rows = slopes_along(slopes, directions)
        rows[np.isnan(values[0])] = 0.0
        return compared(z, values[0]), np.concatenate(
            [np.eye(len(z)), rows / spread[:, np.newaxis]]
        )

    z, cost, converged = least_squares_with_kinks(linearisation, np.zeros(len(mean)), max_iter)
    return _Search(mean + root @ z, body(z), float(np.linalg.norm(z)), cost, converged)
