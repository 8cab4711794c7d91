"""Regression of bodies on a measurement or covariate, with a permutation test."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Labels, PointsLike
from riemhuman.checks import Rng, checked, generator, real_array, whole
from riemhuman.checks.labels import class_numbers
from riemhuman.errors import ArgumentError
from riemhuman.geometry import Manifold
from riemhuman.geometry.manifold import metric_of
from riemhuman.geometry.strategies import MeanSolver
from riemhuman.solvers import GeodesicRegression, NearestSurface

# Relative rounding errors within which two explained shares are the same.
_ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class ShapeRegression:
    """Regression of bodies on a number, with a test of significance.

    Attributes
    ----------
    regression : GeodesicRegression
        The fitted geodesic: ``regression.predict([0.7, 0.9])`` gives bodies.
    explained : float
        Share R² of the variance at the mean that the number explains.
    p_value : float
        Share of permutations of the numbers that explain at least as much.
    n_permutations : int

    Examples
    --------
    See `regress_shape`.
    """

    regression: GeodesicRegression
    explained: float
    p_value: float
    n_permutations: int


class RegressionOptions(TypedDict, total=False):
    """Arguments of `rh.GeodesicRegression`."""

    mean: MeanSolver | ArrayLike | None
    image: str
    nearest: NearestSurface | None
    tolerance: float
    max_iter: int


@checked(n_permutations=whole(minimum=1))
def regress_shape(
    space: Manifold,
    values: ArrayLike,
    points: PointsLike,
    *,
    people: Labels | None = None,
    n_permutations: int = 999,
    rng: Rng = None,
    **options: Unpack[RegressionOptions],
) -> ShapeRegression:
    r"""Fit bodies by a geodesic in a number, and test the fit by permutations.

    With logarithms :math:`L_i` of the bodies at their mean and centred numbers :math:`t_i`, the
    explained share is :math:`R^2 = |\sum_i t_i L_i|^2 / (\sum_i t_i^2 \sum_i |L_i|^2)`. The p-value
    is the share of permutations of the numbers among the people, including the given order, that
    explain at least as much.

    Parameters
    ----------
    space : AlignedSurfaces
        Space with a metric.
    values : array_like, shape (n,)
        Measurement or covariate of each body.
    points : array_like, shape (n, V, 3)
        Bodies.
    people : array_like, shape (n,), optional
        Person of each body. Bodies of one person must have one value, and permutations keep them
        together; by default each body is a person. None may be missing, see
        `rh.retrieval.scores`.
    n_permutations : int
        Number of random permutations.
    rng : int or numpy.random.Generator, optional
        Seed or generator of the permutations.
    **options
        Arguments of `rh.GeodesicRegression`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse").select(pose=0)
    >>> waists = rh.measurements.Measurements(bodies.model).measure(bodies.points)["waist girth"]
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=0.1)
    >>> result = rh.statistics.regress_shape(space, waists, bodies.points, rng=0, max_iter=0)
    >>> result.p_value <= 0.05
    True
    """
    bodies = metric_of(space).check_points(points, "points")
    numbers = real_array(values, "values", (len(bodies),), batched=False)
    labels = range(len(bodies)) if people is None else people
    person_of, _ = class_numbers(labels, "people", len(bodies))
    _, first_bodies = np.unique(person_of, return_index=True)
    numbers_of_people = numbers[first_bodies]
    if (numbers != numbers_of_people[person_of]).any():
        raise ArgumentError("values must be the same for all bodies of a person")
    regression = GeodesicRegression(space, **options).fit(numbers, bodies)
    gram = regression.gram_matrix(bodies)
    rng = generator(rng)
    explained = _explained(gram, numbers)
    permuted = np.empty(n_permutations)
    for number in range(n_permutations):
        permuted[number] = _explained(gram, rng.permutation(numbers_of_people)[person_of])
    n_at_least = 1 + int(np.sum(permuted >= explained * (1.0 - _ROUNDING)))
    p_value = n_at_least / (1 + n_permutations)
    return ShapeRegression(regression, explained, p_value, n_permutations)


def _explained(gram: Array, values: Array) -> float:
    centred = values - values.mean()
    return float(centred @ gram @ centred / (centred @ centred * np.trace(gram)))
