"""Sobolev metrics of first and second order on surfaces."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse

from riemhuman.checks import metric_weight
from riemhuman.errors import ArgumentError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.midpoint_metric import MidpointMetric
from riemhuman.kernels.drift import still_path
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver
from riemhuman.terms import first_order, second_order, zeroth_order
from riemhuman.terms.first_order import FirstOrderWeights

_SEEN = {"a1": "keep all angles", "b1": "keep all areas", "c1": "keep all normals"}


class SobolevMetric(MidpointMetric):
    r"""The six-parameter family of H² metrics, with areas of the moving surface.

    .. math:: G_f(h, h) = \int a_0 |h|^2 + a_1 |dh_m|^2 + b_1 |dh_+|^2 + c_1 |dh_\perp|^2
              + d_1 |dh_0|^2 + a_2 |\Delta h|^2 \, dA

    The first-order parts are the change of angles, of area, of the normal, and the turn within the
    tangent plane, see `riemhuman.terms.first_order`; Δ is the cotangent Laplacian, see
    `riemhuman.terms.second_order`. The weights are those of Hartman, Sukurdeep, Klassen, Charon and
    Bauer, "Elastic shape analysis of surfaces with second-order Sobolev metrics", International
    Journal of Computer Vision 131, 2023. There is no closed-form distance: squared distances are
    energies of the paths that `geodesic_solver` finds.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template. Their triangles must have an area.
    a0, a1, b1, c1, d1, a2 : float
        Weights, at least 0. Where a body and its deformation grow s times larger, the cost by a0
        grows s⁴ times, that of the first order s² times, that of a2 not at all.
    geodesic_solver : object, optional
        Strategy for geodesics.
    exp_solver, log_solver : object, optional
        Strategies for `exp` and `log`.

    Raises
    ------
    ArgumentError
        If a weight is negative, or the metric would be degenerate; or a2 > 0 and more than two
        triangles share an edge.

    Notes
    -----
    a0 alone sees translations: with a0 = 0 they cost nothing. Besides, the metric must not be blind
    to a whole family of deformations: a0 > 0, or two of a1, b1 and c1, or a2 > 0 on a mesh without
    border. On an open mesh the Laplacian is taken at the vertices that triangles surround, so that
    a2 does not see harmonic deformations.

    Geodesics by midpoints need steps that are small against a triangle's turn: with ten segments,
    limbs may turn by a right angle.

    With a0 = d1 = a2 = 0 the metric is that of `GeneralElasticMetric` with a = a1/4, b = b1/8 and
    c = c1.
    """

    space: AlignedSurfaces

    def __init__(
        self,
        space: AlignedSurfaces,
        a0: float = 0.0,
        a1: float = 1.0,
        b1: float = 1.0,
        c1: float = 1.0,
        d1: float = 0.0,
        a2: float = 0.0,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
    ) -> None:
        super().__init__(space, geodesic_solver, exp_solver=exp_solver, log_solver=log_solver)
        given = {"a0": a0, "a1": a1, "b1": b1, "c1": c1, "d1": d1, "a2": a2}
        values = {name: metric_weight(value, name) for name, value in given.items()}
        self._a0, *first, self._a2 = values.values()
        self._first = FirstOrderWeights(*first)
        template = space.template
        if self._a2 > 0:
            self._surrounded = second_order.surrounded_vertices(template.faces, template.n_vertices)
        self._refuse_degenerate(values)

    def _refuse_degenerate(self, weights: dict[str, float]) -> None:
        seen = [name for name in _SEEN if weights[name] > 0]
        used = np.bincount(self.space.template.faces.ravel(), minlength=self.space.shape[0]) > 0
        closed = self._a2 > 0 and bool(np.all(self._surrounded == used))
        if self._a0 > 0 or len(seen) > 1 or closed:
            return
        found = ", ".join(f"{name} = {value:g}" for name, value in weights.items())
        kept = [_SEEN[name] for name in seen]
        kept += ["do not turn within the tangent plane"] if weights["d1"] > 0 else []
        kept += ["are harmonic inside"] if self._a2 > 0 else []
        blind = f"deformations that {' and '.join(kept)}" if kept else "all deformations"
        raise ArgumentError(
            f"the metric would be degenerate: {blind} would cost nothing (found {found}); let a0, "
            "or two of a1, b1 and c1, or on a mesh without border a2, be above 0"
        )

    @property
    def a0(self) -> float:
        """The weight of |h|²."""
        return self._a0

    @property
    def a1(self) -> float:
        """The weight of changes of angles."""
        return self._first.a1

    @property
    def b1(self) -> float:
        """The weight of changes of area."""
        return self._first.b1

    @property
    def c1(self) -> float:
        """The weight of changes of the normals."""
        return self._first.c1

    @property
    def d1(self) -> float:
        """The weight of turns within the tangent plane."""
        return self._first.d1

    @property
    def a2(self) -> float:
        """The weight of |Δh|²."""
        return self._a2

    @property
    def first_order_weights(self) -> FirstOrderWeights | None:
        """Weights of the first-order parts; None where the metric has others, a0 or a2."""
        return None if self._a0 > 0 or self._a2 > 0 else self._first

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        """Return the inner product of deformations.

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., V, 3)
            Deformations h and k.
        base_point : array, shape (..., V, 3)
            Surfaces f.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of a surface has no area.
        """
        f = self.space.check_immersed(base_point, "base_point")
        h = self.space.check_point(tangent_vec_a, "tangent_vec_a")
        k = h
        if tangent_vec_b is not tangent_vec_a:
            k = self.space.check_point(tangent_vec_b, "tangent_vec_b")
        template = self.space.template
        over = template.differential_operator, template.face_areas
        total: Any = 0.0
        if any(self._first):
            total = first_order.inner_product(h, k, f, self._first, *over)
        if self._a0 > 0:
            squared = zeroth_order.inner_product(h, k, f, *over, self._averages)
            total = total + self._a0 * squared
        if self._a2 > 0:
            bent = second_order.inner_product(h, k, f, *over, self._averages, self._surrounded)
            total = total + self._a2 * bent
        return total

    def metric_matrix(self, base_point: ndarray) -> sparse.csr_array:
        """Return the sparse matrix M of the metric: ⟨h, k⟩_f = h·(M k), vertices flattened.

        Parameters
        ----------
        base_point : array, shape (V, 3) or (n, V, 3)
            One surface f, or several to average over.

        Returns
        -------
        csr_array, shape (3V, 3V)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of a surface has no area.
        """
        surfaces = self.space.check_point(base_point, "base_point").reshape(-1, *self.space.shape)
        template = self.space.template
        over = template.differential_operator, template.face_areas, self._averages
        blocks = np.zeros((template.n_faces, 9, 9))
        others = sparse.csr_array((self.space.dim, self.space.dim))
        for f in surfaces:
            self.space.check_immersed(f, "base_point")
            first_order.add_blocks(blocks, f, template.faces, template.face_areas, self._first)
            masses = zeroth_order.vertex_areas(f, *over)
            if self._a0 > 0:
                others = others + self._a0 * zeroth_order.matrix(masses)
            if self._a2 > 0:
                bent = second_order.matrix(f, template.faces, masses, self._surrounded)
                others = others + self._a2 * bent
        return (template.assembler.assemble(blocks) + others) / len(surfaces)

    def squared_norms_and_slopes(
        self, vectors: ndarray, surfaces: ndarray
    ) -> tuple[float, ndarray, ndarray]:
        """Return the sum of the squared norms of deformations, each at its surface, and its slopes.

        Parameters
        ----------
        vectors, surfaces : array, shape (V, n, 3)
            Deformations and surfaces, vertex by vertex.

        Returns
        -------
        value : float
            Infinite where a triangle has no area.
        vector_slopes, surface_slopes : array, shape (V, n, 3)
            Slopes in the deformations and in the surfaces.
        """
        template = self.space.template
        arrays, parts = (vectors, surfaces, template.faces), []
        if any(self._first):
            found = first_order.squared_norms_and_slopes(*arrays, template.face_areas, self._first)
            parts.append((1.0, found))
        if self._a0 > 0:
            parts.append((self._a0, zeroth_order.squared_norms_and_slopes(*arrays)))
        if self._a2 > 0:
            found = second_order.squared_norms_and_slopes(*arrays, self._surrounded)
            parts.append((self._a2, found))
        value = sum(weight * part[0] for weight, part in parts)
        in_vectors = np.add.reduce([weight * part[1] for weight, part in parts])
        return value, in_vectors, np.add.reduce([weight * part[2] for weight, part in parts])

    def remove_drift(self, path: ndarray) -> ndarray:
        """Take translations out of a path that the metric does not see, where a0 = 0.

        Parameters
        ----------
        path : array, shape (n_times, V, 3)
            Path.

        Returns
        -------
        array, shape (n_times, V, 3)
            A path of the same energy with the same ends.
        """
        path = self.check_points(path, "path")
        if self._a0 > 0:
            return path
        return still_path(path, self.space.template.vertex_areas, rotations=False)
