r"""Bodies with given measurements, the most probable or the nearest; predicted measurements.

The measurements of one sex are normal, y ~ N(μ, C), with statistics of ANSUR II. Given some of
them, the others are normal with mean :math:`\mu_o + C_{og} C_{gg}^{-1} (y_g - \mu_g)` and
covariance :math:`C_{oo} - C_{og} C_{gg}^{-1} C_{go}`: the best linear regression. If the sex is not
given, both count by their probability. Whether values contradict each other is judged with heavier
tails: y has a t-distribution with ν degrees of freedom, and :math:`y_k` given p − 1 others one with
ν + p − 1, the same mean, and a scale that grows with the distance of the others from their means.

In a fixed pose the vertices of a body model are affine in the shape coefficients, x(β) = x₀ + Bβ.
The most probable body minimises

.. math:: (\beta - \mu)^\top \Sigma^{-1} (\beta - \mu) + \sum_k ((m_k(x(\beta)) - v_k)/\sigma_k)^2

by Gauss–Newton steps with the derivatives of the measurements m_k. These jump where a line passes a
vertex; so the search ends by following such kinks, see `riemhuman.measurements._kinks`. β is normal
among adults, the given values v have small σ, and those that are predicted from them have a third
of their standard deviations, so that they count more than the shapes of adults.

The nearest body minimises d²(f₀, f) over all vertices of f subject to m_k(f) = v_k, by sequential
quadratic programming: with M the matrix of the metric at f, g the gradient of d² and J the
derivatives of the measurements, the step p solves 2 M p + Jᵀ μ = −g, J p = v − m(f).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.linalg import solve_triangular
from scipy.special import fdtrc, gammaln, softmax, stdtrit

from riemhuman.arrays import Array, Booleans, JSONRecord
from riemhuman.checks import SUSPECTED_UNITS, one_of, real_array, real_number, whole_number
from riemhuman.errors import ArgumentError, ConvergenceWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.measurements._kinks import least_squares_with_kinks
from riemhuman.measurements._vertex_slopes import slopes_along
from riemhuman.measurements.measurement_set import load_json, open_measurements
from riemhuman.measurements.measuring import (
    Measurements,
    as_mapping,
    values_and_slopes,
    values_of_bodies,
)
from riemhuman.memory import enough_memory
from riemhuman.solvers._preconditioners import SparseCholeskyFactor

SEXES = ("woman", "man")
# Degrees of freedom with which the expected share of ANSUR II is flagged, and that share.
_DEGREES, _SHARE = 12.0, 0.005
# Share of adults below which a remark says that hardly anyone has such values.
_RARE = 0.001
# Standard deviation with which a value is measured, relative to it.
_ERROR = 0.005
# The first search ends when a step changes the shape coefficients, or lowers the cost, by less than
# these shares; the second one follows kinks.
_LEAST_STEP, _FIRST_GAIN = 1e-6, 1e-3
# Default standard deviations of values: metres, and shares of areas, volumes and masses.
_LENGTH_TOLERANCE, _SHARE_TOLERANCE = 1e-4, 5e-4
# The body meets predicted values to this share of their standard deviations.
_OF_PREDICTED = 0.3
# Smallest and largest values of people, as shares of the mean woman's: from the shortest adults,
# 0.55 m tall, to the tallest, and to the heaviest; other values are in other units.
_SHARES = {"m": (0.33, 2.0), "m²": (0.1, 4.0), "m³": (0.03, 10.0), "kg": (0.03, 10.0)}
_SHARES_AROUND = (0.25, 3.0)  # of girths, breadths and depths, which grow with weight
# The tallest person was 2.72 m tall, and no arm span was longer than 2.9 m.
_LARGEST_LENGTH = 2.9
# Messages name given values that the body misses by more standard deviations than this.
_MOST_MISSED = 3.0
_WAIST, _OMPHALION = "waist girth", "waist girth (omphalion)"
_MOST_HALVINGS = 12


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


@enough_memory("a body from measurements", 'ask for resolution="coarse"')
def model_from_measurements(
    values: Mapping[str, float],
    sex: str = "adult",
    *,
    tolerances: Mapping[str, float] | None = None,
    resolution: str = "full",
    max_iter: int = 100,
    start: ArrayLike | None = None,
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
    start : array, shape (B,), optional
        Shape coefficients of the body from which the search starts, by default the mean adult.

    Notes
    -----
    Searches from other bodies end within a thousandth of the same `cost`.

    Examples
    --------
    >>> wanted = {"stature": 1.70, "waist girth (omphalion)": 0.85, "hip girth": 1.00}
    >>> person = rh.measurements.model_from_measurements(wanted, sex="woman", resolution="coarse")
    >>> round(person.values["hip girth"], 3)
    1.0
    """
    one_of(sex, "sex", ("adult", *SEXES))
    one_of(resolution, "resolution", ("full", "coarse"))
    whole_number(max_iter, "max_iter", minimum=1)
    standing = open_measurements(resolution)
    assert standing is not None, "the open model has measurements"
    given, errors = _checked_values(values, tolerances)
    units = dict(zip(standing.names, Measurements(standing).units, strict=True))
    prediction = predict(given, sex, errors)
    sexes, goals = prediction.sexes, dict(given)
    spread = {name: _OF_PREDICTED * std for name, std in prediction.std.items()} | errors
    for name, mean in prediction.mean.items():
        offsets = (share * adults()[k]["offsets"].get(name, 0.0) for k, share in sexes.items())
        goals[name] = mean + sum(offsets)
    measurements = Measurements(standing, [name for name in standing.names if name in goals])
    wanted = np.array([goals[name] for name in measurements.names])
    allowed = np.array([spread[name] for name in measurements.names])
    is_given = np.array([name in given for name in measurements.names])
    assert standing.model is not None
    n_betas = standing.model.n_betas
    first = None if start is None else real_array(start, "start", (n_betas,), batched=False)
    search = _nearest_betas(measurements, sexes, wanted, allowed, is_given, max_iter, first)
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
        predicted=prediction.mean,
        predicted_std=prediction.std,
        sexes=sexes,
        z_scores=prediction.scores,
        contradictory=prediction.contradictory,
        improbability=search.improbability,
        cost=search.cost,
        converged=search.converged,
        message="; ".join(remarks),
    )


