"""Manifolds, which can be equipped with a metric, and what is common to spaces of surfaces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self, TypeGuard

from riemhuman.arrays import Array, Points, Triangles
from riemhuman.checks import (
    checked,
    flag,
    real_array,
    refuse_type,
    values_of,
    whole_number,
)
from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.point_space import PointSpace
from riemhuman.kernels import surface
from riemhuman.surfaces.template import Template

# A class of metrics, each of which has parameters of its own.
MetricClass = Callable[..., RiemannianMetric]  # type: ignore[explicit-any]


class Manifold(PointSpace):
    r"""A manifold whose points and tangent vectors are arrays of the same shape.

    Subclasses define which arrays are points (`belongs`), projections to the tangent spaces
    (`to_tangent`) and examples (`random_point`). `metric` is what it was equipped with last.
    `riemhuman.testing.check_manifold` tries all three out.

    Parameters
    ----------
    dim : int
    shape : tuple of int
        Shape of one point.
    equip : bool
        Whether to equip the manifold with its default metric.

    Examples
    --------
    >>> class Positive(rh.Manifold):
    ...     def __init__(self):
    ...         super().__init__(1, (1,))
    ...
    ...     def belongs(self, point, atol=1e-9):
    ...         point = np.asarray(point)
    ...         if point.shape[-1:] != self.shape:
    ...             return np.zeros(point.shape[:-1], dtype=bool)
    ...         return point[..., 0] > 0
    ...
    ...     def to_tangent(self, vector, base_point=None):
    ...         return vector
    ...
    ...     def random_point(self, n_samples=1, bound=1.0, rng=None):
    ...         shape = (1,) if n_samples == 1 else (n_samples, 1)
    ...         return np.exp(np.random.default_rng(rng).uniform(-bound, bound, shape))
    >>> Positive().belongs(np.array([[2.0], [-1.0]])).tolist()
    [True, False]
    >>> rh.testing.check_manifold(Positive()).passed
    True
    """

    metric: RiemannianMetric

    factors: tuple[Manifold, ...] = ()
    """The factors of a product, each equipped with a metric."""

    @checked(equip=flag)
    def __init__(self, dim: int, shape: tuple[int, ...], equip: bool = True) -> None:
        super().__init__(dim, shape)
        if equip and self.default_metric() is not None:
            self.equip_with_metric()

    @property
    def is_equipped(self) -> bool:
        """Whether the manifold has a metric."""
        return hasattr(self, "metric")

    def default_metric(self) -> MetricClass | None:
        """Return the class of the manifold's default metric, if there is one."""
        return None

    def equip_with_metric(self, Metric: MetricClass | None = None, **metric_kwargs: object) -> Self:
        """Equip the manifold with a metric, `Metric(self, **metric_kwargs)`, and return it.

        Parameters
        ----------
        Metric : type, optional
            Subclass of `RiemannianMetric`; by default the manifold's own.
        **metric_kwargs
        """
        make = self.default_metric() if Metric is None else Metric
        if make is None:
            raise ArgumentTypeError(f"{type(self).__name__} has no default metric: pass one")
        self.metric = make(self, **metric_kwargs)
        return self


class SurfaceSpace(Manifold):
    """A manifold of surfaces over a template: what metrics and solvers need of one."""

    is_surface_space = True
    template: Template

    @property
    def faces(self) -> Triangles:
        """Vertex indices of each triangle, shape (F, 3)."""
        return self.template.faces

    def partial_derivatives(self, f: Points) -> tuple[Array, Array]:
        """Return f_u and f_v in orthonormal frames of the template, each of shape (..., F, 3).

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces, or deformations.
        """
        return surface.partial_derivatives(
            self.check_tangent_vec(f, "f"), self.template.differential_operator
        )

    def metric_field(self, f: Points) -> Array:
        """Return the metric field g alone, shape (..., F, 2, 2); triangles without area are legal.

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """
        return surface.first_fundamental_form(*self.partial_derivatives(f))

    def normal_field(self, f: Points) -> Array:
        """Return the normal field n alone, shape (..., F, 3).

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """
        return self._normals(*self.partial_derivatives(f))

    def check_tangent_vec(self, tangent_vec: object, name: str = "tangent_vec") -> Array:
        """Return deformations as float64 arrays after checking them, shape (..., V, 3).

        Parameters
        ----------
        tangent_vec : array_like, shape (..., V, 3)
            Deformations, of any size.
        name : str, for messages
        """
        vectors = self.as_array(tangent_vec, name)
        return real_array(vectors, name, self.shape)

    def check_immersed(self, f: object, name: str = "f") -> Array:
        """Return surfaces as float64 arrays if all their triangles have area, shape (..., V, 3).

        Parameters
        ----------
        f : array_like, shape (..., V, 3)
        name : str, for messages
        """
        f = self.check_tangent_vec(f, name)
        operator = self.template.differential_operator
        f_u, f_v = surface.partial_derivatives(values_of(f), operator)
        surface.refuse_degenerate(surface.is_degenerate(f_u, f_v), name)
        return f

    @staticmethod
    def _normals(f_u: Array, f_v: Array) -> Array:
        surface.refuse_degenerate(surface.is_degenerate(values_of(f_u), values_of(f_v)))
        return surface.unit_normals(f_u, f_v)


def holds_surfaces(space: PointSpace) -> TypeGuard[SurfaceSpace]:
    """Return whether points are surfaces over a template, in words that type checkers follow."""
    return space.is_surface_space


def surface_space(space: PointSpace) -> SurfaceSpace:
    """Return a space of surfaces; raise an ArgumentTypeError for any other space."""
    if not isinstance(space, PointSpace) or not holds_surfaces(space):
        refuse_type(space, "space", "a space of surfaces, such as AlignedSurfaces(template)")
    return space


def metric_of(space: object) -> RiemannianMetric:
    """Return the metric that a manifold was equipped with, or a metric given in its place."""
    if isinstance(space, RiemannianMetric):
        return space
    if not isinstance(space, Manifold) or not space.is_equipped:
        raise ArgumentTypeError(
            "space must be a manifold equipped with a metric, or the metric; found "
            f"{type(space).__name__}{' without one' if isinstance(space, Manifold) else ''}"
        )
    return space.metric


def manifold_of(metric: RiemannianMetric) -> Manifold:
    """Return the manifold that a metric is on; metrics may be on spaces that know none."""
    if not isinstance(metric.space, Manifold):
        refuse_type(metric.space, "space", "a Manifold")
    return metric.space


def sample_count(n_samples: int) -> int:
    """Return the number of random samples, at least 1."""
    return whole_number(n_samples, "n_samples", minimum=1)


def stack_samples(samples: Array, n_samples: int) -> Array:
    """Return samples without their first axis if there is only one."""
    return samples[0] if n_samples == 1 else samples
