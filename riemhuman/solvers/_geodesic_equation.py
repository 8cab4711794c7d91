r"""The discrete geodesic equation: of three points, the second is halfway between the others.

The middle point y of a discrete geodesic (x, y, z) makes d²(x, y) + d²(y, z) stationary,

.. math:: \partial_y\left(d^2(x, y) + d^2(y, z)\right) = 0.

Solved for z, the equation continues a geodesic; solved for y, it halves a segment; solved for x = y
− v + w and z = y + v + w, it starts a geodesic with a velocity (Rumpf and Wirth, "Variational time
discretization of geodesic calculus", IMA Journal of Numerical Analysis 35, 2015; the symmetric
start is ours, and makes the scheme second order in the time step).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from autograd.core import make_vjp

from riemhuman.arrays import Array, Points
from riemhuman.errors import RiemhumanError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import holds_surfaces, surface_space
from riemhuman.kernels.drift import centroid
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.solvers._preconditioners import metric_factor
from riemhuman.solvers.paths import rounded, rounding_energy
from riemhuman.surfaces.deformation_basis import DeformationBasis

# A triangle whose normal rotates further within one time step, by more than 120°, has turned over.
_LEAST_COSINE = -0.5

# Of a rotation by 60 degrees.
_FAR_COSINE = 0.5

# Least squared distance of the ends of a short segment, as a share of its squared norm.
_LEAST_SHARE = 0.85

# One time step cannot move a surface by this many times its size.
_FAR = 100.0

# Ridge of the metric's matrix of surfaces: a larger one hides how easily a whole limb moves.
_RIDGE = 1e-6

# Relative changes of a point's entries that count as rounding errors.
_ROUNDING = 1e-7

# Earlier steps that the search for a root combines.
_MEMORY = 20

# A step of that search is halved while the residual would grow by more than this factor.
_GROWTH = 2.0
_MOST_HALVINGS = 8


class Triple(NamedTuple):
    r"""Points x, y and z, shape (3, \*shape); `error` is a share of the length of two segments."""

    points: Points
    n_iterations: int = 0
    n_evaluations: int = 0
    error: float = 0.0


@dataclass(frozen=True)
class GeodesicEquation:
    """The equation for one metric, with the unknown point in a basis or free in all coordinates."""

    metric: RiemannianMetric
    basis: DeformationBasis | None = None
    tolerance: float = 1e-8
    max_iter: int = 50

    def next_point(self, before: Array, middle: Array) -> Triple:
        """Continue from x and y by one more segment of the same velocity."""
        guess = 2.0 * middle - before

        def triple(shift: Array) -> Array:
            return np.stack([before, middle, self._project(guess + shift)])

        return self._solve(triple, middle, -4.0, 4.0 * self._squared_dist(before, middle))

    def both_sides(self, middle: Array, displacement: Array) -> Triple:
        """Find the points y ± v + w around y."""

        def triple(shift: Array) -> Array:
            before = self._project(middle - displacement + shift)
            return np.stack([before, middle, self._project(middle + displacement + shift)])

        squared_norm = float(self.metric.squared_norm(displacement, middle))
        return self._solve(triple, middle, -8.0, 4.0 * squared_norm)

    def middle_point(self, start: Points, end: Points) -> Triple:
        """Halve the segment between x and z."""
        guess = self._project(0.5 * (start + end))

        def triple(shift: Array) -> Array:
            return np.stack([start, self._project(guess + shift), end])

        return self._solve(triple, guess, 8.0, self._squared_dist(start, end))

    def velocity(self, before: Array, middle: Array, after: Array) -> Array:
        """Return the velocity at y, for unit time from x to y and from y to z."""
        return self.metric.space.to_tangent(0.5 * (after - before), middle)

    def _project(self, point: Points) -> Array:
        return self.metric.space.projection(point)

    def _squared_dist(self, start: Points, end: Points) -> float:
        return float(self.metric.energy(np.stack([start, end])))

    @single_threaded_libraries()
    def _solve(
        self,
        triple: Callable[[Array], Array],
        middle: Array,
        derivative: float,
        energy: float,
    ) -> Triple:
        """Solve for the shift; the derivative is about this factor times the metric's matrix."""
        # The energy of two segments is 2 (d²(x, y) + d²(y, z)). With the metric's matrix G, its
        # gradient by y is about 4 G (2y − x − z): it changes by −4 G with z alone, by −8 G with x
        # and z, and by 8 G with y.
        metric, shape = self.metric, middle.shape
        # A step may be no longer than rounding errors.
        near = self._project(rounded(middle, _ROUNDING))
        unit = max(energy, self._squared_dist(middle, near)) or 1.0
        directions = None if self.basis is None else self.basis.flat
        metric.space.warn_of_tears(middle, directions)
        factor = metric_factor(
            metric, middle[None], unit / abs(derivative), directions, ridge=_RIDGE
        )
        scale = np.sign(derivative) / unit

        def shift_of(variables: Array) -> Array:
            if directions is not None:
                combined: Array = variables @ directions
                return combined.reshape(shape)
            shift = variables.reshape(shape)
            if metric.is_translation_invariant:
                # Without translations, which the metric ignores, centroids move uniformly.
                shift = shift - centroid(shift, surface_space(metric.space).template.vertex_areas)
            return shift

        def equation(variables: Array) -> tuple[Array, Array] | None:
            points = triple(shift_of(variables))
            is_surface = metric.space.is_surface_space
            if is_surface and np.abs(points - middle).max() > _FAR * np.ptp(middle):
                return None
            if not np.all(metric.space.belongs(points)):
                return None
            energy, gradient = metric.energy_and_gradient(points)
            if not np.isfinite(energy):
                return None
            pull_back, _ = make_vjp(metric.space.projection, points[1])
            slope = scale * np.ravel(pull_back(gradient[1]))
            if directions is not None:
                slope = directions @ slope
            return factor.inverse(slope[:, None])[:, 0], slope

        start = np.zeros(middle.size if directions is None else len(directions))
        root = find_root(equation, start, tolerance=self.tolerance, max_iter=self.max_iter)
        points = triple(shift_of(root.x))
        return Triple(points, root.n_iterations, root.n_evaluations, root.residual)


