r"""One body in the pose of another, with all its own details.

The polar rotations R of the triangles, from body A to body B, contain two things: the pose of B,
which varies from bone to bone, and the build of B, which varies around a limb and within a face.
The heat flow of R over the template (`riemhuman.surfaces.triangle_heat`) keeps the first. Where the
smoothed field bends, there are joints; heat then flows anew from R, longer, and slowly across them
(after Perona and Malik, "Scale-space and edge detection using anisotropic diffusion", IEEE PAMI 12,
1990), so that bones lose more of B's build and joints less of their bends. A's triangles, turned by
the smooth field, are put together by a Poisson equation (`riemhuman.surfaces.poisson`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.kernels.special_orthogonal import nearest_rotations
from riemhuman.kernels.triangle_frames import (
    deformation_gradients,
    stacked_derivatives,
    triangle_frames,
)

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
    from riemhuman.surfaces.triangle_heat import HeatStep

# Time of the flow, as a share of the area of a body. Of a variation of wavelength ℓ there remains
# about exp(−4π²t/ℓ²): of 1.8 m², a half where ℓ = 0.41 m, an arm's girth and more; a quarter of
# what goes around an arm, 0.3 m, and nine tenths of what changes from a thigh to its shin, 1 m.
SMOOTHING = 1.0 / 600.0

# How much longer heat flows along bones, once it is known where joints are: the more, the less of
# B's build, and the farther limbs end from where B holds them. Compared on coarse natural bodies of
# the seeds 21, 51, 61 and 71.
_ALONG_BONES = 3.0

# A limb of radius r that bends by κ radians a metre strains its skin by rκ. Least squares weigh
# with the inverse of the variance, σ² + (rκ)²; r/σ is 0.05 m over 0.1, as a share of √area.
_STRAIN_OF_BENDS = 0.37


class SmoothTurn:
    """Brings one body into the pose of another, whatever the build of the other.

    Parameters
    ----------
    space : AlignedSurfaces
        Space of the surfaces.
    smoothing : float
        Time of the first heat flow as a share of the template's area, above 0; the second, along
        bones, takes 3 times as long. The longer, the less of the other's build is carried over, and
        the rounder joints bend.
    n_rounds : int
        Number of rounds, each of which adds the smoothed remainder of the rotations: they restore
        the bends of joints, long waves sooner than short ones.
    """

    def __init__(
        self, space: AlignedSurfaces, smoothing: float = SMOOTHING, n_rounds: int = 1
    ) -> None:
        self._template = template = space.template
        self._n_rounds = whole_number(n_rounds, "n_rounds", minimum=0)
        self._area = float(template.face_areas.sum())
        self._time = self._area * real_number(smoothing, "smoothing", minimum=0.0, strict=True)

    def solve(self, shape: ndarray, pose: ndarray) -> ndarray:
        """Return one body in the pose of another.

        Parameters
        ----------
        shape : array, shape (V, 3)
            Body to bring into the pose; its triangles have an area.
        pose : array, shape (V, 3)
            Body that gives the pose and the position.

        Returns
        -------
        array, shape (V, 3)
            The centroid of each connected component is that of `pose`.
        """
        frames = triangle_frames(shape, self._template.differential_operator)
        rotations, heat = self._rotations(frames, pose), self._template.heat
        # Of one implicit step alone, short waves fade too little: each flow has two.
        trust = self._trust(_flow(heat.step(0.5 * self._time), rotations))
        along_bones = heat.step_through(trust, 0.5 * _ALONG_BONES * self._time)
        # By the trust of the second field, which bends sharply, few triangles would take all strain
        # of a joint and nearly lose their area.
        assemble = self._template.interpolator.weighted(trust)
        field = _flow(along_bones, rotations)
        turned = assemble.surface_of(stacked_derivatives(field @ frames), pose)
        for _ in range(self._n_rounds):
            missing = self._rotations(self._frames(turned), pose)
            field = _flow(along_bones, missing) @ field
            turned = assemble.surface_of(stacked_derivatives(field @ frames), pose)
        return turned

    def _frames(self, surface: ndarray) -> ndarray:
        return triangle_frames(surface, self._template.differential_operator)

    def _rotations(self, frames: ndarray, surface: ndarray) -> ndarray:
        """Return the polar rotations of triangles from their frames to those of a surface."""
        return nearest_rotations(deformation_gradients(frames, self._frames(surface)))

    def _trust(self, field: ndarray) -> ndarray:
        """Return how far triangles can be trusted to keep their metric, less in joints; (F,)."""
        entries, laplacian = field.reshape(-1, 9), self._template.heat.laplacian
        # |∇X|² = X LX − ½ L X² over the area, for the Laplacian L of finite volumes.
        slopes = 2.0 * entries * (laplacian @ entries) - laplacian @ entries**2
        # A rotation by a small angle changes its matrix by √2 times the angle.
        squared_bends = 0.25 * slopes.sum(axis=1) / self._template.face_areas
        return 1.0 / (1.0 + _STRAIN_OF_BENDS**2 * self._area * np.maximum(squared_bends, 0.0))


def _flow(half: HeatStep, rotations: ndarray) -> ndarray:
    """Return rotations after heat has flowed between them, as between matrices."""
    for _ in range(2):
        heat = half @ rotations.reshape(-1, 9)
        rotations = nearest_rotations(heat.reshape(-1, 3, 3))
    return rotations