@dataclass(frozen=True, eq=False)
class PredictedMeasurements:
    """Measurements of adults, predicted from others.

    Attributes
    ----------
    values, std : dict of str to float
        The measurements that were not given, standing and seated, in metres, square metres, cubic
        metres or kilograms, and the standard deviations of their errors.
    sexes : dict of str to float
        Probabilities of "woman" and "man" given the values.
    z_scores : dict of str to float
        Each given value minus its prediction from the others, as a t-value.
    contradictory : tuple of str
        Names of values that do not fit the others in at most 1 of 100 people, the worst first.

    Examples
    --------
    See `predict_measurements`.
    """

    values: dict[str, float]
    std: dict[str, float]
    sexes: dict[str, float]
    z_scores: dict[str, float]
    contradictory: tuple[str, ...]


def predict_measurements(
    values: Mapping[str, float],
    sex: str = "adult",
    *,
    tolerances: Mapping[str, float] | None = None,
) -> PredictedMeasurements:
    """Predict all other measurements of adults from given ones, without making a body.

    They are predicted by linear regression on ANSUR II, as measured with tapes and callipers;
    `model_from_measurements` gives a body that comes close to them.

    Parameters
    ----------
    values : mapping of str to float
        Measurements by name, in metres, square metres, cubic metres or kilograms. Values that
        nobody has raise an error that suggests another unit.
    sex : {"adult", "woman", "man"}
        Population; for "adult", both sexes count by their probability given the values.
    tolerances : mapping of str to float, optional
        Standard deviations of errors of the values, in their units; by default 0.1 mm for lengths,
        and a two-thousandth of the value for areas, volumes and masses.

    Examples
    --------
    >>> predicted = rh.measurements.predict_measurements({"stature": 1.70}, "woman")
    >>> round(predicted.values["sitting height"], 2), round(predicted.std["sitting height"], 3)
    (0.88, 0.022)
    """
    one_of(sex, "sex", ("adult", *SEXES))
    given, errors = _checked_values(values, tolerances)
    prediction = predict(given, sex, errors)
    return PredictedMeasurements(
        prediction.mean,
        prediction.std,
        prediction.sexes,
        prediction.scores,
        prediction.contradictory,
    )


