"""Square root normal fields, the representation the paper compares with."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_array
from riemhuman.geometry.manifold import Manifold, sample_count, stack_samples
from riemhuman.geometry.metric import GeodesicSolver, RiemannianMetric
from riemhuman.geometry.surface_metric import SurfaceMetric
from riemhuman.kernels.sums import integrate
from riemhuman.kernels.surface import dot

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
    from riemhuman.surfaces.template import Template


class SquareRootNormalFields(Manifold):
    """The vector space of fields of vectors of R³ on a template, where q = √A n lives.

    Parameters
    ----------
    template : Template
        The template T.
    equip : bool
        Whether to equip the manifold with `FlatMetric`.
    """

    def __init__(self, template: Template, equip: bool = True) -> None:
        self.template = template
        super().__init__(3 * template.n_faces, (template.n_faces, 3), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        """Return `FlatMetric`."""
        return FlatMetric

    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        """Tell whether all entries are finite.

        Parameters
        ----------
        point : array, shape (..., F, 3)
            Candidate fields.
        atol : float
            Not used.

        Returns
        -------
        array of bool, shape (...)
        """
        return self._finite_values(point, "point")[1]

    def to_tangent(self, vector: ndarray, base_point: ndarray) -> ndarray:
        """Return the field itself: every field is tangent.

        Parameters
        ----------
        vector : array, shape (..., F, 3)
            Fields.
        base_point : array, shape (..., F, 3)
            Fields.

        Returns
        -------
        array, shape (..., F, 3)
        """
        return vector

    def random_point(self, n_samples: int = 1, rng: Rng = 0) -> ndarray:
        """Draw normal random fields.

        Parameters
        ----------
        n_samples : int
            Number of fields.
        rng : int or numpy.random.Generator
            Seed, or the generator to draw from.

        Returns
        -------
        array, shape (n_samples, F, 3), or (F, 3) for one sample
        """
        noise = generator(rng).standard_normal((sample_count(n_samples), *self.shape))
        return stack_samples(noise, n_samples)


class FlatMetric(RiemannianMetric):
    r"""The L² metric :math:`\int_T \langle a, b\rangle\, dx` on fields of vectors."""

    space: SquareRootNormalFields

    def inner_product(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        """Return Σ_t w_t ⟨a_t, b_t⟩.

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., F, 3)
            Fields.
        base_point : array, shape (..., F, 3)
            Field; the inner product is the same at all of them.

        Returns
        -------
        array, shape (...)
        """
        tangent_vec_a = real_array(tangent_vec_a, "tangent_vec_a", self.space.shape)
        tangent_vec_b = real_array(tangent_vec_b, "tangent_vec_b", self.space.shape)
        base_point = self.space.check_point(base_point, "base_point")
        product = integrate(dot(tangent_vec_a, tangent_vec_b), self.space.template.face_areas)
        return product + np.zeros(base_point.shape[:-2])

    def squared_dist(self, point_a: ndarray, point_b: ndarray) -> ndarray:
        """Return Σ_t w_t ‖a_t − b_t‖².

        Parameters
        ----------
        point_a, point_b : array, shape (..., F, 3)
            Fields.

        Returns
        -------
        array, shape (...)
        """
        difference = self.space.check_point(point_a, "point_a") - self.space.check_point(
            point_b, "point_b"
        )
        return integrate(dot(difference, difference), self.space.template.face_areas)

    def exp(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Return base_point + tangent_vec.

        Parameters
        ----------
        tangent_vec : array, shape (..., F, 3)
            Fields.
        base_point : array, shape (..., F, 3)
            Fields.

        Returns
        -------
        array, shape (..., F, 3)
        """
        tangent_vec = real_array(tangent_vec, "tangent_vec", self.space.shape)
        return self.space.check_point(base_point, "base_point") + tangent_vec

    def log(self, point: ndarray, base_point: ndarray) -> ndarray:
        """Return point − base_point.

        Parameters
        ----------
        point : array, shape (..., F, 3)
            Fields.
        base_point : array, shape (..., F, 3)
            Fields.

        Returns
        -------
        array, shape (..., F, 3)
        """
        base_point = self.space.check_point(base_point, "base_point")
        return self.space.check_point(point, "point") - base_point

    def _geodesic_between(self, start: ndarray, end: ndarray) -> Callable[[Any], ndarray]:
        return self.geodesic(start, initial_tangent_vec=self.log(end, start))


class SRNFMetric(SurfaceMetric):
    r"""The pull-back of the L² metric by the square root normal field :math:`q = \sqrt{A}\,n`.

    Section 5.2 of the paper; distances do not depend on the template.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template.
    geodesic_solver : object, optional
        Strategy for geodesics, which have no closed form.
    """

    space: AlignedSurfaces

    def __init__(
        self, space: AlignedSurfaces, geodesic_solver: GeodesicSolver | None = None
    ) -> None:
        target = SquareRootNormalFields(space.template).metric
        super().__init__(space, target, space.square_root_normals, geodesic_solver)

    @property
    def _weights(self) -> dict[str, float]:
        return {"b": 1.0}
