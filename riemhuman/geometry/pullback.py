"""The pull-back of a metric by a differentiable map."""

from __future__ import annotations

from collections.abc import Callable
from typing import Unpack

from numpy import ndarray

from riemhuman.checks import joint_shape, real_array
from riemhuman.geometry.manifold import Manifold
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.pairwise import Bulk, SumOfFactors
from riemhuman.geometry.strategies import Solvers


class PullbackMetric(RiemannianMetric):
    r"""The pull-back of any metric by any autograd-differentiable map φ.

    .. math:: \begin{split} \langle a, b\rangle_x &=
              \langle d_x\varphi(a), d_x\varphi(b)\rangle_{\varphi(x)}, \\
              d(x, y) &= d_{target}(\varphi(x), \varphi(y)) \end{split}

    `dist` is the distance of the images (equation 4 of the paper). It bounds the length of every
    path between x and y from below; `length` and `energy` are those of a path.

    Parameters
    ----------
    space : Manifold
    target_metric : RiemannianMetric
    map : callable
        φ, from arrays (..., \*space.shape) to (..., \*target_metric.space.shape), acting on each
        point of a batch by itself, written with `autograd.numpy`.
    **solvers : strategies, see `RiemannianMetric`

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> heights = rh.VectorSpace((bodies.template.n_vertices,))
    >>> metric = rh.PullbackMetric(space, heights.metric, lambda f: f[..., 1])
    >>> float(metric.dist(bodies[0], bodies[0] + [1.0, 0.0, 0.0]))
    0.0
    """

    def __init__(
        self,
        space: Manifold,
        target_metric: RiemannianMetric,
        map: Callable[[ndarray], ndarray],
        **solvers: Unpack[Solvers],
    ) -> None:
        super().__init__(space, **solvers)
        self._target_metric = target_metric
        self.map = map  # type: ignore[method-assign, assignment]

    @property
    def has_target_metric(self) -> bool:
        return True

    @property
    def target_metric(self) -> RiemannianMetric:
        return self._target_metric

    @property
    def has_closed_form_dist(self) -> bool:
        return self.target_metric.has_closed_form_dist

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray | None = None
    ) -> ndarray:
        base_point = self.space.check_point(base_point, "base_point")
        tangent_vec_a = real_array(tangent_vec_a, "tangent_vec_a", self.space.shape)
        image_a = image_b = self.differential(tangent_vec_a, base_point)
        if tangent_vec_b is not tangent_vec_a:
            tangent_vec_b = real_array(tangent_vec_b, "tangent_vec_b", self.space.shape)
            joint_shape(tangent_vec_a=tangent_vec_a, tangent_vec_b=tangent_vec_b)
            image_b = self.differential(tangent_vec_b, base_point)
        return self.target_metric.inner_product(image_a, image_b, self.map(base_point))

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        point_a = self.space.check_point(point_a, "point_a")
        point_b = self.space.check_point(point_b, "point_b")
        joint_shape(point_a=point_a, point_b=point_b)
        return self.target_metric.squared_dist(self.map(point_a), self.map(point_b))

    @property
    def bulk(self) -> Bulk:

        def image(points: ndarray) -> ndarray:
            return self.map(self.space.check_point(points, "points"))

        return SumOfFactors([(image, 1.0, self.target_metric.bulk)])

    def _squared_segments(self, path: ndarray) -> ndarray:
        return self.target_metric._squared_segments(self.map(path))