def _checked_values(
    values: Mapping[str, float], tolerances: Mapping[str, float] | None
) -> tuple[dict[str, float], dict[str, float]]:
    """Return given values and their standard deviations by name."""
    standing = open_measurements("coarse")
    assert standing is not None, "the open model has measurements"
    given = as_mapping(values, list(dict.fromkeys((*standing.names, *adults()["names"]))))
    units = {measurement.name: measurement.units for measurement in standing.measurements}
    typical = dict(zip(adults()["names"], adults()["woman"]["mean"], strict=True))
    errors = {}
    for name, value in given.items():
        real_number(value, name, minimum=0.0, strict=True)
        unit = units.get(name, "m")
        _check_value(name, value, typical.get(name, value), unit)
        errors[name] = _LENGTH_TOLERANCE if unit == "m" else _SHARE_TOLERANCE * value
    for name, error in as_mapping(tolerances, list(given)).items() if tolerances else ():
        errors[name] = real_number(error, f"tolerance of {name}", minimum=0.0, strict=True)
    return given, errors


def _check_value(name: str, value: float, usual: float, unit: str) -> None:
    """Raise an error that suspects the unit if no person has a value, given the mean woman's."""
    if _is_human(name, value, usual, unit):
        return
    units = []
    if unit == "m":
        for suspected, size in SUSPECTED_UNITS.items():
            if _is_human(name, value / size, usual, unit):
                units.append(suspected)
    question = f": is it in {' or '.join(units)}?" if units else ""
    raise ArgumentError(
        f"{name} must be in {unit}, in which the mean of women is {usual:.3g}; found {value:g}, "
        f"which nobody has{question}"
    )


def _is_human(name: str, value: float, usual: float, unit: str) -> bool:
    """Return whether a person can have a value, given the mean woman's."""
    is_around = any(word in name for word in ("girth", "breadth", "depth", "clearance"))
    low, high = _SHARES_AROUND if unit == "m" and is_around else _SHARES[unit]
    return low * usual < value < high * usual and not (unit == "m" and value >= _LARGEST_LENGTH)


@dataclass(frozen=True)
class Prediction:
    """What given values say: the others, the sex, and values that contradict each other."""

    mean: dict[str, float]
    std: dict[str, float]
    sexes: dict[str, float]
    scores: dict[str, float]  # t-values of the given values
    contradictory: tuple[str, ...]
    # The two values that fit each other least, and a value of the first that would fit.
    pair: tuple[str, str, float] | None
    rarity: float  # share of adults as far from the mean


@cache
def adults() -> JSONRecord:
    """Return names, and by sex means, covariances and offsets: those of the model less ANSUR's."""
    record: JSONRecord = load_json("measurements_of_adults.json")
    size = len(record["names"])
    for sex in SEXES:
        entry, correlations = record[sex], np.eye(size)
        correlations[np.tril_indices(size, -1)] = entry["correlations"]
        correlations += np.tril(correlations, -1).T
        std = np.array(entry["std"])
        entry["mean"] = np.array(entry["mean"])
        entry["covariance"] = correlations * np.outer(std, std)
    return record


def predict(
    given: Mapping[str, float], sex: str, errors: Mapping[str, float] | None = None
) -> Prediction:
    """Predict all measurements of adults that are not given, from values with errors."""
    names = adults()["names"]
    known = [name for name in given if name in names]
    rows = np.array([names.index(name) for name in known], dtype=int)
    rest = np.setdiff1d(np.arange(len(names)), rows)
    values = np.array([given[name] for name in known])
    noise = np.array([(errors or {}).get(name, 0.0) for name in known])
    sexes = [sex] if sex in SEXES else list(SEXES)
    means, variances = np.empty((2, len(sexes), len(rest)))
    likelihoods = np.zeros(len(sexes))
    for k, population in enumerate(sexes):
        mean, covariance = adults()[population]["mean"], adults()[population]["covariance"]
        inner = covariance[np.ix_(rows, rows)] + np.diag(noise**2)
        slopes = np.linalg.solve(inner, covariance[np.ix_(rows, rest)])
        means[k] = mean[rest] + (values - mean[rows]) @ slopes
        explained = np.sum(covariance[np.ix_(rows, rest)] * slopes, axis=0)
        variances[k] = np.diag(covariance)[rest] - explained
        if known:
            likelihoods[k] = _log_density(values - mean[rows], inner)
    shares = softmax(likelihoods)
    expected = shares @ means
    variance = shares @ (variances + (means - expected) ** 2)
    others = [names[k] for k in rest]
    return Prediction(
        dict(zip(others, expected.tolist(), strict=True)),
        dict(zip(others, np.sqrt(variance).tolist(), strict=True)),
        dict(zip(sexes, shares.tolist(), strict=True)),
        *_contradictions(known, values, noise, sexes[int(shares.argmax())]),
    )


