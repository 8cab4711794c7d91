"""How well a body explains its scan, and the doubts that follow.

`find_excess` compares limbs with the rest of the body; `find_doubts` turns measures of a fit into
reasons. Which vertices a scan shows is found in `_shown_parts`, and `_verdict` puts all together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._body_parts import BodyParts
from riemhuman.registration._constants import (
    BODY_MARGIN,
    EXCHANGED_METRES,
    FAR_METRES,
    FAR_SHARE,
    LARGEST_BETA,
    LARGEST_OVERLAP,
    LEAST_LIKELIHOOD,
    LEAST_NEAR,
    LEAST_NEAR_OF_LIMB,
    LEAST_REST_METRES,
    LIMB_ELSEWHERE,
    NEAR_METRES,
    USUAL_LIKELIHOOD,
)
from riemhuman.registration._messages import LANDMARKS_DECIDE
from riemhuman.surfaces.template import Template

# Joints of the parts of limbs that are compared with the rest of the body.
_LIMB_PARTS = ("shoulder", "elbow", "wrist", "hip", "knee")
# With fewer points of the scan, nothing is known about a part of a limb.
_LEAST_POINTS = 20


def find_facet_heights(parts: BodyParts, template: Template, points: Array) -> Array:
    """Return how far the middles of edges are from the smooth surface, by joint, metres."""
    first, second = template.edges.T
    normals = vertex_normals(points, template.faces)
    along, turned = points[second] - points[first], normals[second] - normals[first]
    # A circle through both ends with these normals is so high above its chord.
    heights = np.abs(np.einsum("ex,ex->e", along, turned)) / 8.0
    owners, n_joints = parts.owners[first], len(parts.names)
    sums, counts = (np.bincount(owners, weights, n_joints) for weights in (heights, None))
    means: Array = sums / np.maximum(counts, 1)
    return means


def find_excess(parts: BodyParts, owners: Integers, distances: Array, facets: Array) -> Array:
    """Return by which factor a scan is farther from each limb than from the rest of the body.

    Noise, clothes and what the model cannot show of a person are in both distances. Joints that
    are no limb's, and those near few points, have 1.

    Parameters
    ----------
    owners : ndarray, shape (N,)
        The joint that moves the surface next to each point of the scan most.
    distances : ndarray, shape (N,)
        From the surface, metres.
    facets : ndarray, shape (J,)
        A limb is at least so far from a smooth surface, because it has few triangles, metres.

    Returns
    -------
    excess : ndarray, shape (J,)
    """
    excess = np.ones(len(parts.names))
    arms = [arm[1:] for arm in parts.arms]
    on_hands = np.isin(owners, [arm[-1] for arm in arms])
    far = np.minimum(distances, EXCHANGED_METRES)
    for k, name in enumerate(parts.names):
        if name.split("_")[-1] not in _LIMB_PARTS:
            continue
        limb = next((arm for arm in arms if k in arm), np.array([k]))
        on_joint, rest = owners == k, ~np.isin(owners, limb) & ~on_hands
        if on_joint.sum() >= _LEAST_POINTS and rest.any():
            usual = np.hypot(max(far[rest].mean(), LEAST_REST_METRES), facets[k])
            excess[k] = far[on_joint].mean() / usual
    return excess


@dataclass(frozen=True)
class FitQuality:
    """Measures of how well a registered body explains its scan."""

    likelihood: float
    margin: float  # factor by which it is likelier than bodies elsewhere
    near: float  # share of the scan near the body
    betas: float  # root mean square of the shape coefficients
    far: float  # distance from the model that nearly all of the scan is within, metres
    overlap: float  # share of the matched vertices that lie where another part is
    limb: str  # the limb of which the least is matched, in words
    limb_matched: float  # share of it that is


def find_doubts(quality: FitQuality) -> tuple[list[str], list[str]]:
    """Return the reasons to distrust a registration, and those to distrust one limb of it."""
    reasons: list[str] = []
    of_limb: list[str] = []
    if quality.near < LEAST_NEAR:
        reasons.append(
            f"only {100 * quality.near:.0f} % of the scan lies within "
            f"{100 * NEAR_METRES:.0f} cm of the body: there is something else in it, or "
            "more than one person"
        )
    if quality.likelihood < LEAST_LIKELIHOOD:
        reasons.append(
            "the scan does not look like one person: check its unit and direction up, and that it "
            "shows a single body"
        )
    if reasons:
        return reasons, of_limb  # the other checks make sense only for bodies
    if quality.margin < BODY_MARGIN:
        reasons.append(
            f"a body that faces or stands another way fits nearly as well; {LANDMARKS_DECIDE}"
        )
    if quality.near < LEAST_NEAR_OF_LIMB and quality.limb_matched < LIMB_ELSEWHERE:
        of_limb.append(
            f"{100 * (1.0 - quality.near):.1f} % of the scan lies more than "
            f"{100 * NEAR_METRES:.0f} cm from the body, and hardly anything in it "
            f"matches the {quality.limb} of the body, which may be elsewhere; {LANDMARKS_DECIDE}"
        )
    if quality.overlap > LARGEST_OVERLAP:
        reasons.append(
            f"{100 * quality.overlap:.1f} % of the body lies where another part of it is: the "
            "scan may show only a part of a body"
        )
    misfit = np.log(quality.far / FAR_METRES) + USUAL_LIKELIHOOD - quality.likelihood
    if misfit > 0.0:
        reasons.append(
            f"the body fits badly: {100 * (1 - FAR_SHARE):.0f} % of the scan lies more "
            f"than {100 * quality.far:.1f} cm from the model's surface; it may face the wrong way, "
            f"have limbs in wrong places or wear thick clothes; {LANDMARKS_DECIDE}"
        )
    if quality.betas > LARGEST_BETA:
        reasons.append(
            "the body shape is far from all people the model knows: check the unit, and for "
            "clothes or other things in the scan"
        )
    return reasons, of_limb
