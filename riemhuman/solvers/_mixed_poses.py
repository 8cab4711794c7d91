"""Whether surfaces are in several poses, by how their parts are turned."""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array, Points
from riemhuman.errors import MixedPosesWarning, warn
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import holds_surfaces
from riemhuman.kernels.rotations import nearest_rotations
from riemhuman.kernels.surface import deformation_gradients, triangle_frames
from riemhuman.solvers.transfer import SMOOTHING, heat_flow
from riemhuman.surfaces.template import Template

# A part is turned that is more than so many degrees away from the average of all surfaces; poses
# are mixed where more than this share of a surface's area is. Of the open bodies in one pose, ten
# people with natural differences, no more than 0.6 % is; with one or half of them in another of the
# poses, at least 4 %, unless that pose only tilts the head.
_TURNED = 30.0
_MOST_TURNED = 0.02

# Number of surfaces checked, evenly spaced; more would add nothing.
_MOST_SURFACES = 100


def warn_of_mixed_poses(metric: RiemannianMetric, points: Points, base: Array) -> None:
    """Warn if components of several poses are sought with a metric that measures stretching."""
    # Metrics of normals alone describe poses.
    if not holds_surfaces(metric.space) or metric.is_stretch_invariant:
        return
    share = turned_share(metric.space.template, points, base)
    if share > _MOST_TURNED:
        warn(
            f"X holds surfaces in different poses: in one of them, {100 * share:.0f} % of the "
            f"area is turned by more than {_TURNED:.0f} degrees from the average of all. "
            "Combinations of their components tear where limbs turn, for example at the "
            "shoulders. Bring the bodies into one pose first, with "
            "riemhuman.measurements.in_standard_pose or --standard-pose of `riemhuman "
            "components`, or describe poses by a metric of normals alone (a = 0)",
            MixedPosesWarning,
        )


def turned_share(template: Template, points: Points, base: Array) -> float:
    """Return the largest share of the area of a surface whose parts are turned.

    Rotations of triangles from any base are smoothed over the surface, so that neither noise nor
    body shape counts, and compared with their average over the surfaces, whichever way these face.
    """
    shares = template.face_areas / template.face_areas.sum()
    half_step = template.heat.step(0.5 * SMOOTHING * template.face_areas.sum())
    frames = triangle_frames(base, template.differential_operator)
    numbers = np.linspace(0, len(points) - 1, min(len(points), _MOST_SURFACES)).astype(int)
    fields = np.empty((len(numbers), len(shares), 3, 3), dtype=np.float32)
    for place, number in enumerate(numbers):
        surface = triangle_frames(points[number], template.differential_operator)
        rotations = nearest_rotations(deformation_gradients(frames, surface))
        rotations = heat_flow(half_step, rotations)
        heading = nearest_rotations(np.tensordot(shares, rotations, axes=1)[None])[0]
        fields[place] = heading.T @ rotations
    average = nearest_rotations(fields.mean(axis=0))
    # A rotation by θ from another has tr(Rᵀ S) = 1 + 2 cos θ.
    traces = np.einsum("nfij,fij->nf", fields, average)
    turned = traces < 1.0 + 2.0 * np.cos(np.radians(_TURNED))
    return float((turned @ shares).max())
