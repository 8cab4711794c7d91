"""The last stage: which bodies, limbs and vertices are trusted, and messages about the others.

In go a search, the body fitted from it and what the scan shows of it; out comes a `Verdict`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.checks import UNITS, likely_units
from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._clothes import BodyBeneath
from riemhuman.registration._constants import (
    BARE_SHARE,
    BODY_MARGIN,
    FAR_BARE,
    FAR_METRES,
    FAR_SHARE,
    FARTHEST_MISS,
    LARGEST_BETA,
    LEAST_LIKELIHOOD,
    LEAST_LIKELIHOOD_CLOTHED,
    LEAST_NEAR,
    LEAST_NEAR_OF_LIMB,
    LEAST_REST_METRES,
    LEAST_UNSEEN,
    LIMB_ELSEWHERE,
    LIMB_METRES,
    MATCHED_METRES,
    N_DENSE,
    NEAR_METRES,
    RIVAL_METRES,
    SEARCH_ROUNDS,
)
from riemhuman.registration._dense_fit import find_hair
from riemhuman.registration._elastic_step import ElasticFit
from riemhuman.registration._limb_rivals import LimbDoubt, find_limb_doubts
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._messages import (
    MARK_JOINTS,
    in_words,
    join_reasons,
    part_in_words,
    say_unseen,
)
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import even_points
from riemhuman.registration._shown_parts import ShownParts
from riemhuman.registration._start_search import Search, find_likelihood_of_area
from riemhuman.registration.scans import Scan
from riemhuman.surfaces.nearest_points import SurfacePoints, nearest_points

# Joints of the parts of limbs that are compared with the rest of the body.
_LIMB_PARTS = ("shoulder", "elbow", "wrist", "hip", "knee")
# With fewer points of the scan, nothing is known about a part of a limb.
_LEAST_POINTS = 20


def find_excess(parts: BodyParts, owners: Integers, distances: Array) -> Array:
    """Return by which factor a scan is farther from each limb than from the rest of the body.

    Noise, clothes and what the model cannot show of a person are in both distances. Joints that
    are no limb's, and those near few points, have 1.

    Parameters
    ----------
    owners : ndarray, shape (N,)
        The joint that moves the surface next to each point of the scan most.
    distances : ndarray, shape (N,)
        From the surface, metres.

    Returns
    -------
    excess : ndarray, shape (J,)
    """
    excess = np.ones(len(parts.names))
    arms = [arm[1:] for arm in parts.arms]
    on_hands = np.isin(owners, [arm[-1] for arm in arms])
    far = np.minimum(distances, LIMB_METRES)
    for k, name in enumerate(parts.names):
        if name.split("_")[-1] not in _LIMB_PARTS:
            continue
        limb = next((arm for arm in arms if k in arm), np.array([k]))
        on_joint, rest = owners == k, ~np.isin(owners, limb) & ~on_hands
        if on_joint.sum() >= _LEAST_POINTS and rest.any():
            excess[k] = far[on_joint].mean() / max(far[rest].mean(), LEAST_REST_METRES)
    return excess


@dataclass(frozen=True)
class FitQuality:
    """Measures of how well a registered body explains its scan."""

    likelihood: float
    margin: float  # factor by which it is likelier than bodies elsewhere
    near: float  # share of the scan near the body
    betas: float  # root mean square of the shape coefficients
    far: float  # distance from the model that nearly all of the scan is within, metres
    limb: str  # the limb of which the least is matched, in words
    limb_matched: float  # share of it that is
    near_metres: float = NEAR_METRES  # what counts as near
    bare: float | None = None  # as `far`, of head, hands and feet alone, if the scan shows clothes

    @property
    def least_likelihood(self) -> float:
        """The smallest log-likelihood of a scan that looks like one person."""
        return LEAST_LIKELIHOOD if self.bare is None else LEAST_LIKELIHOOD_CLOTHED


def find_doubts(quality: FitQuality) -> tuple[list[str], list[str]]:
    """Return the reasons to distrust a registration, and those to distrust one limb of it."""
    reasons: list[str] = []
    of_limb: list[str] = []
    if quality.near < LEAST_NEAR:
        reasons.append(
            f"only {100 * quality.near:.0f} % of the scan lies within "
            f"{100 * quality.near_metres:.0f} cm of the body: there is something else in it, or "
            "more than one person"
        )
    if quality.likelihood < quality.least_likelihood:
        reasons.append(
            "the scan does not look like one person: check its unit and direction up, and that it "
            "shows a single body"
        )
    if reasons:
        return reasons, of_limb  # the other checks make sense only for bodies
    if quality.margin < BODY_MARGIN:
        reasons.append(
            f"a body that faces or stands differently fits almost as well; {MARK_JOINTS}"
        )
    if quality.near < LEAST_NEAR_OF_LIMB and quality.limb_matched < LIMB_ELSEWHERE:
        of_limb.append(
            f"{100 * (1.0 - quality.near):.1f} % of the scan lies more than "
            f"{100 * quality.near_metres:.0f} cm from the body, and hardly any of it matches the "
            f"{quality.limb}, which may be elsewhere; {MARK_JOINTS}"
        )
    if quality.bare is not None:
        if quality.bare > FAR_BARE:
            reasons.append(
                f"the head, hands and feet fit badly: {100 * (1 - BARE_SHARE):.0f} % of the scan "
                f"of them lies more than {100 * quality.bare:.1f} cm from the model's surface; the "
                f"body may face the wrong way or have limbs in wrong places; {MARK_JOINTS}"
            )
    elif quality.far * np.exp(-quality.likelihood) > FAR_METRES:
        reasons.append(
            f"the body fits badly: {100 * (1 - FAR_SHARE):.0f} % of the scan lies more "
            f"than {100 * quality.far:.1f} cm from the model's surface; it may face the wrong way, "
            f"have limbs in wrong places or wear clothes (then say so); {MARK_JOINTS}"
        )
    if quality.betas > LARGEST_BETA:
        reasons.append(
            "the body shape is far from all people the model knows: check the unit, and for "
            "clothes or other things in the scan"
        )
    return reasons, of_limb


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
    is_body = quality.near >= LEAST_NEAR and likelihood >= quality.least_likelihood
    doubts += _landmark_doubts(body, fit.pose, scan.landmarks)
    if doubts and not unit_is_known:
        doubts = [*_other_units(whole, background), *doubts]
    trusted_vertices = vertices.seen & (not doubts)
    if limb_doubts:
        limb = int(np.argmin(parts.shares(vertices.matched)))
        trusted_vertices &= ~parts.limb_vertices(limb)
    # No vertex of a refused body is trusted, so its limbs need no rivals.
    near = ~background & (distances < NEAR_METRES)
    owners = parts.owners[body.model.faces[places.triangles[near], 0]]
    excess = find_excess(parts, owners, distances[near])
    limb_rivals = [] if doubts else find_limb_doubts(fitted, vertices.matched, excess)
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
        excess=excess,
    )


def judge_beneath(verdict: Verdict, search: Search, beneath: BodyBeneath) -> Verdict:
    """Return the verdict about the body beneath clothes, from that about the dressed one."""
    parts, areas = search.body.parts, search.body.model.template.vertex_areas
    share = float(areas @ beneath.hidden / areas.sum())
    said = []
    if verdict.trusted_vertices.any() and share > LEAST_UNSEEN:
        hidden = [
            parts.names[joint] for joint in np.flatnonzero(parts.shares(~beneath.hidden) < 0.5)
        ]
        # Soles touch the floor, so that little is known about toes.
        hidden = [name for name in hidden if not name.endswith("toes")]
        said.append(say_unseen(hidden, share, " under clothes"))
    trusted_vertices = verdict.trusted_vertices & ~beneath.hidden
    return _judge_surface(verdict, search, beneath.fit, trusted_vertices, said)


def judge_together(
    verdict: Verdict, search: Search, fit: ElasticFit, borrowed: Booleans
) -> Verdict:
    """Return the verdict about a body found with other scans, from that about the scan alone."""
    areas = search.body.model.template.vertex_areas
    percent = f"{100 * float(areas @ borrowed / areas.sum()):.0f} %"
    said = [f"{percent} of the body is known from the other scans"] if borrowed.any() else []
    return _judge_surface(verdict, search, fit, verdict.trusted_vertices | borrowed, said)


def _judge_surface(
    verdict: Verdict, search: Search, fit: ElasticFit, trusted: Booleans, said: list[str]
) -> Verdict:
    """Return a verdict about another surface of the same body, with more to say."""
    points, faces = search.scan.whole.points, search.body.model.faces
    places, distances = nearest_points(points, fit.points, faces)
    return replace(
        verdict,
        trusted_vertices=trusted,
        message=join_reasons([*([verdict.message] if verdict.message else []), *said]),
        matched=verdict.matched & (fit.matches.distances < MATCHED_METRES),
        correspondence=places,
        distances=distances,
    )


def _measure(
    search: Search, fitted: BodyFit, vertices: ShownParts, likelihood: float
) -> FitQuality:
    """Return how well a body explains its scan."""
    body, scan, fit = search.body, search.scan, fitted.fit
    model = body.model
    some = scan.points[even_points(scan.points, N_DENSE)]
    some = some[~find_hair(body, fit.model_points, some)]
    _, gaps = nearest_points(some, fit.points, model.faces)
    places, model_distances = nearest_points(some, fit.model_points, model.faces)
    bare = None
    if scan.clothed:
        on_bare = body.parts.bare_ends[model.faces[places.triangles, 0]]
        bare = float(np.quantile(model_distances[on_bare], BARE_SHARE)) if on_bare.any() else 0.0
    betas = fit.pose.betas[: model.n_betas]
    shares = body.parts.shares(vertices.matched)
    limb = int(np.argmin(shares))
    return FitQuality(
        likelihood=likelihood,
        margin=find_margin(search),
        near=float(np.mean(gaps < scan.near_metres)),
        betas=float(np.sqrt(np.mean(betas**2))) if len(betas) else 0.0,
        far=float(np.quantile(model_distances, FAR_SHARE)),
        limb=part_in_words(body.parts.names[limb]),
        limb_matched=float(shares[limb]),
        near_metres=scan.near_metres,
        bare=bare,
    )


def find_margin(search: Search) -> float:
    """Return how much likelier the best body is than all bodies whose visible part is elsewhere."""
    candidates, samples = search.candidates, search.body.samples(SEARCH_ROUNDS[-1].n_model)
    surface = pose_body(samples, candidates[0].pose).points
    end = search.body.end_of(search.scan.points, candidates[0].up)
    shown = np.ones(len(surface), bool)
    if end is not None:
        shown = (samples.areas > 0) & end.shows(surface)
    elsewhere = [
        candidate.likelihood
        for candidate in candidates[1:]
        if np.linalg.norm(
            (pose_body(samples, candidate.pose).points - surface)[shown], axis=1
        ).mean()
        > RIVAL_METRES
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
    guessed = "" if up_is_known else "; the up direction was guessed: check it"
    return [say_unseen(unseen, share) + guessed]


def _other_units(scan: Scan, background: Booleans) -> list[str]:
    """Return a message if the scan, in another unit, would also have the size of a body."""
    extent = float(np.ptp(scan.points[~background], axis=0).max())
    others = [unit for unit in likely_units(extent * UNITS[scan.unit]) if unit != scan.unit]
    return [
        f"the scan may be in {unit}: it is {extent:.2f} m long, and {scan.unit} were inferred "
        "from this size; check the unit"
        for unit in others[:1]
    ]
