"""The stages of a registration in order: search, dense fit, arms and hands, elastic step, trust.

If the scan is said to show clothes, the body beneath them is found last, from the dressed one.

In goes a `ScanTask`, a prepared scan with the models to fit; out comes a `RegistrationTrace`, the
values of all stages. A doubtful result is searched again: from other starts, without a floor, and
as half a body.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from riemhuman.arrays import Array
from riemhuman.registration._arms_and_hands import BodyFit, fit_arms_and_hands
from riemhuman.registration._clothes import find_body_beneath
from riemhuman.registration._constants import (
    BODY_MARGIN,
    CLEARLY_NEAR,
    LEAST_MATCHED_HALF,
    LEAST_NEAR,
    SAME_METRES,
    SAME_WAY,
    SEARCH_ROUNDS,
)
from riemhuman.registration._crossed_limbs import uncross_limbs
from riemhuman.registration._dense_fit import fit_densely, is_clearly_refused
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._shown_parts import leave_out_lost_limbs
from riemhuman.registration._start_search import (
    Candidate,
    Search,
    find_likelihood_of_area,
    search_scan,
    with_likeliest_arms,
)
from riemhuman.registration._verdict import find_margin, judge, judge_beneath
from riemhuman.registration.registered_scans import RegistrationTrace

_SIDES = ("left", "right")
# Cosine of the pelvis' left with the horizontal below which the forward direction is used instead.
_LEAST_LEVEL = 0.3


def find_up(body: RegistrationModel, pose: Pose, scan: PreparedScan, start_up: Array) -> Array:
    """Return the direction up of a body in a scan: that of its start, or a better one."""
    if scan.up is None:
        return _standing_up(body, pose, start_up)
    return _upright_plane(body, pose, scan.up, scan.other_ups) if scan.other_ups else start_up


def _standing_up(body: RegistrationModel, pose: Pose, up: Array) -> Array:
    """Return an axis or, if feet and trunk both lean away from it, the direction up of the feet."""
    names = body.parts.names
    if not {"left_ankle", "right_ankle", "neck"} <= {*names}:
        return up
    motions = body.joint_motions(pose)
    left, right = (motions.rotations[names.index(f"{s}_ankle")][:, 1] for s in _SIDES)
    trunk = motions.positions[names.index("neck")] - motions.positions[body.root]
    trunk, feet = (way / np.linalg.norm(way) for way in (trunk, left + right))
    leans = max(feet @ up, trunk @ up) < SAME_WAY and left @ right > SAME_WAY
    return feet if leans else up


def _upright_plane(
    body: RegistrationModel, pose: Pose, up: Array, other_ups: tuple[Array, ...]
) -> Array:
    """Return the plane's normal along which the trunk is upright, or else `up`."""
    root = body.joint_motions(pose).rotations[body.root]
    best = max((up, *other_ups), key=lambda normal: float(root[:, 1] @ normal))
    return best if root[:, 1] @ best > SAME_WAY else up


def upright_transform(points: Array, root: Array, up: Array) -> Array:
    """Return the rigid motion to y up, facing z, of a body with this rotation of its pelvis."""
    # The left side stays level in people who bend forward; models have x to the left, z forward.
    left = root[:, 0] - (root[:, 0] @ up) * up
    if np.linalg.norm(left) < _LEAST_LEVEL:  # someone who lies on one side
        left = np.cross(up, root[:, 2])
    left /= np.linalg.norm(left)
    rotation = np.stack([left, up, np.cross(left, up)])
    rotated = points @ rotation.T
    low, high = rotated.min(axis=0), rotated.max(axis=0)
    transform = np.eye(4)
    transform[:3, :3] = rotation
    transform[:3, 3] = -0.5 * (low + high)
    transform[1, 3] = -low[1]
    return transform


@dataclass(frozen=True, eq=False)
class ScanTask:
    """A scan, the body to fit to it, and the results for half bodies."""

    body: RegistrationModel
    scan: PreparedScan
    up_is_known: bool
    unit_is_known: bool
    found_halves: dict[int, RegistrationTrace] = field(default_factory=dict)

    def half(self, number: int) -> RegistrationTrace:
        """Return the registration of half a body; computed once."""
        if number not in self.found_halves:
            search = search_scan(self.body.halves[number], self.scan)
            self.found_halves[number] = fit_and_judge(search, unit_is_known=self.unit_is_known)
        return self.found_halves[number]


def register_scan(task: ScanTask, known: Candidate | None = None) -> RegistrationTrace:
    """Return the likeliest registration of a whole body or of half a body."""
    first = register_whole(task, known)
    if first.verdict.trusted:
        return first
    retry = _register_again(task, first, again=known is None)
    likelier = retry.verdict.likelihood > first.verdict.likelihood + BODY_MARGIN
    return retry if retry.verdict.trusted or likelier else first


def register_whole(task: ScanTask, known: Candidate | None = None) -> RegistrationTrace:
    """Return the registration of one search, or that of half a body if the scan shows no more."""
    search = search_scan(task.body, task.scan, known)
    return _or_half(task, fit_and_judge(search, unit_is_known=task.unit_is_known))


