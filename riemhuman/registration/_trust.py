"""Checks by which registrations are trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph

from riemhuman.surfaces.template import Template

# Likelihoods are compared for bodies of this area, because the density falls as the area grows.
AREA = 1.8
# On simulated scans, naked and in clothes of up to 3 cm, right bodies have likelihoods from 2.8 and
# leave the model by up to 5.3 mm; flipped bodies have lower likelihoods or leave it by more.
LEAST_LIKELIHOOD = 2.6
LEAST_MARGIN = 0.10
RIVAL_METRES = 0.15
NEAR_METRES, LEAST_NEAR = 0.05, 0.97
# A limb that is elsewhere has few matches, and leaves part of the scan far from the body.
LIMB_ELSEWHERE, LEAST_NEAR_OF_LIMB = 0.3, 0.995
LARGEST_STRAIN = 0.006
LARGEST_BETA = 3.0

# Holes up to twice this width are filled by the vertices around them, metres.
_SEEN_METRES = 0.06

_REMEDY = "landmarks decide: the argument of ScanRegistration.solve, or --landmarks"


@dataclass(frozen=True)
class Evidence:
    """The quantities by which a registration is checked."""

    likelihood: float
    margin: float
    near: float
    betas: float
    strain: float
    limb: str
    limb_matched: float


def near_matched(template: Template, matched: np.ndarray) -> np.ndarray:
    """Return which vertices are matched or near those that are, along the surface."""
    if not matched.any():
        return matched
    first, second = template.edges.T
    lengths = np.linalg.norm(template.vertices[first] - template.vertices[second], axis=1)
    shape = (template.n_vertices, template.n_vertices)
    graph = sparse.csr_array((lengths, (first, second)), shape=shape)
    distances = csgraph.dijkstra(
        graph, directed=False, indices=np.flatnonzero(matched), limit=_SEEN_METRES, min_only=True
    )
    near: np.ndarray = np.isfinite(distances)
    return near


def find_doubts(evidence: Evidence) -> tuple[list[str], list[str]]:
    """Return the reasons to distrust a registration, and those to distrust one limb of it."""
    reasons, of_limb = [], []
    if evidence.near < LEAST_NEAR:
        reasons.append(
            f"only {100 * evidence.near:.0f} % of the scan lies within "
            f"{100 * NEAR_METRES:.0f} cm of the body: there is something else in it, or more than "
            "one person"
        )
    if evidence.likelihood < LEAST_LIKELIHOOD:
        reasons.append(
            f"the scan does not look like a body (log-likelihood {evidence.likelihood:.2f}; bodies "
            f"have {LEAST_LIKELIHOOD:g} and more)"
        )
    if reasons:
        return reasons, of_limb  # the other checks make sense only for a body
    if evidence.margin < LEAST_MARGIN:
        reasons.append(
            "a body that faces or stands another way fits nearly as well (log-likelihood less by "
            f"{evidence.margin:.2f}); {_REMEDY}"
        )
    if evidence.near < LEAST_NEAR_OF_LIMB and evidence.limb_matched < LIMB_ELSEWHERE:
        of_limb.append(
            f"{100 * (1.0 - evidence.near):.1f} % of the scan lies more than "
            f"{100 * NEAR_METRES:.0f} cm from the body, and {evidence.limb} matches hardly "
            f"anything in the scan ({100 * evidence.limb_matched:.0f} % of its vertices): it may "
            f"be elsewhere; {_REMEDY}"
        )
    if evidence.strain > LARGEST_STRAIN:
        reasons.append(
            f"the surface had to leave the model by {1000 * evidence.strain:.1f} mm in the mean "
            f"(bodies do by less than {1000 * LARGEST_STRAIN:.0f}): it may face the wrong way, "
            "or wear thick clothes"
        )
    if evidence.betas > LARGEST_BETA:
        reasons.append(
            f"the shape is far from all people the model knows ({evidence.betas:.1f} standard "
            "deviations a coefficient)"
        )
    return reasons, of_limb
