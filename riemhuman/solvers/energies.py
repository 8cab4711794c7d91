r"""Path energies, :math:`E = \int_0^1 \|\dot x\|^2 dt`, of discrete paths."""

from __future__ import annotations

from dataclasses import dataclass

import autograd.numpy as np
from autograd import value_and_grad
from numpy import ndarray

from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import PathEnergy


@dataclass(frozen=True)
class SegmentEnergy(PathEnergy):
    """n Σ d²(x_i, x_{i+1}) over n segments, in closed form where the metric has one.

    It is never below d²(x_0, x_n), needs no exponential map, and does not decrease when a path
    is refined in time.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> energy = rh.solvers.SegmentEnergy()
    >>> solver = rh.solvers.LinearPath(n_nodes=5, energy=energy)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> bool(solver.solve(metric, bodies[0], bodies[2]).energy > 0)
    True
    """

    def value(self, metric: RiemannianMetric, path: ndarray) -> float:
        return float(metric.energy(path))

    def value_and_gradient(self, metric: RiemannianMetric, path: ndarray) -> tuple[float, ndarray]:
        return metric.energy_and_gradient(path)


@dataclass(frozen=True)
class FiniteDifferenceEnergy(PathEnergy):
    """n Σ ‖x_{i+1} − x_i‖² over n segments, by the inner product at their midpoints.

    The paper's form of the energy (equation 7), of second order in the time step.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> energy = rh.solvers.FiniteDifferenceEnergy()
    >>> solver = rh.solvers.LinearPath(n_nodes=5, energy=energy)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> bool(solver.solve(metric, bodies[0], bodies[2]).energy > 0)
    True
    """

    def value(self, metric: RiemannianMetric, path: ndarray) -> float:
        return float(self._energy(metric, metric.check_points(path, "path")))

    def value_and_gradient(self, metric: RiemannianMetric, path: ndarray) -> tuple[float, ndarray]:
        energy = value_and_grad(lambda points: self._energy(metric, points))
        value, gradient = energy(metric.check_points(path, "path"))
        return float(value), gradient

    def _energy(self, metric: RiemannianMetric, path: ndarray) -> ndarray:
        start, end = path[:-1], path[1:]
        middle = metric.space.projection(0.5 * (start + end))
        return (len(path) - 1) * np.sum(metric.squared_norm(end - start, middle))