def fit_and_judge(search: Search, *, unit_is_known: bool = True) -> RegistrationTrace:
    """Return the stages after a search."""
    best, times = search.candidates[0], [perf_counter()]
    dense = fit_densely(search.body, best, search.scan)
    # Limbs of a known body are as a moment before, and those of a refused one do not matter.
    in_doubt = not (best.known or dense.is_refused)
    dense = uncross_limbs(dense) if in_doubt else dense
    times.append(perf_counter())
    arms = fit_arms_and_hands(dense) if in_doubt else dense
    times.append(perf_counter())
    elastic = leave_model(arms.task, arms.pose)
    fitted = BodyFit(arms.task, elastic, arms.arm_fits, arms.hand_fits)
    fitted, shown = leave_out_lost_limbs(fitted, search.scan, is_refused=dense.is_refused)
    times.append(perf_counter())
    verdict = judge(search, fitted, shown, unit_is_known=unit_is_known)
    if search.scan.clothed and not dense.is_refused:
        beneath = find_body_beneath(fitted.task, fitted.fit.pose)
        fitted = replace(fitted, fit=beneath.fit)
        verdict = judge_beneath(verdict, search, beneath)
    up = find_up(search.body, fitted.fit.pose, search.scan, best.up)
    times.append(perf_counter())
    later = ("dense fit", "arms and hands", "elastic step", "trust")
    seconds = {"search": search.seconds, **dict(zip(later, np.diff(times).tolist(), strict=True))}
    return RegistrationTrace(search, dense, arms, fitted.fit, verdict, up, fitted.task, seconds)


def _or_half(task: ScanTask, trace: RegistrationTrace) -> RegistrationTrace:
    """Return a registration, or that of half a body if the scan shows no more."""
    # The model always has legs. If the scan shows none, they are fitted to its trunk and pull the
    # body out of place. Few of their vertices then match, and a body without legs is near the
    # whole scan.
    verdict = trace.verdict
    halves = task.body.parts.halves if verdict.trusted_vertices.any() else []
    for number, missing in enumerate(halves):
        few = verdict.matched[missing].mean() < LEAST_MATCHED_HALF
        if few and _near_share(task.half(number)) >= LEAST_NEAR:
            return task.half(number)
    return trace


def _near_share(trace: RegistrationTrace) -> float:
    """Return the share of a scan, without its background, that is near the body."""
    verdict = trace.verdict
    return float(np.mean(verdict.distances[~verdict.background] < trace.search.scan.near_metres))


def _register_again(task: ScanTask, first: RegistrationTrace, *, again: bool) -> RegistrationTrace:
    """Return the registration from other starts, without a direction up from a floor, or of a half.

    Only the likeliest of these searches is followed to its end, and none that would be refused too.
    """
    likeliest = max(_other_searches(task, first, again=again), key=_likelihood_of)
    if likeliest.is_quick:
        likeliest = with_likeliest_arms(likeliest)
    if _is_refused_too(task, first, likeliest):
        return first
    retry = fit_and_judge(likeliest, unit_is_known=task.unit_is_known)
    return _or_half(task, retry) if likeliest.body is task.body else retry


def _other_searches(task: ScanTask, first: RegistrationTrace, *, again: bool) -> Iterator[Search]:
    """Yield searches that may explain a doubtful scan better."""
    whole, scan, near = task.body, task.scan, _near_share(first)
    if scan.floor is not None and not task.up_is_known:
        without_floor = replace(scan, up=None, floor=None, other_ups=())
        search = search_scan(whole, without_floor, quick=True)
        yield search
        if _likelihood_of(search) > _likelihood_of(first.search) + BODY_MARGIN:
            return  # the floor was none
    # Much of the scan is far from the body: usually it includes something else, and the first
    # search has shown that its normals do not agree with a body's.
    quick = again and near < CLEARLY_NEAR
    scan = replace(scan, signed=first.search.signed) if quick else scan
    yield search_scan(whole, scan, again=again, quick=quick)
    if first.verdict.trusted_vertices.any() or near < CLEARLY_NEAR:
        return
    for half, missing in zip(whole.halves, whole.parts.halves, strict=True):
        if first.verdict.matched[missing].mean() < LEAST_MATCHED_HALF:
            yield search_scan(half, scan, quick=True)


def _is_refused_too(task: ScanTask, first: RegistrationTrace, retry: Search) -> bool:
    """Return whether a search leads to the refused body, or to one that will be refused."""
    search = first.search
    if retry.body is not search.body:
        return False
    samples = retry.body.samples(SEARCH_ROUNDS[-1].n_model)
    bodies = [
        pose_body(samples, searched.candidates[0].pose).points for searched in (search, retry)
    ]
    gap = np.sqrt(np.mean(np.sum((bodies[0] - bodies[1]) ** 2, axis=1)))
    if gap < SAME_METRES:
        # All doubts concern the body alone, except the one about its likelihood among others.
        return find_margin(search) > BODY_MARGIN
    is_likelier = _likelihood_of(retry) > _likelihood_of(search) + BODY_MARGIN
    best = retry.candidates[0].pose
    return not is_likelier and is_clearly_refused(
        retry.body, best, retry.scan.points, retry.scan.near_metres
    )


def _likelihood_of(search: Search) -> float:
    """Return the log-likelihood of a search's best body, for the part that the scan can show."""
    body, best = search.body, search.candidates[0]
    visible = body.find_visible(body.surface(best.pose), search.scan.points, best.up)
    return find_likelihood_of_area(body, best.pose, search.scan, best.up, visible)
