"""The last stage: which bodies, limbs and vertices are trusted, and messages about the others.

In go a search, the body fitted from it and what the scan shows of it; out comes a `Verdict`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Booleans
from riemhuman.checks import UNITS, likely_units
from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._constants import (
    FAR_SHARE,
    FARTHEST_MISS,
    GUESSED_UP,
    LEAST_LIKELIHOOD,
    LEAST_NEAR,
    LEAST_UNSEEN,
    N_JUDGED,
    NEAR_METRES,
    RIVAL_METRES,
)
from riemhuman.registration._dense_fit import find_hair
from riemhuman.registration._even_points import even_points
from riemhuman.registration._limb_rivals import LimbDoubt, ShownLimbs, find_limb_doubts
from riemhuman.registration._messages import in_words, join_reasons, part_in_words, say_unseen
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._shown_parts import ShownParts
from riemhuman.registration._soft_assignment import find_likelihood_of_area
from riemhuman.registration._start_search import Search
from riemhuman.registration._trust import (
    FitQuality,
    find_doubts,
    find_excess,
    find_facet_heights,
)
from riemhuman.registration.scans import Scan
from riemhuman.surfaces.nearest_points import SurfacePoints, nearest_points

# Number of points by which bodies are compared: other bodies are 15 cm away in the mean, which a
# thousand points tell to within some millimetres.
_N_COMPARED = 1000


@dataclass(frozen=True, eq=False)
class Verdict:
    """Which parts of a registered scan are trusted."""

    trusted: bool
    trusted_vertices: Booleans  # (V,)
    message: str
    likelihood: float
    matched: Booleans  # (V,)
    correspondence: SurfacePoints  # of all points of the scan
    distances: Array  # (N,)
    background: Booleans  # (N,)
    excess: Array  # (J,) how many times farther the scan is from a limb than from the rest


def judge(search: Search, fitted: BodyFit, vertices: ShownParts, *, unit_is_known: bool) -> Verdict:
    """Return which of the vertices of a body, fitted to the scan of a search, are trusted."""
    body, scan, fit = search.body, search.scan, fitted.fit
    parts, whole = body.parts, scan.whole
    places, distances = nearest_points(whole.points, fit.points, body.model.faces)
    background = scan.background | find_hair(body, fit.model_points, whole.points)
    up = search.candidates[0].up
    likelihood = find_likelihood_of_area(body, fit.pose, scan, up, vertices.visible)
    quality = _measure(search, fitted, vertices, likelihood)
    doubts, limb_doubts = find_doubts(quality)
    # If it does not look like a body, nothing is said about its parts.
    is_body = min(quality.near - LEAST_NEAR, likelihood - LEAST_LIKELIHOOD) >= 0
    doubts += _landmark_doubts(body, fit.pose, scan.landmarks)
    if doubts and not unit_is_known:
        doubts = [*_other_units(whole, background), *doubts]
    trusted_vertices = vertices.seen & (not doubts)
    if limb_doubts:
        limb = int(np.argmin(parts.shares(vertices.matched)))
        trusted_vertices &= ~parts.limb_vertices(limb)
    # No vertex of a refused body is trusted, so its limbs need no rivals.
    shown = ShownLimbs(
        vertices.matched, _find_excess(search, fit.points, places, distances, background)
    )
    limb_rivals = [] if doubts else find_limb_doubts(fitted, shown)
    rivals: list[LimbDoubt] = []
    for doubt in limb_rivals:
        if (doubt.vertices & trusted_vertices).any():  # otherwise, this says nothing new
            rivals.append(doubt)
            trusted_vertices = trusted_vertices & ~doubt.vertices
    reasons = [
        *doubts,
        *limb_doubts,
        *(f"{doubt.reason} (not trusted); {doubt.remedy}" for doubt in rivals),
        *(_unseen_parts(body, vertices, up_is_known=scan.up is not None) if is_body else []),
    ]
    return Verdict(
        trusted=not doubts and not limb_doubts,
        trusted_vertices=trusted_vertices,
        message=join_reasons(reasons),
        likelihood=likelihood,
        matched=vertices.matched,
        correspondence=places,
        distances=distances,
        background=background,
        excess=shown.excess,
    )


def _find_excess(
    search: Search,
    points: Array,
    places: SurfacePoints,
    distances: Array,
    background: Booleans,
) -> Array:
    """Return how many times farther a scan is from each limb than from the rest of the body."""
    body = search.body
    facets = find_facet_heights(body.parts, body.model.template, points)
    near = ~background & (distances < NEAR_METRES)
    owners = body.parts.owners[body.model.faces[places.triangles[near], 0]]
    return find_excess(body.parts, owners, distances[near], facets)


def _measure(
    search: Search, fitted: BodyFit, vertices: ShownParts, likelihood: float
) -> FitQuality:
    """Return how well a body explains its scan."""
    body, scan, fit = search.body, search.scan, fitted.fit
    model = body.model
    some = scan.points[even_points(scan.points, N_JUDGED)]
    some = some[~find_hair(body, fit.model_points, some)]
    _, gaps = nearest_points(some, fit.points, model.faces)
    _, model_distances = nearest_points(some, fit.model_points, model.faces)
    betas = fit.pose.betas[: model.n_betas]
    shares = body.parts.shares(vertices.matched)
    limb = int(np.argmin(shares))
    return FitQuality(
        likelihood=likelihood,
        margin=find_margin(search),
        near=float(np.mean(gaps < NEAR_METRES)),
        betas=float(np.sqrt(np.mean(betas**2))) if len(betas) else 0.0,
        far=float(np.quantile(model_distances, FAR_SHARE)),
        overlap=float(vertices.overlaps.sum() / max(vertices.matched.sum(), 1)),
        limb=part_in_words(body.parts.names[limb]),
        limb_matched=float(shares[limb]),
    )


def find_margin(search: Search) -> float:
    """Return how much likelier the best body is than all bodies whose visible part is elsewhere."""
    candidates, samples = search.candidates, search.body.samples(_N_COMPARED)
    surface = pose_body(samples, candidates[0].pose).points
    end = search.body.end_of(search.scan.points, candidates[0].up)
    shown = np.ones(len(surface), bool)
    if end is not None:
        shown = (samples.areas > 0) & end.shows(surface)
    farthest = RIVAL_METRES
    elsewhere = [
        candidate.likelihood
        for candidate in candidates[1:]
        if np.linalg.norm(
            (pose_body(samples, candidate.pose).points - surface)[shown], axis=1
        ).mean()
        > farthest
    ]
    return candidates[0].likelihood - max(elsewhere, default=-np.inf)


def _landmark_doubts(
    body: RegistrationModel, pose: Pose, landmarks: Mapping[int, Array]
) -> list[str]:
    joints = body.joint_motions(pose).positions + pose.trans
    misses = {k: np.linalg.norm(joints[k] - place) for k, place in landmarks.items()}
    return [
        f"the {in_words(body.parts.names[k])} is {100 * miss:.0f} cm from its landmark"
        for k, miss in misses.items()
        if miss > FARTHEST_MISS
    ]


def _unseen_parts(body: RegistrationModel, vertices: ShownParts, *, up_is_known: bool) -> list[str]:
    """Return a message about the parts that a scan does not show."""
    areas = body.model.template.vertex_areas
    share = 1.0 - areas @ vertices.seen / areas.sum()
    if share < LEAST_UNSEEN and not vertices.lost.any():
        return []
    unseen = [body.parts.names[k] for k in np.flatnonzero(body.parts.shares(vertices.seen) < 0.5)]
    guessed_up = bool(share > GUESSED_UP and not up_is_known)
    return [say_unseen(unseen, share, guessed_up=guessed_up)]


def _other_units(scan: Scan, background: Booleans) -> list[str]:
    """Return a message if the scan, in another unit, would also have the size of a body."""
    extent = float(np.ptp(scan.points[~background], axis=0).max())
    others = [unit for unit in likely_units(extent * UNITS[scan.unit]) if unit != scan.unit]
    return [
        f"the scan may be in {unit}: it is {extent:.2f} m long, and {scan.unit} were inferred "
        "from this size; set the unit with unit= or --unit"
        for unit in others[:1]
    ]
