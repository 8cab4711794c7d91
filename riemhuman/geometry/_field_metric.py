"""What fields over a template have in common, and the metrics on them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, joint_shape, real_array
from riemhuman.geometry.manifold import Manifold, sample_count, stack_samples
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk
from riemhuman.terms._sum import SumOfTerms
from riemhuman.terms.term import Fields, Term

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class TriangleFields(Manifold):
    """Fields with a value of one kind on every triangle of a template."""

    value_dim: int
    value_shape: tuple[int, ...]

    def __init__(self, template: Template, equip: bool = True) -> None:
        self.template, n_faces = template, template.n_faces
        super().__init__(self.value_dim * n_faces, (n_faces, *self.value_shape), equip)

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> ndarray:
        noise = generator(rng).standard_normal((sample_count(n_samples), *self.shape))
        return stack_samples(self.projection(noise), n_samples)


class FieldMetric(RiemannianMetric):
    """An integral over the triangles of a template, with closed forms on each."""

    _term: Term
    _fields: Callable[..., Fields]
    _products: Callable[[ndarray, ndarray, ndarray], ndarray]
    _curvatures: Callable[[ndarray, ndarray, ndarray], ndarray]

    def __init__(self, space: Manifold) -> None:
        super().__init__(space)

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        return self._form(self._products, tangent_vec_a, tangent_vec_b, base_point)

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        first, second = self._fields(point_a, "point_a"), self._fields(point_b, "point_b")
        joint_shape(point_a=first[0], point_b=second[0])
        return self._integral(self._term.squared_dist(first, second))

    @property
    def bulk(self) -> Bulk:
        fields = partial(self._fields, name="points")
        return SumOfTerms([self._term], self._template, fields)

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        r"""Return π√w of the smallest triangle, on which a way around has twice that length."""
        leading = () if base_point is None else np.shape(base_point)[: -self.space.point_ndim]
        return np.full(leading, np.pi * np.sqrt(self._template.face_areas.min()))

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        return self._form(self._curvatures, tangent_vec_a, tangent_vec_b, base_point)

    def _form(self, of_triangles: Callable[..., ndarray], a: Any, b: Any, point: Any) -> ndarray:
        """Integrate a form of two tangent vectors at a point."""
        point = self.space.check_point(point, "base_point")
        a = real_array(a, "tangent_vec_a", self.space.shape)
        b = real_array(b, "tangent_vec_b", self.space.shape)
        joint_shape(tangent_vec_a=a, tangent_vec_b=b, base_point=point)
        values = self._integral(of_triangles(a, b, point))
        return values + np.zeros(point.shape[: -self.space.point_ndim])

    @property
    def _template(self) -> Any:
        space = self.space.factors[0] if self.space.factors else self.space
        return space.template

    def _integral(self, values: ndarray) -> ndarray:
        return np.sum(values * self._template.face_areas, axis=-1)
