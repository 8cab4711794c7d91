"""Fields of unit normals on a template, with the metric of a product of spheres."""

from __future__ import annotations

from typing import Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import real_array, values_of
from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry._field_metric import FieldMetric, TriangleFields
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.kernels import sphere
from riemhuman.kernels.surface import dot, refuse_triangles
from riemhuman.terms.normals import NormalTerm
from riemhuman.terms.term import Fields


class NormalFields(TriangleFields):
    """C^∞(T, S²): a unit vector on every triangle of a template.

    Parameters
    ----------
    template : Template
    equip : bool
        Whether to equip the manifold with `NormalFieldMetric`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.NormalFields(bodies.template)
    >>> fields.shape, fields.dim
    ((2400, 3), 4800)
    """

    value_dim, value_shape = 2, (3,)

    def default_metric(self) -> type[RiemannianMetric]:
        return NormalFieldMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        point, finite = self._candidates(point, "point")
        return finite & np.all(np.abs(np.sqrt(dot(point, point)) - 1.0) <= atol, axis=-1)

    def to_tangent(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        return sphere.to_tangent(vector, self._needed_base_point(base_point))

    def projection(self, point: ndarray) -> ndarray:
        return point / np.sqrt(dot(point, point))[..., None]

    def check_point(self, point: Any, name: str = "point") -> ndarray:
        point = real_array(point, name, self.shape, rows=True)
        values = values_of(point)
        refuse_triangles(
            np.abs(dot(values, values) - 1.0) > 2e-6,
            f"{name} must hold unit vectors",
            ArgumentError,
        )
        return point


class NormalFieldMetric(FieldMetric):
    r"""The metric :math:`\int_T \langle\delta n, \delta n\rangle\, dx` of a product of spheres.

    The second term of equation 3 of the paper. Exponential, logarithm, geodesics and parallel
    transport are those of the sphere on every triangle.

    Parameters
    ----------
    space : NormalFields

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.NormalFields(bodies.template)
    >>> metric = rh.NormalFieldMetric(fields)
    >>> metric.geodesic(*fields.random_point(2, rng=0))([0.0, 0.5, 1.0]).shape
    (3, 2400, 3)
    """

    _term = NormalTerm()

    def _fields(self, point: Any, name: str) -> Fields:
        return (self.space.check_point(point, name),)

    def _products(self, a: ndarray, b: ndarray, point: ndarray) -> ndarray:
        return dot(a, b)

    def _exp(self, velocity: ndarray, point: ndarray) -> ndarray:
        return sphere.exp(velocity, point)

    def _log(self, point: ndarray, start: ndarray) -> ndarray:
        refuse_triangles(
            values_of(sphere.angle(start, point)) >= sphere.ANTIPODAL,
            "point must hold no normal antipodal to that of base_point, or there is no unique "
            "logarithm",
            OutsideManifoldError,
        )
        return sphere.log(start, point)

    def _transport(self, vector: ndarray, point: ndarray, velocity: ndarray) -> ndarray:
        return sphere.parallel_transport(vector, point, velocity)

    def _curvatures(self, a: ndarray, b: ndarray, point: ndarray) -> ndarray:
        # Spheres of radius 1 have curvature 1.
        return dot(a, a) * dot(b, b) - dot(a, b) ** 2