def _log_density(deviations: Array, scale: Array) -> float:
    """Return the logarithm of the density of Student's distribution in several dimensions."""
    # Like `scipy.stats.multivariate_t`, whose package takes half a second to import.
    n, root = len(deviations), np.linalg.cholesky(scale)
    within = float(np.sum(solve_triangular(root, deviations, lower=True) ** 2))
    constant = gammaln(0.5 * (_DEGREES + n)) - gammaln(0.5 * _DEGREES)
    constant -= 0.5 * n * np.log(np.pi * _DEGREES) + np.sum(np.log(np.diag(root)))
    return float(constant - 0.5 * (_DEGREES + n) * np.log1p(within / _DEGREES))


def _contradictions(
    known: Sequence[str], values: Array, noise: Array, sex: str
) -> tuple[dict[str, float], tuple[str, ...], tuple[str, str, float] | None, float]:
    if not known:
        return {}, (), None, 1.0
    names = adults()["names"]
    rows = [names.index(name) for name in known]
    deviations = values - adults()[sex]["mean"][rows]
    covariance = adults()[sex]["covariance"][np.ix_(rows, rows)]
    covariance = covariance + np.diag(np.maximum(_ERROR * values, noise) ** 2)
    scores, _ = _t_values(deviations, covariance)
    limit = stdtrit(_DEGREES + len(known) - 1, 1.0 - _SHARE / (2 * len(known)))
    order = np.argsort(-np.abs(scores))
    contradictory = tuple(known[k] for k in order if abs(scores[k]) > limit)
    pair = None
    if contradictory:
        # Of all pairs with the worst value, the one whose values fit each other least.
        worst, least = order[0], -1.0
        for j in order[1:]:
            both = [worst, j]
            pair_scores, gaps = _t_values(deviations[both], covariance[np.ix_(both, both)])
            if abs(pair_scores[0]) > least:
                least, pair = (
                    abs(pair_scores[0]),
                    (known[worst], known[j], float(values[worst] - gaps[0])),
                )
    squared = deviations @ np.linalg.solve(covariance, deviations) / len(known)
    rarity = float(fdtrc(len(known), _DEGREES, squared))
    return dict(zip(known, scores.tolist(), strict=True)), contradictory, pair, rarity


def _t_values(deviations: Array, covariance: Array) -> tuple[Array, Array]:
    """Compare each value with its mean given the others: in t-values, and in its unit."""
    precision = np.linalg.inv(covariance)
    pull = precision @ deviations
    squares = pull**2 / np.diag(precision)
    others = deviations @ pull - squares
    degrees = _DEGREES + len(deviations) - 1
    scores = np.sign(pull) * np.sqrt(squares * degrees / (_DEGREES + others))
    return scores, pull / np.diag(precision)


def _remarks(
    given: Mapping[str, float], sex: str, prediction: Prediction, converged: bool
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
    start: Array | None = None,
) -> _Search:
    """Find the shape coefficients whose measurements are nearest to the goals, and their body."""
    from scipy.optimize import least_squares  # takes long to import

    model, pose = measurements.definitions.model, measurements.definitions.standard_pose_vector
    assert model is not None
    mean, covariance = _mixture_of_adults(sexes)
    # Coordinates have unit variance among adults: a first step is one unit, since after larger ones
    # measurements may not be defined.
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

    def residuals(z: Array) -> Array:
        values, _ = values_of_bodies(definitions, body(z)[np.newaxis], "space", gradient=False)
        return compared(z, values[0])

    def linearisation(z: Array) -> tuple[Array, Array]:
        values, slopes = values_and_slopes(definitions, body(z)[np.newaxis], "space")
        rows = slopes_along(slopes, directions)
        rows[np.isnan(values[0])] = 0.0
        return compared(z, values[0]), np.concatenate(
            [np.eye(len(z)), rows / spread[:, np.newaxis]]
        )

    start = (
        np.zeros(len(mean)) if start is None else solve_triangular(root, start - mean, lower=True)
    )
    smooth_fit = least_squares(
        residuals,
        start,
        lambda z: linearisation(z)[1],
        ftol=_FIRST_GAIN,
        xtol=_LEAST_STEP,
        gtol=None,
        max_nfev=max_iter,
    )
    left = max_iter - int(smooth_fit.nfev)
    z, cost, converged = least_squares_with_kinks(linearisation, smooth_fit.x, left)
    return _Search(mean + root @ z, body(z), float(np.linalg.norm(z)), cost, converged)


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
