"""Checks by which registrations are trusted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._messages import LANDMARKS_DECIDE
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._start_poses import BodyParts
from riemhuman.registration.settings import RivalSettings, TrustSettings
from riemhuman.surfaces.measures import edge_lengths
from riemhuman.surfaces.template import Template

_LIMB_JOINTS = ("shoulder", "elbow", "hip", "knee", "head")
# Joints of the parts of limbs that are compared with the rest of the body.
_LIMB_PARTS = ("shoulder", "elbow", "wrist", "hip", "knee")
# With fewer points of the scan, nothing is known about a part of a limb.
_LEAST_POINTS = 20
_FOLDING = {"elbow": "wrist", "knee": "ankle"}


def find_seen(
    template: Template,
    points: np.ndarray,
    matched: np.ndarray,
    scan: PreparedScan,
    settings: TrustSettings,
) -> np.ndarray:
    """Return which vertices are matched or near those that are, along the surface."""
    if not matched.any():
        return matched
    first, second = template.edges.T
    lengths = edge_lengths(template.vertices, template.edges)
    shape = (template.n_vertices, template.n_vertices)
    graph = sparse.csr_array((lengths, (first, second)), shape=shape)
    distances = csgraph.dijkstra(
        graph,
        directed=False,
        indices=np.flatnonzero(matched),
        limit=settings.seen_metres,
        min_only=True,
    )
    nearest = cKDTree(scan.points).query(points)[1]
    heights = np.einsum("nx,nx->n", points - scan.points[nearest], scan.normals[nearest])
    seen: np.ndarray = matched | (np.isfinite(distances) & (heights < settings.outside_metres))
    return seen


class Overlaps(NamedTuple):
    """Matched vertices that lie where another matched part of the body lies.

    At a seam, where a calf is folded onto a thigh, the other part is near on one side only; where
    one limb is fitted to the scan of another, it is all around.
    """

    near: np.ndarray
    around: np.ndarray


def find_overlaps(
    template: Template, points: np.ndarray, matched: np.ndarray, settings: TrustSettings
) -> Overlaps:
    """Return which matched vertices lie in the same place as another matched part of the body."""
    overlaps = Overlaps(*np.zeros((2, len(points)), dtype=bool))
    matched_numbers = np.flatnonzero(matched)
    if not len(matched_numbers):
        return overlaps
    normals = vertex_normals(points, template.faces)[matched_numbers]
    count = min(settings.n_neighbours, len(matched_numbers))
    ends = template.vertices[template.edges]
    edge = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    farthest = np.clip(edge, *settings.overlap_metres)
    distances, near = cKDTree(points[matched_numbers]).query(
        points[matched_numbers], k=count, distance_upper_bound=farthest
    )
    close = np.isfinite(distances)
    near[~close] = 0
    gaps = points[matched_numbers][near] - points[matched_numbers, np.newaxis]
    heights = np.einsum("nkx,nx->nk", gaps, normals)
    close &= np.abs(heights) < settings.along_metres
    rest = template.vertices[matched_numbers]
    apart = np.linalg.norm(rest[near] - rest[:, np.newaxis], axis=-1) > settings.apart_metres
    alike = np.einsum("nkx,nx->nk", normals[near], normals) > 0.5
    others = apart & alike & close
    sideways = gaps - heights[:, :, np.newaxis] * normals[:, np.newaxis]
    lengths = np.linalg.norm(sideways, axis=-1)
    directions = sideways / np.maximum(lengths, 1e-12)[:, :, np.newaxis]
    counts = np.maximum(others.sum(axis=1), 1)
    towards = np.linalg.norm((directions * others[:, :, np.newaxis]).sum(axis=1), axis=1) / counts
    same_place = (others & (lengths < settings.same_place * farthest)).any(axis=1)
    overlaps.near[matched_numbers] = others.any(axis=1)
    overlaps.around[matched_numbers] = others.any(axis=1) & (
        same_place | (towards < settings.one_sided)
    )
    return overlaps


def find_lost_limbs(
    parts: BodyParts,
    points: np.ndarray,
    matched: np.ndarray,
    overlaps: np.ndarray,
    settings: TrustSettings,
) -> np.ndarray:
    """Return which vertices belong to limbs that match little of the scan."""
    # The model always has all limbs. A limb that the scan does not show is fitted to points of
    # other parts: most of what it matches is matched by another part of the body too, or it is
    # folded into the part above it.
    names, model = parts.names, parts.model
    few = parts.shares(matched & ~overlaps) < settings.limb_elsewhere
    shared = parts.shares(overlaps) > settings.shared_limb * parts.shares(matched)
    lost = [int(k) for k in np.flatnonzero(few | shared) if names[k].split("_")[-1] in _LIMB_JOINTS]
    joints = model.joint_regressor @ points
    for k, name in enumerate(names):
        side, _, joint = name.partition("_")
        for end in parts.numbers(f"{side}_{_FOLDING.get(joint)}"):
            above, below = joints[k] - joints[model.parents[k]], joints[end] - joints[k]
            if above @ below < settings.least_bent * np.linalg.norm(above) * np.linalg.norm(below):
                lost.append(k)
    return parts.vertices(lost)


def find_facet_heights(parts: BodyParts, template: Template, points: np.ndarray) -> np.ndarray:
    """Return how far the middles of edges are from the smooth surface, by joint, metres."""
    first, second = template.edges.T
    normals = vertex_normals(points, template.faces)
    along, turned = points[second] - points[first], normals[second] - normals[first]
    # A circle through both ends with these normals is so high above its chord.
    heights = np.abs(np.einsum("ex,ex->e", along, turned)) / 8.0
    owners, n_joints = parts.owners[first], len(parts.names)
    sums, counts = (np.bincount(owners, weights, n_joints) for weights in (heights, None))
    means: np.ndarray = sums / np.maximum(counts, 1)
    return means


def find_excess(
    parts: BodyParts,
    owners: np.ndarray,
    distances: np.ndarray,
    facets: np.ndarray,
    settings: RivalSettings,
) -> np.ndarray:
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
    far = np.minimum(distances, settings.exchanged_metres)
    for k, name in enumerate(parts.names):
        if name.split("_")[-1] not in _LIMB_PARTS:
            continue
        limb = next((arm for arm in arms if k in arm), np.array([k]))
        on_joint, rest = owners == k, ~np.isin(owners, limb) & ~on_hands
        if on_joint.sum() >= _LEAST_POINTS and rest.any():
            usual = np.hypot(max(far[rest].mean(), settings.least_rest_metres), facets[k])
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


def find_doubts(quality: FitQuality, settings: TrustSettings) -> tuple[list[str], list[str]]:
    """Return the reasons to distrust a registration, and those to distrust one limb of it."""
    reasons: list[str] = []
    of_limb: list[str] = []
    if quality.near < settings.least_near:
        reasons.append(
            f"only {100 * quality.near:.0f} % of the scan lies within "
            f"{100 * settings.near_metres:.0f} cm of the body: there is something else in it, or "
            "more than one person"
        )
    if quality.likelihood < settings.least_likelihood:
        reasons.append(
            "the scan does not look like one person: check its unit and direction up, and that it "
            "shows a single body"
        )
    if reasons:
        return reasons, of_limb  # the other checks make sense only for bodies
    if quality.margin < settings.least_margin:
        reasons.append(
            f"a body that faces or stands another way fits nearly as well; {LANDMARKS_DECIDE}"
        )
    if (
        quality.near < settings.least_near_of_limb
        and quality.limb_matched < settings.limb_elsewhere
    ):
        of_limb.append(
            f"{100 * (1.0 - quality.near):.1f} % of the scan lies more than "
            f"{100 * settings.near_metres:.0f} cm from the body, and hardly anything in it "
            f"matches the {quality.limb} of the body, which may be elsewhere; {LANDMARKS_DECIDE}"
        )
    if quality.overlap > settings.largest_overlap:
        reasons.append(
            f"{100 * quality.overlap:.1f} % of the body lies where another part of it is: the "
            "scan may show only a part of a body"
        )
    misfit = (
        np.log(quality.far / settings.far_metres) + settings.usual_likelihood - quality.likelihood
    )
    if misfit > 0.0:
        reasons.append(
            f"the body fits badly: {100 * (1 - settings.far_share):.0f} % of the scan lies more "
            f"than {100 * quality.far:.1f} cm from the model's surface; it may face the wrong way, "
            f"have limbs in wrong places or wear thick clothes; {LANDMARKS_DECIDE}"
        )
    if quality.betas > settings.largest_beta:
        reasons.append(
            "the body shape is far from all people the model knows: check the unit, and for "
            "clothes or other things in the scan"
        )
    return reasons, of_limb
