"""Surfaces registered to a template, with the paper's family of elastic metrics."""

from __future__ import annotations

from typing import TYPE_CHECKING

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import (
    Rng,
    generator,
    real_array,
    real_number,
    refuse_triangles,
    values_of,
)
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry.manifold import Manifold, sample_count, stack_samples
from riemhuman.geometry.metric import ExpSolver, GeodesicSolver, LogSolver, RiemannianMetric
from riemhuman.geometry.metric_fields import EbinMetric, MetricFields
from riemhuman.geometry.normal_fields import NormalFields
from riemhuman.geometry.product import ProductManifold, ProductMetric
from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.kernels import ebin, surface
from riemhuman.kernels.sketches import cone_chart, patch_coordinates, triangle_patches

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class AlignedSurfaces(Manifold):
    """Maps f: T → R³ that are linear on the triangles of a template T.

    A point holds the vertices of a surface in the template's order: an open subset of the vector
    space of all (V, 3) arrays, so any such array is a tangent vector. Surfaces with triangles of
    no area lie on its boundary.

    Parameters
    ----------
    template : Template
        The template T.
    equip : bool
        Whether to equip the manifold with `ElasticMetric`.
    """

    def __init__(self, template: Template, equip: bool = True) -> None:
        self.template = template
        super().__init__(3 * template.n_vertices, (template.n_vertices, 3), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        """Return `ElasticMetric`."""
        return ElasticMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        """Tell whether all vertices are finite and all triangles have area.

        Parameters
        ----------
        point : array, shape (..., V, 3)
            Candidate surfaces.
        atol : float
            Not used: degenerate triangles are told by their angles.

        Returns
        -------
        array of bool, shape (...)
        """
        point, finite = self._finite_values(point, "point")
        return finite & ~np.any(self._is_degenerate(*self._derivatives(point)), axis=-1)

    def to_tangent(self, vector: ndarray, base_point: ndarray) -> ndarray:
        """Return the vector itself: every deformation is tangent.

        Parameters
        ----------
        vector : array, shape (..., V, 3)
            Deformations.
        base_point : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., V, 3)
        """
        return real_array(vector, "vector", self.shape)

    def random_point(self, n_samples: int = 1, rng: Rng = 0) -> ndarray:
        """Draw the template under random linear maps near the identity.

        Parameters
        ----------
        n_samples : int
            Number of surfaces.
        rng : int or numpy.random.Generator
            Seed, or the generator to draw from.

        Returns
        -------
        array, shape (n_samples, V, 3), or (V, 3) for one sample
        """
        noise = generator(rng).uniform(-1.0, 1.0, (sample_count(n_samples), 3, 3))
        maps = np.eye(3) + 0.2 * noise
        return stack_samples(self.template.vertices @ maps, n_samples)

    def to_fields(self, f: ndarray) -> tuple[ndarray, ndarray]:
        """Return Φ(f) = (g, n), the metric field and the normal field (equation 1).

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        g : array, shape (..., F, 2, 2)
            First fundamental forms in the orthonormal frames of the template's triangles.
        n : array, shape (..., F, 3)
            Unit normals.

        Raises
        ------
        DegenerateSurfaceError
            If a triangle has no area, so that it has no normal.
        """
        derivatives = self._derivatives(self.check_point(f, "f"))
        return surface.first_fundamental_form(*derivatives), self._normals(*derivatives)

    def metric_field(self, f: ndarray) -> ndarray:
        """Return the metric field g alone; triangles without area are legal.

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., F, 2, 2)
        """
        return surface.first_fundamental_form(*self._derivatives(self.check_point(f, "f")))

    def normal_field(self, f: ndarray) -> ndarray:
        """Return the normal field n alone.

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., F, 3)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle has no area, so that it has no normal.
        """
        return self._normals(*self._derivatives(self.check_point(f, "f")))

    def square_root_normals(self, f: ndarray) -> ndarray:
        """Return the square root normal field q = √A n, 0 on triangles without area.

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., F, 3)
        """
        return surface.square_root_normals(*self._derivatives(self.check_point(f, "f")))

    def to_fields_differential(
        self, tangent_vec: ndarray, base_point: ndarray
    ) -> tuple[ndarray, ndarray]:
        """Return dΦ(h), the derivatives of the metric and the normal field along h.

        Parameters
        ----------
        tangent_vec : array, shape (..., V, 3)
            Deformations h.
        base_point : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        delta_g : array, shape (..., F, 2, 2)
            Derivative of g.
        delta_n : array, shape (..., F, 3)
            Derivative of n.

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of a surface has no area.
        """
        derivatives = self._derivatives(self.check_point(base_point, "base_point"))
        self.refuse_degenerate(self._is_degenerate(*derivatives))
        change = self._derivatives(self.check_point(tangent_vec, "tangent_vec"))
        return (
            surface.first_fundamental_form_differential(*derivatives, *change),
            surface.unit_normals_differential(*derivatives, *change),
        )

    def check_point(self, point: ndarray, name: str = "point") -> ndarray:
        """Return surfaces as float64 arrays, or say what is wrong with them.

        Parameters
        ----------
        point : array_like, shape (..., V, 3)
            Surfaces; triangles without area are legal, as in the completion.
        name : str
            Name of the argument, for messages.

        Returns
        -------
        array, shape (..., V, 3)

        Raises
        ------
        ArgumentError
            If the number of vertices is not the template's, or an entry is not finite.
        """
        return real_array(point, name, self.shape)

    def check_immersed(self, f: ndarray, name: str = "f") -> ndarray:
        """Return surfaces as float64 arrays, refusing those with triangles without area.

        Parameters
        ----------
        f : array_like, shape (..., V, 3)
            Surfaces.
        name : str
            Name of the argument, for messages.

        Returns
        -------
        array, shape (..., V, 3)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle has no area, so that g is not invertible there and has no normal.
        """
        f = self.check_point(f, name)
        self.refuse_degenerate(self._is_degenerate(*self._derivatives(f)), name)
        return f

    def refuse_degenerate(self, degenerate: ndarray, name: str = "the surface") -> None:
        """Refuse surfaces with triangles without area.

        Parameters
        ----------
        degenerate : array of bool, shape (..., F)
            Which triangles of the surfaces have no area.
        name : str
            Name of the argument, for messages.

        Raises
        ------
        DegenerateSurfaceError
            If there is one.
        """
        refuse_triangles(
            degenerate,
            f"every triangle of {name} must have an area, for its normal to exist and g to be "
            "invertible",
            DegenerateSurfaceError,
        )

    def _derivatives(self, f: ndarray) -> tuple[ndarray, ndarray]:
        return surface.partial_derivatives(f, self.template.differential_operator)

    def _normals(self, f_u: ndarray, f_v: ndarray) -> ndarray:
        self.refuse_degenerate(self._is_degenerate(f_u, f_v))
        return surface.unit_normals(f_u, f_v)

    @staticmethod
    def _is_degenerate(f_u: ndarray, f_v: ndarray) -> ndarray:
        return surface.is_degenerate(values_of(f_u), values_of(f_v))


class ElasticMetric(SurfaceMetric):
    r"""The pull-back by Φ of a · (Ebin metric) + c · (metric of normal fields).

    .. math:: d(f_1, f_2)^2 = a\, d^\lambda(g_1, g_2)^2 + c\int_T d_{S^2}(n_1, n_2)^2\, dx

    Equations 3 to 5 of the paper. (a, λ, c) = (1, 1e-4, 0) tells who it is, (0, 0, 1) how they
    stand.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template.
    a : float
        Weight of the change of the first fundamental form, at least 0.
    lam : float
        λ, the weight of changes of area within it; above 0 unless a = 0, where it has no effect.
    c : float
        Weight of the change of the normals, at least 0.
    geodesic_solver : object, optional
        Strategy for geodesics, which have no closed form.
    exp_solver, log_solver : object, optional
        Strategies for `exp` and `log`, which have none either.

    Raises
    ------
    ArgumentError
        If a weight is negative, or all are 0, or λ = 0 with a > 0: the metric would be degenerate.
    """

    space: AlignedSurfaces

    def __init__(
        self,
        space: AlignedSurfaces,
        a: float = 1.0,
        lam: float = 1e-4,
        c: float = 0.0,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
    ) -> None:
        self._a = real_number(a, "a", minimum=0.0)
        self._lam = real_number(lam, "lam", minimum=0.0)
        self._c = real_number(c, "c", minimum=0.0)
        if self._a == self._c == 0:
            raise ArgumentError("a and c must not both be 0: every distance would be 0")
        if self._a > 0 and self._lam == 0:
            raise ArgumentError(
                "lam must be above 0 where a > 0 (found lam = 0): the Ebin metric would be "
                "degenerate; the normals alone are (a, lam, c) = (0, 0, 1)"
            )
        factors: list[Manifold] = []
        if self._a > 0:
            ebin = MetricFields(space.template).equip_with_metric(EbinMetric, lam=self._lam)
            factors.append(ebin)
        if self._c > 0:
            factors.append(NormalFields(space.template))
        weights = [weight for weight in (self._a, self._c) if weight > 0]
        self._product = ProductManifold(factors, equip=False)
        target = ProductMetric(self._product, weights)
        super().__init__(
            space,
            target,
            self._weighted_fields,
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
        )

    @property
    def a(self) -> float:
        """The weight of the Ebin metric."""
        return self._a

    @property
    def lam(self) -> float:
        """The weight λ of the change of area in the Ebin metric."""
        return self._lam

    @property
    def c(self) -> float:
        """The weight of the metric of normal fields."""
        return self._c

    def differential(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Return dΦ(h), the fields of positive weight joined as a tangent vector of the target.

        Parameters
        ----------
        tangent_vec : array, shape (..., V, 3)
            Deformations h.
        base_point : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., size)
        """
        return self._join(*self.space.to_fields_differential(tangent_vec, base_point))

    def lower_bound_coordinates(self, points: ndarray, n_patches: int | None = None) -> ndarray:
        """Return coordinates whose Euclidean distances are at most those of the metric.

        See `riemhuman.kernels.sketches`.

        Parameters
        ----------
        points : array, shape (..., V, 3)
            Surfaces.
        n_patches : int, optional
            Number of patches of triangles to average over; by default there is no averaging, and
            the bound is tightest.

        Returns
        -------
        array, shape (..., m)
        """
        template, patches = self.space.template, None
        if n_patches is not None:
            patches = triangle_patches(template.vertices, template.faces, n_patches)
        charts = []
        if self.a > 0:
            coordinates = ebin.coordinates(self.space.metric_field(points))
            charts.append(np.sqrt(self.a) * cone_chart(*coordinates, self.lam))
        if self.c > 0:
            charts.append(np.sqrt(self.c) * self.space.normal_field(points))
        sketches = [patch_coordinates(chart, template.face_areas, patches) for chart in charts]
        return np.concatenate(sketches, axis=-1)

    @property
    def _weights(self) -> dict[str, float]:
        return {"a": self.a, "lam": self.lam, "c": self.c}

    def _weighted_fields(self, f: ndarray) -> ndarray:
        metric_field = self.space.metric_field(f) if self.a > 0 else None
        normal_field = self.space.normal_field(f) if self.c > 0 else None
        return self._join(metric_field, normal_field)

    def _join(self, metric_field: ndarray | None, normal_field: ndarray | None) -> ndarray:
        weighted = ((metric_field, self.a), (normal_field, self.c))
        fields = [field for field, weight in weighted if weight > 0 and field is not None]
        return self._product.embed_to_product(fields)
