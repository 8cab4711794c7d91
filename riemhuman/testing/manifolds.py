"""Checks of a manifold: random points, projections and tangent spaces are consistent."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from riemhuman.arrays import Array
from riemhuman.checks import Rng, checked, generator, instance, positive
from riemhuman.geometry import Manifold
from riemhuman.testing.reports import Properties, PropertyReport, difference, report_of, share

__all__ = ["check_manifold"]

# Distance from the manifold, relative to its points, of arrays that projection must bring back.
_NEAR = 1e-4
# Largest number of coordinates for which the trace of to_tangent, of as many vectors, is computed.
_MOST_COORDINATES = 1000
# Number of random points of a manifold.
_N_POINTS = 4


@checked(space=instance(Manifold), tolerance=positive)
def check_manifold(space: Manifold, rng: Rng = 0, *, tolerance: float = 1e-9) -> PropertyReport:
    """Check the consistency of a manifold on a few random points.

    The dimension of tangent spaces is checked for points of at most 1000 numbers.

    Parameters
    ----------
    space : Manifold
        The manifold.
    rng : int or numpy.random.Generator, optional
        Seed, or the generator from which points are drawn.
    tolerance : float
        Largest relative error.

    Examples
    --------
    >>> rh.testing.check_manifold(rh.VectorSpace((2,))).passed
    True
    """
    rng = generator(rng)
    points, vectors = _RandomPoints(space, rng), _TangentVectors(space, rng)
    properties = {**points.properties(), **vectors.properties()}
    return report_of(space, properties, tolerance)


@dataclass(frozen=True)
class _RandomPoints:
    """Random points, and arrays near them."""

    space: Manifold
    rng: np.random.Generator

    def properties(self) -> Properties:
        return {
            "random points have the right shape": self.shapes,
            "each call draws different random points": self.drawn_anew,
            "the same seed gives the same random points": self.seeds,
            "random points belong": self.members,
            "arrays of another shape do not belong": self.another_shape,
            "arrays with NaN do not belong": self.missing,
            "projection does not move points of the manifold": self.projected,
            "projections of nearby arrays belong": self.nearby,
        }

    @cached_property
    def points(self) -> Array:
        return np.asarray(self.space.random_point(_N_POINTS, rng=self.rng))

    def shapes(self) -> float:
        alone, shape = self.space.random_point(rng=self.rng), self.space.shape
        return np.shape(alone) != shape or self.points.shape != (_N_POINTS, *shape)

    def drawn_anew(self) -> float:
        return np.array_equal(self.space.random_point(), self.space.random_point())

    def seeds(self) -> float:
        draw = self.space.random_point
        return not np.array_equal(draw(rng=3), draw(rng=3))

    def members(self) -> float:
        verdicts = np.asarray(self.space.belongs(self.points))
        return share(~verdicts) if verdicts.shape == (_N_POINTS,) else np.inf

    def another_shape(self) -> float:
        longer = np.concatenate([self.points, self.points[..., :1]], axis=-1)
        return share(self.space.belongs(longer))

    def missing(self) -> float:
        spoilt = self.points.copy()
        spoilt[0].flat[0] = np.nan
        return share(np.asarray(self.space.belongs(spoilt)) != (np.arange(_N_POINTS) > 0))

    def projected(self) -> float:
        return difference(self.space.projection(self.points), self.points)

    def nearby(self) -> float:
        noise = self.rng.standard_normal(self.points.shape)
        near = self.points + _NEAR * np.abs(self.points).max() * noise / np.abs(noise).max()
        return share(~np.asarray(self.space.belongs(self.space.projection(near))))


@dataclass(frozen=True)
class _TangentVectors:
    """Projections to the tangent spaces at random points."""

    space: Manifold
    rng: np.random.Generator

    def properties(self) -> Properties:
        properties = {
            "to_tangent does not change tangent vectors": self.projected,
            "to_tangent is linear": self.linearity,
            "results for a stack of tangent vectors are those of each vector": self.stack,
            "random tangent vectors are tangent": self.random_vectors,
        }
        if np.prod(self.space.shape) <= _MOST_COORDINATES:
            properties["tangent spaces have dimension dim"] = self.dimension
        return properties

    @cached_property
    def points(self) -> Array:
        return np.asarray(self.space.random_point(_N_POINTS, rng=self.rng))

    @cached_property
    def noise(self) -> Array:
        return self.rng.standard_normal((_N_POINTS, *self.space.shape))

    @cached_property
    def vectors(self) -> Array:
        return np.asarray(self.space.to_tangent(self.noise, self.points))

    def projected(self) -> float:
        return difference(self.space.to_tangent(self.vectors, self.points), self.vectors)

    def linearity(self) -> float:
        shifted = np.roll(self.noise, 1, axis=0)
        together = self.space.to_tangent(2.0 * self.noise - 3.0 * shifted, self.points)
        tangent = np.asarray(self.space.to_tangent(shifted, self.points))
        return difference(together, 2.0 * self.vectors - 3.0 * tangent)

    def stack(self) -> float:
        pairs = zip(self.noise, self.points, strict=True)
        return difference([self.space.to_tangent(v, x) for v, x in pairs], self.vectors)

    def random_vectors(self) -> float:
        draw, tangent = self.space.random_tangent_vec, self.space.is_tangent
        at_each = np.asarray(draw(self.points, rng=self.rng))
        at_first = draw(self.points[0], 3, rng=self.rng)
        if at_each.shape != self.points.shape or np.shape(at_first) != (3, *self.space.shape):
            return np.inf
        verdicts = [*tangent(at_each, self.points), *tangent(at_first, self.points[0])]
        return share(~np.array(verdicts))

    def dimension(self) -> float:
        unit_vectors = np.eye(self.points[0].size)
        stack = unit_vectors.reshape(-1, *self.space.shape)
        projected = np.reshape(self.space.to_tangent(stack, self.points[0]), unit_vectors.shape)
        return abs(float(np.trace(projected)) - self.space.dim)
