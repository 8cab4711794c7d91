"""Metrics on aligned surfaces that are pulled back through first derivatives, in compiled form."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any

import autograd.numpy as np
from numpy import ndarray
from scipy import sparse

from riemhuman.checks import one_of, values_of
from riemhuman.geometry.pairwise import PRECISIONS, Points
from riemhuman.geometry.pullback import PullbackMetric
from riemhuman.kernels.drift import still_path
from riemhuman.kernels.known_gradient import with_known_gradient
from riemhuman.kernels.threads import quadratic_form

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces


class SurfaceMetric(PullbackMetric):
    """A pull-back to aligned surfaces whose bulk work runs in fused loops.

    Subclasses give the weights of those loops: (a, lam, c) of the elastic metric, b of square
    root normal fields.
    """

    space: AlignedSurfaces

    @property
    def _weights(self) -> dict[str, float]:
        """Weights of the fused loops."""
        raise TypeError(f"{type(self).__name__} must say the weights of the fused loops")

    def energy(self, path: ndarray) -> ndarray:
        """Return the closed-form energy n Σ d²(f_i, f_{i+1}) of paths with n segments.

        One path runs in compiled loops, which autograd knows with their gradient; several run by
        the definition.

        Parameters
        ----------
        path : array, shape (..., n_times, V, 3)
            Paths.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        DegenerateSurfaceError
            If the metric needs a normal of a triangle without area.
        """
        if values_of(path, "path").ndim == 3:
            energy = self._compiled_energy(path)
            if np.isfinite(energy):
                return energy
        return super().energy(path)

    @cached_property
    def _compiled_energy(self) -> Callable[[Any], Any]:
        return with_known_gradient(self.energy_and_gradient, super().energy)

    def __getstate__(self) -> dict[str, Any]:
        # The primitive is made anew by whoever gets the copy: it knows the metric it was made of.
        return {key: value for key, value in vars(self).items() if key != "_compiled_energy"}

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the closed-form energy of one path and its gradient, in one compiled pass.

        Parameters
        ----------
        path : array, shape (n_times, V, 3)
            Path.

        Returns
        -------
        energy : float
            Infinite where the metric needs a normal of a triangle without area.
        gradient : array, shape (n_times, V, 3)
            Derivatives with respect to all vertices.
        """
        # Loading numba takes longer than a single distance does, so bulk work alone pays for it.
        from riemhuman.kernels.compiled import path_energy

        template = self.space.template
        return path_energy(
            self._check_path(self.check_points(path, "path")),
            template.faces,
            template.frame_coefficients,
            template.face_areas,
            **self._weights,
        )

    def features(self, points: Points, precision: str = "double") -> tuple[ndarray, ...]:
        """Return the features of the fields of surfaces, in one compiled pass over each.

        Parameters
        ----------
        points : array or sequence, shape (n, V, 3)
            Surfaces.
        precision : {"single", "double"}
            Precision to keep them in.

        Returns
        -------
        tuple of array, each of shape (n, ...)

        Raises
        ------
        DegenerateSurfaceError
            If the metric needs a normal of a triangle without area.
        """
        from riemhuman.kernels import compiled_features as compiled

        one_of(precision, "precision", PRECISIONS)
        surfaces = self.space.check_point(self.check_points(points), "points")
        template = self.space.template
        arrays = (surfaces, template.faces, template.frame_coefficients, template.face_areas)
        weights = self._weights
        features: tuple[ndarray, ...] = ()
        if weights.get("a", 0.0) > 0:
            lam = weights["lam"]
            features += compiled.surface_metric_field_features(*arrays, lam, precision)
        if weights.get("c", 0.0) > 0:
            *normals, degenerate = compiled.surface_normal_features(*arrays, precision)
            self.space.refuse_degenerate(degenerate)
            features += tuple(normals)
        if weights.get("b", 0.0) > 0:
            features += compiled.surface_root_normal_features(*arrays, precision)
        return features

    def remove_drift(self, path: ndarray) -> ndarray:
        """Take rigid motions out of a path that the metric does not see.

        No metric of the family sees translations of a surface, and those without normals (c = 0)
        see no rotations either: a minimiser of the energy is free to drift. Of all paths that
        differ by such motions of the interior surfaces, this one keeps as much of the body as it
        can on the straight path between the ends, by the sum of distances.

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
        sees_rotations = any(self._weights.get(name, 0.0) > 0 for name in ("b", "c"))
        return still_path(path, self.space.template.vertex_areas, rotations=not sees_rotations)

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
        from riemhuman.kernels.compiled_surfaces import add_elastic_blocks

        surfaces = self.space.check_point(base_point, "base_point").reshape(-1, *self.space.shape)
        template = self.space.template
        blocks = np.zeros((template.n_faces, 9, 9))
        for f in surfaces:
            self.space.check_immersed(f, "base_point")
            add_elastic_blocks(blocks, f, template.faces, template.face_areas, **self._weights)
        return template.assembler.assemble(blocks / len(surfaces))

    def covector(self, tangent_vec: ndarray, base_point: ndarray) -> ndarray:
        """Lower the index of tangent vectors at one surface.

        Parameters
        ----------
        tangent_vec : array, shape (..., V, 3)
            Deformations.
        base_point : array, shape (V, 3)
            Surface.

        Returns
        -------
        array, shape (..., V, 3)
        """
        vectors = self.space.check_point(tangent_vec, "tangent_vec")
        columns = vectors.reshape(-1, self.space.dim).T
        return (self.metric_matrix(base_point) @ columns).T.reshape(vectors.shape)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        """Return the inner products of all pairs of deformations, averaged over surfaces.

        Parameters
        ----------
        vectors : array, shape (K, V, 3)
            Deformations.
        base_point : array, shape (V, 3) or (n, V, 3)
            One surface, or several to average over.

        Returns
        -------
        array, shape (K, K)
        """
        flat = self.check_points(vectors, "vectors").reshape(len(vectors), self.space.dim)
        gram = quadratic_form(self.metric_matrix(base_point), flat)
        return 0.5 * (gram + gram.T)
