"""The paper's family of elastic metrics on aligned surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import metric_weight
from riemhuman.errors import ArgumentError
from riemhuman.geometry.manifold import Manifold
from riemhuman.geometry.metric_fields import EbinMetric, MetricFields
from riemhuman.geometry.normal_fields import NormalFields
from riemhuman.geometry.product import ProductManifold, ProductMetric
from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.kernels import ebin, ebin_tangent, sphere, surface
from riemhuman.kernels.sketches import cone_chart, patch_coordinates, triangle_patches
from riemhuman.kernels.sums import integrate
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces


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

    Notes
    -----
    Let κ be the largest coordinate over the least height of a triangle, the template's included,
    and ε = 2.2e-16. Rounding changes a distance, in double precision, by at most 4εκ times how far
    a surface moves when all triangles change by their own size; inner products of deformations
    that move no vertex by more than a height, by 4εκ times their norms. On slivers of aspect ratio
    1e6 that is 1e-9, and 1e-11 was the most that was found. Near surfaces, flat folds, antipodal
    normals and λ from 1e-8 to 1e4 cost nothing more. The entries of g do not come into it: by way
    of `AlignedSurfaces.metric_field`, κ² would count.
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
        self._a = metric_weight(a, "a")
        self._lam = metric_weight(lam, "lam")
        self._c = metric_weight(c, "c")
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
        weights = [w for w in (self._a, self._c) if w > 0]
        self._product = ProductManifold(factors)
        self._product.equip_with_metric(ProductMetric, weights=weights)
        super().__init__(
            space,
            self._product.metric,
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
        changes = self.space.to_fields_differential(tangent_vec, base_point)
        weighted = zip(changes, (self.a, self.c), strict=True)
        return self._product.embed_to_product([change for change, w in weighted if w > 0])

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        """Return the inner product of dΦ(h) and dΦ(k).

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., V, 3)
            Deformations h and k.
        base_point : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of a surface has no area.
        """
        base_point = self.space.check_immersed(base_point, "base_point")
        derivatives = self.space.partial_derivatives(base_point)
        vectors = [self.space.check_point(tangent_vec_a, "tangent_vec_a")]
        if tangent_vec_b is not tangent_vec_a:
            vectors.append(self.space.check_point(tangent_vec_b, "tangent_vec_b"))
        changes = [self.space.partial_derivatives(vector) for vector in vectors]
        areas = self.space.template.face_areas
        total: Any = 0.0
        if self.a > 0:
            strains = [ebin_tangent.whitened_differential(*derivatives, *h) for h in changes]
            values = ebin_tangent.whitened_inner_product(strains[0], strains[-1], self.lam)
            radii = ebin.coordinates_of_derivatives(*derivatives)[2]
            total = self.a * integrate(values * radii**2, areas)
        if self.c > 0:
            turns = [surface.unit_normals_differential(*derivatives, *h) for h in changes]
            total = total + self.c * integrate(surface.dot(turns[0], turns[-1]), areas)
        return total

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return the squared distance of Φ(f₁) and Φ(f₂) (equation 5).

        Parameters
        ----------
        point_a, point_b : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        DegenerateSurfaceError
            If c > 0 and a triangle has no area, so that it has no normal.
        """
        point_a = self.space.check_point(point_a, "point_a")
        point_b = self.space.check_point(point_b, "point_b")
        return self._squared_dist_of_fields(self._fields(point_a), self._fields(point_b))

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
            cones = self._cones(self.space.check_point(points, "points"))
            charts.append(np.sqrt(self.a) * cone_chart(*cones, self.lam))
        if self.c > 0:
            charts.append(np.sqrt(self.c) * self.space.normal_field(points))
        sketches = [patch_coordinates(chart, template.face_areas, patches) for chart in charts]
        return np.concatenate(sketches, axis=-1)

    @property
    def _weights(self) -> dict[str, float]:
        return {"a": self.a, "lam": self.lam, "c": self.c}

    def _fields(self, f: ndarray) -> tuple[ndarray, ...]:
        """Return what distances need: x, y, s of the cones if a > 0, normals if c > 0."""
        cones = self._cones(f) if self.a > 0 else ()
        normals = (self.space.normal_field(f),) if self.c > 0 else ()
        return *cones, *normals

    def _cones(self, f: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        # Not from g: slivers keep digits that the entries of g lose.
        return ebin.coordinates_of_derivatives(*self.space.partial_derivatives(f))

    def _squared_dist_of_fields(
        self, fields_a: Sequence[ndarray], fields_b: Sequence[ndarray]
    ) -> ndarray:
        areas = self.space.template.face_areas
        total: Any = 0.0
        if self.a > 0:
            cones = tuple(fields_a[:3]), tuple(fields_b[:3])
            values = ebin.squared_dist_of_coordinates(*cones, self.lam)
            total = self.a * integrate(values, areas)
        if self.c > 0:
            values = sphere.squared_dist(fields_a[-1], fields_b[-1])
            total = total + self.c * integrate(values, areas)
        return total

    def _squared_segments(self, path: ndarray) -> ndarray:
        fields, times = self._fields(path), (slice(None),) * (path.ndim - 3)
        before = [field[(*times, slice(None, -1))] for field in fields]
        after = [field[(*times, slice(1, None))] for field in fields]
        return self._squared_dist_of_fields(before, after)

    def _weighted_fields(self, f: ndarray) -> ndarray:
        metric_fields = (self.space.metric_field(f),) if self.a > 0 else ()
        normal_fields = (self.space.normal_field(f),) if self.c > 0 else ()
        return self._product.embed_to_product([*metric_fields, *normal_fields])
