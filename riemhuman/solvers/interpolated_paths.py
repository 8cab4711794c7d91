"""Paths interpolated without a search: triangles that rotate, and parameters of a body model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array, Integers, Points
from riemhuman.checks import a_function, checked, real_array, whole
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import surface_space
from riemhuman.geometry.strategies import PathEnergy
from riemhuman.kernels.threads import check_interrupt
from riemhuman.solvers._alignment import align_ends
from riemhuman.solvers.paths import (
    PathSolver,
    SegmentEnergy,
    check_end_points,
    known_path,
    linear_path,
)
from riemhuman.solvers.results import PathResult

# A part with this share of the area is a limb. Up to this many of the largest limbs are tried both
# ways, each at the cost of one path; smaller parts, mostly a few triangles, are tried together.
_LIMB = 0.01
_MOST_LIMBS = 8

# A path within this factor of the least energy may still lead to less once it is minimised.
_CLOSE = 1.1


@checked(n_nodes=whole(minimum=2))
@dataclass(frozen=True)
class PoissonPath(PathSolver):
    """The path of surfaces whose triangles rotate and stretch uniformly: limbs do not collapse.

    The surface at time t fits the rotated and stretched triangles best, by a Poisson equation as in
    deformation transfer. Triangles rotate by the smaller angle. If neighbours then rotate in
    different directions, as in a limb that rotates by about 180°, each limb rotates by the smaller
    angle or like its neighbours, whichever has less energy. If the metric ignores rotations and
    translations, the ends are first aligned as by `BasisPath`.

    Parameters
    ----------
    n_nodes : int
        Number of points of the path, both ends included.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.AlignedSurfaces(bodies.template).metric
    >>> rh.solvers.PoissonPath(n_nodes=5).solve(metric, bodies[0], bodies[2]).path.shape
    (5, 1202, 3)
    """

    n_nodes: int = 11

    def solve(self, metric: RiemannianMetric, start: Points, end: Points) -> PathResult:
        start, end = check_end_points(metric, start, end)
        ends = align_ends(metric, start, end)
        best = rotating_paths(metric, SegmentEnergy(), start, ends.end, self.n_nodes)[0]
        path = ends.turned_back(best.path)
        return known_path(metric, path, "interpolated deformation gradients")


class RotatingPath(NamedTuple):
    """A path whose triangles rotate, and which of its parts rotate like their neighbours."""

    path: Array
    energy: float
    follows: tuple[bool, ...]


def rotating_paths(
    metric: RiemannianMetric,
    energy: PathEnergy,
    start: Points,
    end: Points,
    n_nodes: int,
) -> list[RotatingPath]:
    """Return the best path whose triangles rotate, then others that may become better."""
    space = surface_space(metric.space)
    space.check_immersed(start, "start")
    space.check_immersed(end, "end")
    interpolator = space.template.interpolator
    shorter = interpolator.rotations(start, end)
    alike = interpolator.unwrap(shorter)
    # Where neighbours would rotate by whole turns more than by the smaller angle.
    parts = interpolator.parts(np.linalg.norm(alike - shorter, axis=1) > np.pi)
    parts, n_limbs = _limbs_first(parts, space.template.face_areas)
    times = np.linspace(0.0, 1.0, n_nodes)[1:-1]
    known: dict[tuple[bool, ...], RotatingPath] = {}

    def rotating_path(follows: tuple[bool, ...]) -> RotatingPath:
        if follows in known:
            return known[follows]
        rotations = shorter.copy()
        for part, is_alike in zip(parts, follows, strict=True):
            if is_alike:
                rotations[part] = alike[part]
        path = linear_path(start, end, n_nodes)
        path[1:-1] = interpolator.interpolate(start, end, times, rotations)
        check_interrupt()
        known[follows] = RotatingPath(path, energy.value(metric, path), follows)
        return known[follows]

    best = rotating_path((False,) * len(parts))
    all_alike = rotating_path((True,) * len(parts))
    if all_alike.energy < best.energy:
        best = all_alike
    rivals: list[RotatingPath] = []
    for number in range(len(parts)):
        follows = list(best.follows)
        follows[number] = not follows[number]
        alternative = rotating_path(tuple(follows))
        if alternative.energy < best.energy:
            best, alternative = alternative, best
        # The energy is only a little higher where a whole limb rotates the other way.
        if number < n_limbs:
            rivals.append(alternative)
    return [best, *(rival for rival in rivals if rival.energy <= _CLOSE * best.energy)]


def _limbs_first(parts: list[Integers], areas: Array) -> tuple[list[Integers], int]:
    """Return the limbs, then all smaller parts as one, and the number of limbs."""
    is_limb = [areas[part].sum() >= _LIMB * areas.sum() for part in parts[:_MOST_LIMBS]]
    n_limbs = is_limb.count(True)  # the first parts, as they are the largest
    limbs, small_parts = parts[:n_limbs], parts[n_limbs:]
    if small_parts:
        return [*limbs, np.concatenate(small_parts)], n_limbs
    return limbs, n_limbs


class ModelParameters(NamedTuple):
    """Parameters of a body model that give one surface.

    Attributes
    ----------
    betas : array, shape (B,)
        Shape coefficients.
    pose : array, shape (J, 3) or (3 J,)
        Axis-angle rotation of each joint, radians.
    trans : array, shape (3,)
        Translation, metres.

    Examples
    --------
    >>> rh.solvers.ModelParameters(np.zeros(10), np.zeros((24, 3)), np.zeros(3)).pose.shape
    (24, 3)
    """

    betas: Array
    pose: Array
    trans: Array

    def __repr__(self) -> str:
        shapes = (f"{name}=<array {np.shape(part)}>" for name, part in self._asdict().items())
        return f"ModelParameters({', '.join(shapes)})"


@checked(model=a_function, n_nodes=whole(minimum=2), parameters=a_function)
@dataclass(frozen=True)
class ModelPath(PathSolver):
    """The path of a body model whose parameters change evenly from one body to another.

    The SMPL path of section 5.2 of the paper; axis-angle vectors change linearly as well. It runs
    between surfaces of the model; the result's message states how far they are from the end points.

    Parameters
    ----------
    model : callable
        Body model: maps betas, pose and trans to surfaces, as `BodyModel` does.
    n_nodes : int
        Number of points of the path, both ends included.
    parameters : callable
        Maps a surface, shape (V, 3), to its `ModelParameters`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric, model = rh.AlignedSurfaces(bodies.template).metric, bodies.model
    >>> def parameters(f):
    ...     fit = model.fit(f)
    ...     return rh.solvers.ModelParameters(fit.betas, fit.pose, fit.trans)
    >>> solver = rh.solvers.ModelPath(model, n_nodes=3, parameters=parameters)
    >>> solver.solve(metric, bodies[0], bodies[1]).path.shape
    (3, 1202, 3)
    """

    model: Callable[[Array, Array, Array], Array]
    n_nodes: int = 11
    parameters: Callable[[Array], ModelParameters] = field(kw_only=True)

    def solve(self, metric: RiemannianMetric, start: Points, end: Points) -> PathResult:
        start, end = check_end_points(metric, start, end)
        of_start = self._parameters(start, "start")
        of_end = self._parameters(end, "end")
        betas = linear_path(of_start.betas, of_end.betas, self.n_nodes)
        pose = linear_path(of_start.pose, of_end.pose, self.n_nodes)
        trans = linear_path(of_start.trans, of_end.trans, self.n_nodes)
        path = metric.check_points(self.model(betas, pose, trans), "the model's surfaces")
        gap = np.linalg.norm(path[[0, -1]] - [start, end], axis=-1).max()
        message = f"the model's surfaces are up to {1000.0 * gap:.3g} mm from start and end"
        return known_path(metric, path, message)

    def _parameters(self, surface: Points, name: str) -> ModelParameters:
        name = f"parameters({name})"
        betas, pose, trans = self.parameters(surface)
        return ModelParameters(
            real_array(betas, f"betas of {name}", ("n_betas",), batched=False),
            real_array(pose, f"pose of {name}").reshape(-1, 3),
            real_array(trans, f"trans of {name}", (3,), batched=False),
        )