def has_long_step(metric: RiemannianMetric, path: Points, all_coordinates: bool) -> bool:
    """Return whether a step of surfaces is too long for the equation to have one solution."""
    # Triangles then shrink to nothing and grow again, at a cost that does not depend on how much
    # they change. Over all coordinates a triangle that rotates by more than 60 degrees may have two
    # next points, as in a fold of skin that snaps.
    space = metric.space
    if not holds_surfaces(space):
        return False
    if all_coordinates:
        normals = space.normal_field(path)
        if np.sum(normals[:-1] * normals[1:], axis=-1).min() < _FAR_COSINE:
            return True
    if not np.all(space.belongs(path)):
        return True
    steps = np.diff(path, axis=0)
    norms = metric.squared_norm(steps, path[:-1]) + metric.squared_norm(steps, path[1:])
    energies = [float(metric.energy(path[k : k + 2])) for k in range(len(steps))]
    # Distances between surfaces that are the same up to rounding say nothing.
    floor = rounding_energy(metric, path[0])
    return bool(np.any(np.add(energies, floor) < _LEAST_SHARE * 0.5 * norms))


def degeneration(metric: RiemannianMetric, before: Array, after: Array) -> str:
    """Return how a step has left the manifold, or "" if it has not."""
    space = metric.space
    if not np.isfinite(after).all():
        return "entries are not finite"
    if not np.all(space.belongs(after)):
        check = space.check_immersed if holds_surfaces(space) else space.check_point
        try:
            check(after, "the next point")
        except RiemhumanError as error:
            return str(error)
        return "the next point leaves the manifold"
    if not holds_surfaces(space):
        return ""
    cosines = np.sum(space.normal_field(before) * space.normal_field(after), axis=1)
    worst = int(np.argmin(cosines))
    if cosines[worst] >= _LEAST_COSINE:
        return ""
    return f"triangle {worst} degenerates: its normal has turned over"


class Root(NamedTuple):
    """The best point evaluated, shape (n,), with the norm of the function there."""

    x: Array
    residual: float
    n_iterations: int
    n_evaluations: int


class _Pair(NamedTuple):
    """A step, and the changes of F(x) and A F(x) along it."""

    step: Array
    change: Array
    dual_change: Array


def find_root(
    function: Callable[[Array], tuple[Array, Array] | None],
    start: Points,
    *,
    tolerance: float,
    max_iter: int,
) -> Root:
    """Find a root of a function F whose derivative is near the identity."""
    # Anderson acceleration of x ← x − F(x) (Walker and Ni, SIAM Journal on Numerical Analysis 49,
    # 2011). The function returns F(x) and A F(x), with a positive matrix A that measures lengths,
    # or None outside its domain. Steps that leave it, or make F much larger, are halved.
    x, values = start, function(start)
    n_evaluations = 1
    if values is None:
        return Root(start, np.inf, 0, n_evaluations)
    value, dual = values
    best = Root(x, _length(value, dual), 0, n_evaluations)
    memory: deque[_Pair] = deque(maxlen=_MEMORY)
    for iteration in range(1, max_iter + 1):
        if best.residual <= tolerance:
            break
        direction = -value
        if memory:
            steps = np.array([pair.step for pair in memory])
            changes = np.array([pair.change for pair in memory])
            duals = np.array([pair.dual_change for pair in memory])
            weights = np.linalg.lstsq(changes @ duals.T, changes @ dual, rcond=None)[0]
            direction = weights @ (changes - steps) - value
        for _ in range(_MOST_HALVINGS):
            values = function(x + direction)
            n_evaluations += 1
            if values is not None:
                residual = _length(*values)
                if residual <= _GROWTH * _length(value, dual):
                    break
            direction = 0.5 * direction
        if values is None:
            break
        memory.append(_Pair(direction, values[0] - value, values[1] - dual))
        x = x + direction
        value, dual = values
        if residual < best.residual:
            best = Root(x, residual, iteration, n_evaluations)
    return best._replace(n_evaluations=n_evaluations)


def _length(value: Array, dual: Array) -> float:
    # Rounding errors alone make it negative.
    return float(np.sqrt(max(float(value @ dual), 0.0)))
