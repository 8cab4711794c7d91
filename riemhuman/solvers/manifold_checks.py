"""Property checks for manifolds, on a few random points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_number
from riemhuman.geometry import Manifold
from riemhuman.solvers.property_checks import PropertyReport, difference, property_report

_N_POINTS = 4
# How far from a point of the manifold arrays are that projection must bring back.
_NEAR = 1e-4
# The trace of to_tangent takes as many vectors.
_MOST_COORDINATES = 1000


def check_manifold(
    space: Manifold, rng: Rng = 0, *, tolerance: float = 1e-9, n_points: int = _N_POINTS
) -> PropertyReport:
    """Check the consistency of a manifold on a few random points.

    Random points, and arrays near them after `projection`, must belong to it, and arrays of another
    shape or with NaN must not; `to_tangent` must be a linear projection, in a stack as for each
    point alone, to tangent spaces of the manifold's dimension (for points of at most 1000 numbers);
    random tangent vectors must be tangent.

    In a test of your own, ``report = check_manifold(space)`` is followed by
    ``assert report.passed, report``.

    Parameters
    ----------
    space : Manifold
        The manifold.
    rng : int or numpy.random.Generator, optional
        Seed, or the generator that points are drawn from.
    tolerance : float
        Largest relative error.
    n_points : int
        Number of points, at least two.

    Returns
    -------
    PropertyReport

    Examples
    --------
    >>> import riemhuman as rh
    >>> report = rh.solvers.check_manifold(rh.VectorSpace((2,)))
    >>> report.passed
    True
    """
    tolerance = real_number(tolerance, "tolerance", minimum=0.0, strict=True)
    sample = _Sample(space, generator(rng), n_points)
    properties = {name: partial(error, sample) for name, error in _ALL.items()}
    if np.prod(space.shape) <= _MOST_COORDINATES:
        properties["tangent spaces have dimension dim"] = partial(_dimension, sample)
    return property_report(space, properties, tolerance)


@dataclass(frozen=True)
class _Sample:
    """A manifold with random points and arrays of their shape."""

    space: Manifold
    rng: np.random.Generator
    n_points: int

    @cached_property
    def points(self) -> ndarray:
        return np.asarray(self.space.random_point(self.n_points, rng=self.rng))

    @cached_property
    def noise(self) -> ndarray:
        return self.rng.standard_normal((self.n_points, *self.space.shape))

    @cached_property
    def vectors(self) -> ndarray:
        return np.asarray(self.space.to_tangent(self.noise, self.points))


def _share(wrong: object) -> float:
    """Return the share of what is wrong."""
    return float(np.mean(np.asarray(wrong, dtype=float)))


def _shapes(s: _Sample) -> float:
    one = np.shape(s.space.random_point(rng=s.rng))
    return float(one != s.space.shape or s.points.shape != (s.n_points, *s.space.shape))


def _drawn_anew(s: _Sample) -> float:
    return float(np.array_equal(s.space.random_point(), s.space.random_point()))


def _seeded(s: _Sample) -> float:
    return float(not np.array_equal(s.space.random_point(rng=3), s.space.random_point(rng=3)))


def _points_belong(s: _Sample) -> float:
    verdicts = np.asarray(s.space.belongs(s.points))
    return _share(~verdicts) if verdicts.shape == (s.n_points,) else np.inf


def _others_do_not_belong(s: _Sample) -> float:
    longer = np.concatenate([s.points, s.points[..., :1]], axis=-1)
    return _share(s.space.belongs(longer))


def _nan_does_not_belong(s: _Sample) -> float:
    spoilt = s.points.copy()
    spoilt[0].flat[0] = np.nan
    expected = np.arange(s.n_points) > 0
    return _share(np.asarray(s.space.belongs(spoilt)) != expected)


def _projected_points_stay(s: _Sample) -> float:
    return difference(s.space.projection(s.points), s.points, np.abs(s.points).max())


def _projection_reaches(s: _Sample) -> float:
    near = s.points + _NEAR * np.abs(s.points).max() * s.noise / np.abs(s.noise).max()
    return _share(~np.asarray(s.space.belongs(s.space.projection(near))))


def _idempotent(s: _Sample) -> float:
    again = s.space.to_tangent(s.vectors, s.points)
    return difference(again, s.vectors, np.abs(s.vectors).max())


def _linear(s: _Sample) -> float:
    other = np.roll(s.noise, 1, axis=0)
    together = s.space.to_tangent(2.0 * s.noise - 3.0 * other, s.points)
    apart = 2.0 * s.vectors - 3.0 * np.asarray(s.space.to_tangent(other, s.points))
    return difference(together, apart, np.abs(apart).max())


def _stacked(s: _Sample) -> float:
    alone = [s.space.to_tangent(v, x) for v, x in zip(s.noise, s.points, strict=True)]
    return difference(s.vectors, np.array(alone), np.abs(s.vectors).max())


def _dimension(s: _Sample) -> float:
    every = np.eye(s.points[0].size)
    projected = s.space.to_tangent(every.reshape(-1, *s.space.shape), s.points[0])
    return abs(float(np.trace(np.reshape(projected, every.shape))) - s.space.dim)


def _tangent_vectors(s: _Sample) -> float:
    vectors = np.asarray(s.space.random_tangent_vec(s.points, rng=s.rng))
    if vectors.shape != s.points.shape:
        return np.inf
    several = s.space.random_tangent_vec(s.points[0], 3, rng=s.rng)
    if np.shape(several) != (3, *s.space.shape):
        return np.inf
    verdicts = [*s.space.is_tangent(vectors, s.points), *s.space.is_tangent(several, s.points[0])]
    return _share(~np.array(verdicts))


_ALL: dict[str, Callable[[_Sample], float]] = {
    "random points have the shape that they should": _shapes,
    "random points are drawn anew": _drawn_anew,
    "random points of one seed are the same": _seeded,
    "random points belong": _points_belong,
    "arrays of another shape do not belong": _others_do_not_belong,
    "arrays with NaN do not belong": _nan_does_not_belong,
    "projection leaves points where they are": _projected_points_stay,
    "projections of arrays nearby belong": _projection_reaches,
    "tangent vectors stay what they are": _idempotent,
    "to_tangent is linear": _linear,
    "tangent vectors in a stack are those of each": _stacked,
    "random tangent vectors are tangent": _tangent_vectors,
}
