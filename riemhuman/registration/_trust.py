"""Checks by which registrations are trusted."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._start_poses import BodyParts
from riemhuman.surfaces.measures import edge_lengths
from riemhuman.surfaces.template import Template

# Likelihoods are compared for bodies of this area, because the density falls as the area grows.
AREA = 1.8
LEAST_LIKELIHOOD = 2.4
LEAST_MARGIN = 0.06
RIVAL_METRES = 0.15
NEAR_METRES, LEAST_NEAR = 0.05, 0.97
# A limb that is elsewhere has few matches, and leaves part of the scan far from the body.
LIMB_ELSEWHERE, LEAST_NEAR_OF_LIMB = 0.3, 0.995
LARGEST_BETA = 4.0
# Exact bodies of the coarse model overlap by up to 1.6 % in deep squats.
LARGEST_OVERLAP = 0.02
# A body is wrong if ln(d / d₀) > l − l₀, with its likelihood l and the distance d from the model's
# surface within which this share of the scan lies. `tests/benchmarks/test_registration.py -k trust`
# prints how often right bodies are refused and wrong ones are trusted.
FAR_SHARE, FAR_METRES, USUAL_LIKELIHOOD = 0.95, 0.020, 2.75

_LIMB_JOINTS = ("shoulder", "elbow", "hip", "knee", "head")
# A limb whose matches are also those of another part, for this share of them, is not in the scan.
_SHARED_LIMB = 0.5
# No elbow or knee bends by more than 160°.
_FOLDING, _LEAST_BENT = {"elbow": "wrist", "knee": "ankle"}, -0.94

# Holes up to twice this width are filled by the vertices around them, metres, but by none that is
# so far outside of what the scan shows, such as straight fingers of a fist.
_SEEN_METRES, _OUTSIDE_METRES = 0.06, 0.015
# Vertices overlap if they look the same way, are this far apart in the rest pose, and lie on each
# other: this near along normals, and as near as neighbours in the mesh, within limits, metres.
_APART_METRES, _ALONG_METRES, _OVERLAP_METRES, _N_NEIGHBOURS = 0.15, 0.012, (0.015, 0.045), 30

_REMEDY = "landmarks decide: the argument of ScanRegistration.solve, or --landmarks"


def find_seen(
    template: Template, points: np.ndarray, matched: np.ndarray, scan: PreparedScan
) -> np.ndarray:
    """Return which vertices are matched or near those that are, along the surface."""
    if not matched.any():
        return matched
    first, second = template.edges.T
    lengths = edge_lengths(template.vertices, template.edges)
    shape = (template.n_vertices, template.n_vertices)
    graph = sparse.csr_array((lengths, (first, second)), shape=shape)
    distances = csgraph.dijkstra(
        graph, directed=False, indices=np.flatnonzero(matched), limit=_SEEN_METRES, min_only=True
    )
    nearest = cKDTree(scan.points).query(points)[1]
    heights = np.einsum("nx,nx->n", points - scan.points[nearest], scan.normals[nearest])
    seen: np.ndarray = matched | (np.isfinite(distances) & (heights < _OUTSIDE_METRES))
    return seen


def find_overlaps(template: Template, points: np.ndarray, matched: np.ndarray) -> np.ndarray:
    """Return which matched vertices lie in the same place as another matched part of the body."""
    overlaps = np.zeros(len(points), dtype=bool)
    own = np.flatnonzero(matched)
    if not len(own):
        return overlaps
    normals = vertex_normals(points, template.faces)[own]
    count = min(_N_NEIGHBOURS, len(own))
    ends = template.vertices[template.edges]
    edge = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    farthest = np.clip(edge, *_OVERLAP_METRES)
    distances, near = cKDTree(points[own]).query(
        points[own], k=count, distance_upper_bound=farthest
    )
    close = np.isfinite(distances)
    near[~close] = 0
    gaps = points[own][near] - points[own, np.newaxis]
    close &= np.abs(np.einsum("nkx,nx->nk", gaps, normals)) < _ALONG_METRES
    rest = template.vertices[own]
    apart = np.linalg.norm(rest[near] - rest[:, np.newaxis], axis=-1) > _APART_METRES
    alike = np.einsum("nkx,nx->nk", normals[near], normals) > 0.5
    overlaps[own] = (apart & alike & close).any(axis=1)
    return overlaps


def find_lost_limbs(
    parts: BodyParts, points: np.ndarray, matched: np.ndarray, overlaps: np.ndarray
) -> np.ndarray:
    """Return which vertices belong to limbs that match little of the scan."""
    # The model has no way to leave out a limb: without points of its own, it is fitted to others,
    # and most of what it matches is matched by another part of the body too, or it is folded into
    # the part above it.
    names, model = parts.names, parts.model
    few = parts.shares(matched & ~overlaps) < LIMB_ELSEWHERE
    shared = parts.shares(overlaps) > _SHARED_LIMB * parts.shares(matched)
    lost = [int(k) for k in np.flatnonzero(few | shared) if names[k].split("_")[-1] in _LIMB_JOINTS]
    joints = model.joint_regressor @ points
    for k, name in enumerate(names):
        side, _, joint = name.partition("_")
        for end in parts.numbers(f"{side}_{_FOLDING.get(joint)}"):
            above, below = joints[k] - joints[model.parents[k]], joints[end] - joints[k]
            if above @ below < _LEAST_BENT * np.linalg.norm(above) * np.linalg.norm(below):
                lost.append(k)
    return parts.vertices(lost)


def find_doubts(
    *,
    likelihood: float,
    margin: float,
    near: float,
    betas: float,
    far: float,
    overlap: float,
    limb: str,
    limb_matched: float,
) -> tuple[list[str], list[str]]:
    """Return the reasons to distrust a registration, and those to distrust one limb of it."""
    reasons: list[str] = []
    of_limb: list[str] = []
    if near < LEAST_NEAR:
        reasons.append(
            f"only {100 * near:.0f} % of the scan lies within "
            f"{100 * NEAR_METRES:.0f} cm of the body: there is something else in it, or more than "
            "one person"
        )
    if likelihood < LEAST_LIKELIHOOD:
        reasons.append(
            "the scan does not look like one person: check its unit and direction up, and that it "
            "shows a single body"
        )
    if reasons:
        return reasons, of_limb  # the other checks make sense only for a body
    if margin < LEAST_MARGIN:
        reasons.append(f"a body that faces or stands another way fits nearly as well; {_REMEDY}")
    if near < LEAST_NEAR_OF_LIMB and limb_matched < LIMB_ELSEWHERE:
        of_limb.append(
            f"{100 * (1.0 - near):.1f} % of the scan lies more than "
            f"{100 * NEAR_METRES:.0f} cm from the body, and its {limb} matches hardly anything "
            f"in the scan: it may be elsewhere; {_REMEDY}"
        )
    if overlap > LARGEST_OVERLAP:
        reasons.append(
            f"{100 * overlap:.1f} % of the body lies where another part of it is: the "
            "scan may show only a part of a body"
        )
    misfit = np.log(far / FAR_METRES) + USUAL_LIKELIHOOD - likelihood
    if misfit > 0.0:
        reasons.append(
            f"the body fits badly: {100 * (1 - FAR_SHARE):.0f} % of the scan lies more than "
            f"{100 * far:.1f} cm from the model's surface; it may face the wrong way, have "
            f"limbs in wrong places or wear thick clothes; {_REMEDY}"
        )
    if betas > LARGEST_BETA:
        reasons.append(
            "the body shape is far from all people the model knows: check the unit, and for "
            "clothes or other things in the scan"
        )
    return reasons, of_limb


def join_reasons(reasons: list[str]) -> str:
    """Return one message, which says only at its end that landmarks decide."""
    said = "; ".join(reasons)
    remedy = f"; {_REMEDY}"
    return said.replace(remedy, "") + remedy * (remedy in said)
