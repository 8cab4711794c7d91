"""The search over headings, start poses and up directions, which drops unlikely starts.

In go a model and a prepared scan; out comes a `Search`: the starts, the candidates that each round
kept, and the scan with normals oriented like those of the likeliest body.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Integers
from riemhuman.registration._constants import (
    ARM_GAIN,
    ARM_ROUNDS,
    FEWER_STARTS,
    MORE_STARTS,
    N_DENSE,
    NORMALS_AGREE,
    SAME_ROTATIONS,
    SEARCH_ROUNDS,
    UP_MARGIN,
    WARM_BETAS_PRECISION,
    WARM_LOSS,
    WARM_ROUNDS,
    SearchRound,
)
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._soft_assignment import advance, find_likelihood_of_area
from riemhuman.registration._start_poses import UP_POSES, other_arms
from riemhuman.registration._starts import Candidate, make_starts

_AXES = np.concatenate([np.eye(3), -np.eye(3)])


@dataclass(frozen=True, eq=False)
class Search:
    """The result of a search."""

    body: RegistrationModel
    scan: PreparedScan  # with normals oriented like those of the likeliest body
    starts: list[Candidate]
    rounds: list[list[Candidate]]  # candidates that each round kept, the likeliest first
    candidates: list[Candidate]  # those of the last round, the first with its likeliest arms
    is_quick: bool = False  # whether no arms were tried, and fewer starts followed
    signed: bool = True  # whether the signs of the scan's normals counted
    seconds: float = 0.0  # that it took


@dataclass(frozen=True, eq=False)
class KnownBody:
    """A body found in a scan of the same person a moment before."""

    pose: Pose
    up: Array
    likelihood: float


def search_scan(
    body: RegistrationModel,
    scan: PreparedScan,
    known: KnownBody | None = None,
    *,
    again: bool = False,
    quick: bool = False,
) -> Search:
    """Return the likeliest bodies, and the scan with normals oriented like theirs."""
    began = perf_counter()
    search = _search_near(body, scan, known, again=again, quick=quick)
    if not scan.estimated and scan.parts is None:
        return replace(search, seconds=perf_counter() - began)
    normals, agreement = orient_normals(body, scan, search.candidates[0].pose)
    if scan.signed and agreement < NORMALS_AGREE:
        scan = replace(scan, signed=False)
        search = _search_near(body, scan, known, again=again, quick=quick)
        normals, _ = orient_normals(body, scan, search.candidates[0].pose)
    oriented = replace(scan, normals=normals, signed=True)
    seconds = perf_counter() - began
    return replace(search, scan=oriented, signed=scan.signed, seconds=seconds)


def _search_near(
    body: RegistrationModel,
    scan: PreparedScan,
    known: KnownBody | None,
    *,
    again: bool,
    quick: bool,
) -> Search:
    """Return the search from a known body if it leads to one as likely, or from all starts."""
    if known is not None:
        search = search_from(body, scan, known.pose, known.up)
        pose = search.candidates[0].pose
        likelihood = find_likelihood_of_area(body, pose, scan, known.up)
        if likelihood > known.likelihood - WARM_LOSS:
            return search
    return search_starts(body, scan, again=again, quick=quick)


def search_from(body: RegistrationModel, scan: PreparedScan, pose: Pose, up: Array) -> Search:
    """Return the search from one known start, the body a moment before."""
    precisions = WARM_BETAS_PRECISION * body.betas_precisions
    prior = body.prior(pose)._replace(betas_precisions=precisions)
    starts = [Candidate(pose, prior, -np.inf, up, known=True)]
    rounds = _follow(body, starts, WARM_ROUNDS, scan)
    return Search(body, scan, starts, rounds, rounds[-1])


def search_starts(
    body: RegistrationModel,
    scan: PreparedScan,
    *,
    again: bool = False,
    quick: bool = False,
) -> Search:
    """Return the bodies from the likeliest starts."""
    # A repeated search starts from the headings in between and follows more starts. A quick one
    # follows fewer and tries no arms.
    offset = 0.5 if again else 0.0
    more = FEWER_STARTS if quick else MORE_STARTS if again else 1.0
    first, *later = SEARCH_ROUNDS
    rounds = [
        first._replace(n_best=int(max(more, 1.0) * first.n_best)),
        *(stage._replace(n_best=max(int(more * stage.n_best), 1)) for stage in later),
    ]
    ups = _likely_ups(body, scan, rounds[:2], offset)
    starts = make_starts(body, scan, body.poses, ups, offset)
    kept = _follow(body, starts, rounds, scan)
    search = Search(body, scan, starts, kept, kept[-1], is_quick=quick)
    return search if quick else with_likeliest_arms(search)


def _likely_ups(
    body: RegistrationModel, scan: PreparedScan, rounds: Sequence[SearchRound], offset: float
) -> Array:
    """Return the directions up of a scan or, if they are unknown, the likeliest axes."""
    if scan.up is not None:
        return np.stack([scan.up, *scan.other_ups])
    few = [name for name in UP_POSES if name in body.poses] or list(body.poses)
    starts = make_starts(body, scan, few, _AXES, offset)
    best: dict[tuple[float, ...], float] = {}
    for candidate in _follow(body, starts, rounds, scan)[-1]:
        best.setdefault(tuple(candidate.up), candidate.likelihood)
    likeliest = max(best.values())
    axes = sorted(best, key=lambda axis: -best[axis])[:2]
    margin = UP_MARGIN
    return np.array([axis for axis in axes if best[axis] > likeliest - margin])


def _follow(
    body: RegistrationModel,
    candidates: list[Candidate],
    rounds: Sequence[SearchRound],
    scan: PreparedScan,
) -> list[list[Candidate]]:
    """Return the likeliest candidates after each of some rounds, the best first."""
    kept = []
    for stage in rounds:
        candidates = advance(body, candidates, stage, scan)
        kept.append(candidates)
    return kept


def with_likeliest_arms(search: Search) -> Search:
    """Return a search whose best candidate has each arm as in the likeliest start pose."""
    best, *others = search.candidates
    fitted = best
    for arm in search.body.arms:
        fitted = _with_likeliest_arm(search.body, fitted, arm, search.scan)
    # The others still have the arms of their starts, so compare the earlier likelihoods.
    return replace(search, candidates=[replace(fitted, likelihood=best.likelihood), *others])


def _with_likeliest_arm(
    body: RegistrationModel, best: Candidate, arm: Integers, scan: PreparedScan
) -> Candidate:
    """Return a body with one arm as in a start pose, if that is likelier."""
    first, last = ARM_ROUNDS
    others = []
    for rotations in other_arms(arm, best.prior.local, body.poses, SAME_ROTATIONS):
        local, expected = best.pose.local.copy(), best.prior.local.copy()
        local[arm] = expected[arm] = rotations
        pose, prior = best.pose._replace(local=local), best.prior._replace(local=expected)
        others.append(replace(best, pose=pose, prior=prior))
    if not others:
        return best
    others = advance(body, others, first, scan)
    (likeliest,) = advance(body, others, last, scan)
    (current,) = advance(body, [best], last, scan)
    return likeliest if likeliest.likelihood > current.likelihood + ARM_GAIN else best


def orient_normals(body: RegistrationModel, scan: PreparedScan, pose: Pose) -> tuple[Array, float]:
    """Return normals oriented like the body's, and the share that already were."""
    samples = body.samples(N_DENSE)
    posed, skin = pose_body(samples, pose), samples.numbers >= 0
    near = cKDTree(posed.points[skin]).query(scan.points, k=5)[1]
    cosines = np.einsum("nkx,nx->n", posed.normals[skin][near], scan.normals)
    if scan.parts is not None:  # which are oriented as a whole
        cosines = np.bincount(scan.parts, cosines)[scan.parts]
    signs = np.where(cosines < 0, -1.0, 1.0)
    return signs[:, np.newaxis] * scan.normals, float(np.mean(cosines >= 0))
