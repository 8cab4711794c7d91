"""The metric of rotations of the parts of a surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, values_of
from riemhuman.geometry.bulk import Bulk
from riemhuman.geometry.pullback import PullbackMetric
from riemhuman.geometry.rotation_fields import RotationFields
from riemhuman.kernels.drift import still_path
from riemhuman.kernels.sketches import patch_coordinates, triangle_patches
from riemhuman.kernels.special_orthogonal import nearest_rotations, quaternions, transpose
from riemhuman.kernels.surface import apply_operator, is_degenerate, refuse_degenerate
from riemhuman.kernels.triangle_frames import polar_frames
from riemhuman.protocols import ExpSolver, GeodesicSolver, LogSolver
from riemhuman.terms.rotations import RotationTerm
from riemhuman.terms.sum import TermOfFields

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces

# √(4 time) is then 10 cm on an adult body, whose skin has 1.8 m²: the thickness of a limb.
_SHARE_OF_AREA = 0.0025 / 1.8
# Deformations whose images are computed together, for the sake of memory.
_AT_A_TIME = 8


class RotationMetric(PullbackMetric):
    r"""The pull-back of `RotationFieldMetric` by the rotations of triangles, diffused.

    The differential of a surface f on a triangle is :math:`df = R \sqrt g` with R an isometry of
    the template's plane into R³ (polar decomposition); R takes the template's normal to the
    surface's as well and so is a rotation. Heat flows between the rotations of all triangles for
    `time`, as between matrices, and the nearest rotations are compared. Together, g and R before
    diffusion determine the surface up to a translation, which g and the normals do not.

    Like normals, it tells how people stand, and more reliably: a person's build turns normals back
    and forth within the thickness of a limb, and diffusion averages over that length. The metric
    sees a rotation of one of two surfaces, but neither translation nor scale.

    Parameters
    ----------
    space : AlignedSurfaces
        The space of surfaces.
    time : float, optional
        Duration of the heat flow, in squared units of the template, such as m²: heat spreads by √(4
        time). By default a 720th of the template's area. On an adult, √(4 time) is then the
        thickness of a limb, 10 cm. At 0 there is no diffusion.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> pose = rh.RotationMetric(space)
    >>> same_pose, same_person = bodies[13], bodies[4]
    >>> bool(pose.dist(bodies[3], same_pose) < pose.dist(bodies[3], same_person))
    True
    """

    space: AlignedSurfaces
    is_translation_invariant = True
    is_stretch_invariant = True

    def __init__(
        self,
        space: AlignedSurfaces,
        time: float | None = None,
        geodesic_solver: GeodesicSolver | None = None,
        *,
        exp_solver: ExpSolver | None = None,
        log_solver: LogSolver | None = None,
    ) -> None:
        template = space.template
        if time is None:
            time = _SHARE_OF_AREA * template.face_areas.sum()
        self.time = real_number(time, "time", minimum=0.0)
        self._axes = polar_frames(*space.partial_derivatives(template.vertices))
        super().__init__(
            space,
            RotationFields(template).metric,
            self.rotations,
            geodesic_solver,
            exp_solver=exp_solver,
            log_solver=log_solver,
        )

    def rotations(self, f: ndarray) -> ndarray:
        """Return the rotations of all triangles from the template, diffused.

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., F, 3, 3)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle has no area, so that it has no normal.
        """
        f_u, f_v = self.space.partial_derivatives(f)
        refuse_degenerate(is_degenerate(values_of(f_u), values_of(f_v)))
        rotations = np.matmul(polar_frames(f_u, f_v), transpose(self._axes))
        if self.time == 0:
            return rotations
        flat = np.reshape(rotations, (*np.shape(rotations)[:-2], 9))
        diffused = apply_operator(self.space.template.heat.step(self.time), flat)
        return nearest_rotations(np.reshape(diffused, np.shape(rotations)))

    @property
    def bulk(self) -> Bulk:
        """Features are the components of quaternions, one surface after the other."""

        def fields(points: ndarray) -> tuple[ndarray]:
            surfaces = self.space.check_point(points, "points")
            found = np.empty((len(surfaces), self.space.template.n_faces, 4))
            for i, f in enumerate(surfaces):
                found[i] = quaternions(self.rotations(f))
            return (found,)

        return TermOfFields(RotationTerm(), self.space.template, fields)

    def lower_bound_coordinates(self, points: ndarray, n_patches: int | None = None) -> ndarray:
        """Return coordinates whose Euclidean distances are at most those of the metric.

        See `riemhuman.kernels.sketches`: ‖R₁ − R₂‖² = 8 sin²(θ/2) ≤ 2 θ².

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
        rotations = self.rotations(points)
        flat = np.sqrt(0.5) * np.reshape(rotations, (*np.shape(rotations)[:-2], 9))
        return patch_coordinates(flat, template.face_areas, patches)

    def energy_and_gradient(self, path: ndarray) -> tuple[float, ndarray]:
        """Return the closed-form energy of one path and its gradient.

        Returns
        -------
        energy : float
            Infinite where a triangle has no area.
        gradient : array, shape (n_times, V, 3)
            Derivatives with respect to all vertices.
        """
        path = self.check_points(path, "path")
        if is_degenerate(*self.space.partial_derivatives(path)).any():
            return np.inf, np.zeros(path.shape)
        return super().energy_and_gradient(path)

    def gram_matrix(self, vectors: ndarray, base_point: ndarray) -> ndarray:
        """Return the inner products of all pairs of deformations, averaged over surfaces."""
        vectors = self.check_points(vectors, "vectors")
        surfaces = self.space.check_point(base_point, "base_point").reshape(-1, *self.space.shape)
        roots = np.sqrt(0.5 * self.space.template.face_areas)[:, None, None]
        images = np.empty((len(vectors), roots.size * 9))
        gram = np.zeros((len(vectors), len(vectors)))
        for f in surfaces:
            for first in range(0, len(vectors), _AT_A_TIME):
                some = slice(first, first + _AT_A_TIME)
                changes = roots * self.differential(vectors[some], f)
                images[some] = changes.reshape(len(changes), -1)
            gram += images @ images.T
        return gram / len(surfaces)

    def remove_drift(self, path: ndarray) -> ndarray:
        """Remove translations, which the metric does not see, from a path.

        Returns
        -------
        array, shape (n_times, V, 3)
            A path of the same energy with the same ends.
        """
        path = self.check_points(path, "path")
        return still_path(path, self.space.template.vertex_areas, rotations=False)
