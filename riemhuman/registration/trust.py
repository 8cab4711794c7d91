"""Trust in registrations: evidence for and against a result."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# The likelihood is compared for bodies of one size: density falls as the area grows.
AREA = 1.8
# Between right and wrong bodies of simulated scans, naked and in clothes of up to 3 cm: right ones
# have likelihoods from 2.8 and leave the model by up to 5.3 mm; flipped ones have less or leave it
# by more.
LEAST_LIKELIHOOD = 2.6
LEAST_MARGIN = 0.10
RIVAL_METRES = 0.15
NEAR_METRES, LEAST_NEAR = 0.05, 0.97
# A limb held elsewhere finds little, and leaves more than so much of the scan without a body.
HELD_ELSEWHERE, LEAST_NEAR_OF_LIMB = 0.3, 0.995
LARGEST_STRAIN = 0.006
LARGEST_BETA = 3.0


@dataclass(frozen=True)
class Evidence:
    """Evidence for and against a registration.

    Attributes
    ----------
    likelihood : float
        Mean log-likelihood of the scan points, for a body of 1.8 square metres.
    margin : float
        How much more likely it is than the likeliest body elsewhere; infinite without any.
    near : float
        Share of the scan within 5 cm of the body.
    betas : float
        Root mean square of the shape coefficients.
    strain : float
        Mean distance of the surface from what the model can show, metres: a body that faces the
        wrong way must bend its surface to the scan.
    limb : str
        The joint whose vertices have found the least in the scan.
    limb_matched : float
        Share of those vertices that have found something.
    """

    likelihood: float
    margin: float
    near: float
    betas: float
    strain: float
    limb: str
    limb_matched: float


def doubts(evidence: Evidence) -> list[str]:
    """Return the reasons to distrust a registration; none if it is trusted.

    Parameters
    ----------
    evidence : Evidence
        What is known of it.
    """
    reasons = []
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
        return reasons  # what is no body has no way to stand
    if evidence.margin < LEAST_MARGIN:
        reasons.append(
            "a body that faces or stands another way fits nearly as well (log-likelihood less by "
            f"{evidence.margin:.2f}); solve with landmarks= to decide"
        )
    if evidence.near < LEAST_NEAR_OF_LIMB and evidence.limb_matched < HELD_ELSEWHERE:
        reasons.append(
            f"{100 * (1.0 - evidence.near):.1f} % of the scan lies more than "
            f"{100 * NEAR_METRES:.0f} cm from the body, and {evidence.limb} found next to nothing "
            f"in the scan ({100 * evidence.limb_matched:.0f} % of its vertices): it may be held "
            "elsewhere; solve with landmarks= to decide"
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
    return reasons


def distance_apart(points: np.ndarray, others: np.ndarray) -> float:
    """Return the mean distance between two bodies' corresponding points.

    Parameters
    ----------
    points, others : array, shape (n, 3)
        Points, metres.

    Returns
    -------
    float
        Metres.
    """
    return float(np.linalg.norm(points - others, axis=1).mean())
