"""The search over headings, start poses and up directions, by soft assignment.

In go a model and a prepared scan; out comes a `Search`: the starts, the candidates that each round
kept, and the scan with normals oriented like those of the likeliest body. Unlikely starts are
dropped early.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.bodies import rotation_matrix
from riemhuman.kernels.compilation import SUM, compiled
from riemhuman.kernels.threads import mapped
from riemhuman.registration._constants import (
    ARM_GAIN,
    ARM_ROUNDS,
    FAR_MISS,
    LANDMARK_WEIGHT,
    LEAST_SHOWN,
    LONGEST_ROTATION,
    MISS_METRES,
    MORE_STARTS,
    N_DENSE,
    N_SHIFTS,
    NORMALS_AGREE,
    SAME_METRES,
    SCAN_WORTH,
    SEARCH_ROUNDS,
    UP_MARGIN,
    USUAL_AREA,
    WARM_LOSS,
    WARM_ROUNDS,
    SearchRound,
)
from riemhuman.registration._posed_body import (
    ModelSamples,
    Pose,
    Prior,
    normal_equations,
    pose_body,
    take_step,
)
from riemhuman.registration._registration_model import End, RegistrationModel
from riemhuman.registration._scan_preparation import N_THREADS, PreparedScan, even_points
from riemhuman.registration._start_poses import UP_POSES, other_arms
from riemhuman.surfaces.measures import triangle_areas

# Exponents that are larger count for nothing in the soft assignment: e⁻³⁰ is far below the share of
# outliers, and still smaller ones become denormal numbers, which are slow.
_NEGLIGIBLE = 30.0
# Concentration κ of the normals, and the expected share of scan points that do not belong to the
# body, spread over a cubic metre. They are no settings, because the compiler folds them into the
# loops: as arguments, they change the last digits of every result.
KAPPA, OUTLIERS = 2.0, 0.05


# More than eight arguments, because a compiled loop takes plain arrays.
@compiled(fastmath=SUM)
def assign(
    points: Array,
    normals: Array,
    areas: Array,
    scan: Array,
    scan_normals: Array,
    sigma: float,
    signed: bool,
    masses: Array,
    targets: Array,
) -> float:
    """Fill masses and targets of the body's points, and return the mean log-likelihood."""
    # Masses are the expected numbers of scan points that belong to each point of the body, targets
    # the sums of these scan points.
    n = points.shape[1]
    share = np.empty(n, np.float32)
    # exp(−t) as (1 − t/1024)^1024, which needs only multiplications.
    scale = np.float32(0.5 / (sigma * sigma) / 1024.0)
    angular = np.float32(KAPPA / 1024.0)
    unit, zero = np.float32(1.0), np.float32(0.0)
    least = np.float32(1.0 - _NEGLIGIBLE / 1024.0)
    # The mean of exp(κ (n·m − 1)) over all directions.
    mean_angular = (1.0 - math.exp(-2.0 * KAPPA)) / (2.0 * KAPPA)
    volume = (2.0 * math.pi * sigma * sigma) ** 1.5 * mean_angular / (1.0 - OUTLIERS)
    outliers = np.float32(OUTLIERS * volume)
    point_x, point_y, point_z = points[0], points[1], points[2]
    normal_x, normal_y, normal_z = normals[0], normals[1], normals[2]
    target_x, target_y, target_z = targets[0], targets[1], targets[2]
    masses[:] = zero
    targets[:] = zero
    likelihood = 0.0
    for j in range(scan.shape[0]):
        x, y, z = scan[j, 0], scan[j, 1], scan[j, 2]
        p, q, r = scan_normals[j, 0], scan_normals[j, 1], scan_normals[j, 2]
        total = zero
        for i in range(n):
            dx, dy, dz = point_x[i] - x, point_y[i] - y, point_z[i] - z
            cosine = normal_x[i] * p + normal_y[i] * q + normal_z[i] * r
            cosine = cosine if signed else abs(cosine)
            t = unit - (dx * dx + dy * dy + dz * dz) * scale - (unit - cosine) * angular
            t = t if t > least else zero
            for _ in range(10):
                t *= t
            t *= areas[i]
            share[i] = t
            total += t
        likelihood += math.log(total + outliers)
        factor = unit / (total + outliers)
        for i in range(n):
            t = share[i] * factor
            masses[i] += t
            target_x[i] += t * x
            target_y[i] += t * y
            target_z[i] += t * z
    mean: float = likelihood / scan.shape[0]
    return mean - math.log(volume)


def _single(values: Array) -> Array:
    """Return numbers in single precision, for which compiled loops have the same type."""
    return values.astype(np.float32)


def anneal(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: PreparedScan,
    sigmas: Array,
    end: End | None,
) -> tuple[Pose, float]:
    """Fit a body to a scan by a step for each deviation but the last, that of the likelihood."""
    n, n_joints = body.weights.shape
    areas = _single(body.areas)
    points, scan_normals = _single(scan.points), _single(scan.normals)
    masses, targets = _single(np.zeros(n)), _single(np.zeros((3, n)))
    landmarks = np.full((n, 3), np.nan)
    for joint, position in scan.landmarks.items():
        landmarks[n - n_joints + joint] = position
    known = ~np.isnan(landmarks[:, 0])
    for number, sigma in enumerate(sigmas):
        posed = pose_body(body, pose)
        if end is not None:
            shown = body.areas * end.shows(posed.points)
            areas = _single(shown / max(shown.sum(), LEAST_SHOWN))
        likelihood = assign(
            np.ascontiguousarray(_single(posed.points.T)),
            np.ascontiguousarray(_single(posed.normals.T)),
            areas,
            points,
            scan_normals,
            sigma,
            scan.signed,
            masses,
            targets,
        )
        if number == len(sigmas) - 1:
            likelihood -= landmark_cost(posed.points[-n_joints:], scan.landmarks)
            break
        # The smallest positive number stands for a mass of 0, whose share is 0.
        means = targets.T / np.maximum(masses, np.finfo(np.float32).tiny)[:, np.newaxis]
        gaps = np.where(known[:, np.newaxis], landmarks, means) - posed.points
        shares = np.where(known, LANDMARK_WEIGHT, masses / len(points))
        if end is not None:
            # Near the end, the points that belong to a point of the body are on one side of it.
            shares = np.where(known | end.shows(posed.points, sigma), shares, 0.0)
        weight = sigma * sigma / SCAN_WORTH
        equations = normal_equations(posed, prior, weight, shares, gaps, posed.normals, 1.0)
        pose = take_step(posed, equations, LONGEST_ROTATION)
    return pose, likelihood


def landmark_cost(joints: Array, landmarks: Mapping[int, Array]) -> float:
    """Return how much landmarks far from their joints lower the log-likelihood."""
    misses = [np.linalg.norm(joints[joint] - place) for joint, place in landmarks.items()]
    squares = np.minimum(misses, FAR_MISS) ** 2
    return LANDMARK_WEIGHT * float(np.sum(squares)) / (2.0 * MISS_METRES**2)


def advance(
    body: RegistrationModel, candidates: list[Candidate], stage: SearchRound, scan: PreparedScan
) -> list[Candidate]:
    """Return the likeliest candidates after one round, the best first."""
    advanced = _fit_starts(body, candidates, stage, scan)
    advanced.sort(key=lambda candidate: -candidate.likelihood)
    return _different(advanced, body.samples(stage.n_model), stage.n_best)


def _fit_starts(
    body: RegistrationModel, candidates: list[Candidate], stage: SearchRound, scan: PreparedScan
) -> list[Candidate]:
    """Return candidates after the steps of one round, in their order."""
    samples = body.samples(stage.n_model)
    chosen = even_points(scan.points, stage.n_scan)
    few = replace(scan, points=scan.points[chosen], normals=scan.normals[chosen])
    sigmas = np.append(np.geomspace(*stage.sigmas, stage.n_steps), stage.sigmas[1])
    fit = partial(_fit_start, body, samples, few, sigmas, scan.points)
    return list(mapped(fit, candidates, N_THREADS))


def _fit_start(
    body: RegistrationModel,
    samples: ModelSamples,
    few: PreparedScan,
    sigmas: Array,
    points: Array,
    start: Candidate,
) -> Candidate:
    """Return one candidate after the steps of a round; `points` are all of the scan."""
    end = body.end_of(points, start.up)
    pose, likelihood = anneal(samples, start.pose, start.prior, few, sigmas, end)
    return replace(start, pose=pose, likelihood=likelihood)


def _different(candidates: list[Candidate], samples: ModelSamples, n_best: int) -> list[Candidate]:
    """Return the best candidates that are not close to a better one."""
    different: list[Candidate] = []
    surfaces: list[Array] = []
    for candidate in candidates:
        if len(different) == n_best:
            break
        points = pose_body(samples, candidate.pose).points
        if all(np.sqrt(np.mean((points - better) ** 2) * 3) > SAME_METRES for better in surfaces):
            different.append(candidate)
            surfaces.append(points)
    return different


def find_likelihood_of_area(
    body: RegistrationModel,
    pose: Pose,
    scan: PreparedScan,
    up: Array,
    visible: Booleans | None = None,
) -> float:
    """Return the log-likelihood for a body of the standard area, as in the search's last step."""
    model = body.model
    areas = triangle_areas(model(pose.betas[: model.n_betas]), model.faces)
    area = areas.sum() if visible is None else areas @ visible[model.faces[:, 0]]
    last = SEARCH_ROUNDS[-1]
    stage = last._replace(sigmas=(last.sigmas[1], last.sigmas[1]), n_steps=0)
    candidate = Candidate(pose, body.prior(pose), -np.inf, up)
    (fitted,) = _fit_starts(body, [candidate], stage, replace(scan, landmarks={}))
    return fitted.likelihood + float(np.log(area / USUAL_AREA))


_UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Candidate:
    """A body fitted from one start."""

    pose: Pose
    prior: Prior
    likelihood: float  # mean log-likelihood of the scan points in the last round
    up: Array  # direction up of its start
    number: int = 0  # of its start
    known: bool = False  # whether it started from the same person's body a moment before


def make_starts(
    body: RegistrationModel,
    scan: PreparedScan,
    names: Iterable[str],
    ups: Iterable[Array],
    offset: float,
) -> list[Candidate]:
    """Return starts of some poses with all headings, which begin at an offset, in steps."""
    n_headings = body.settings.n_headings
    angles = (np.arange(n_headings) + offset) * (2.0 * np.pi / n_headings)
    first = SEARCH_ROUNDS[0]
    centre = scan.points[even_points(scan.points, first.n_scan)].mean(axis=0)
    betas = np.zeros(len(body.betas_precisions))
    starts: list[Candidate] = []
    for up in ups:
        upright = Rotation.align_vectors(up, _UP)[0].as_matrix()
        for name in names:
            for angle in angles:
                local = body.poses[name].copy()
                local[body.root] = upright @ rotation_matrix(angle * _UP) @ local[body.root]
                shift = _shift_to(body, scan, Pose(local, betas, np.zeros(3)), centre, up)
                prior = body.prior(Pose(body.poses[name], betas, shift))
                pose = Pose(local, betas, shift)
                starts.append(Candidate(pose, prior, -np.inf, up, len(starts)))
    return starts


def _shift_to(
    body: RegistrationModel, scan: PreparedScan, pose: Pose, centre: Array, up: Array
) -> Array:
    """Return the translation that brings what a scan shows of a body to the centre of the scan."""
    samples, end = body.samples(SEARCH_ROUNDS[0].n_model), body.end_of(scan.points, up)
    points = pose_body(samples, pose).points
    shift: Array = centre - samples.areas @ points
    if end is not None:
        for _ in range(N_SHIFTS):
            shown = samples.areas * end.shows(points + shift)
            shift = centre - shown @ points / shown.sum()
    return shift


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


def search_scan(
    body: RegistrationModel,
    scan: PreparedScan,
    known: Candidate | None = None,
    *,
    again: bool = False,
    quick: bool = False,
) -> Search:
    """Return the likeliest bodies, and the scan with normals oriented like theirs."""
    began = perf_counter()
    search = _search_near(body, scan, known, again=again, quick=quick)
    if scan.estimated or scan.parts is not None:
        normals, agreement = orient_normals(body, scan, search.candidates[0].pose)
        if scan.signed and agreement < NORMALS_AGREE:
            scan = replace(scan, signed=False)
            search = _search_near(body, scan, known, again=again, quick=quick)
            normals, _ = orient_normals(body, scan, search.candidates[0].pose)
        oriented = replace(scan, normals=normals, signed=True)
        search = replace(search, scan=oriented, signed=scan.signed)
    return replace(search, seconds=perf_counter() - began)


def _search_near(
    body: RegistrationModel,
    scan: PreparedScan,
    known: Candidate | None,
    *,
    again: bool,
    quick: bool,
) -> Search:
    """Return the search from a known body if it leads to one as likely, or from all starts.

    The known one has the likelihood of its own scan, for the standard area.
    """
    if known is not None:
        rounds = _follow(body, [known], WARM_ROUNDS, scan)
        (found,) = rounds[-1]
        likelihood = find_likelihood_of_area(body, found.pose, scan, known.up)
        if likelihood > known.likelihood - WARM_LOSS:
            return Search(body, scan, [known], rounds, [found])
    return search_starts(body, scan, again=again, quick=quick)


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
    more = 1.0 / MORE_STARTS if quick else MORE_STARTS if again else 1.0
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
    return np.array([axis for axis in axes if best[axis] > likeliest - UP_MARGIN])


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
    for rotations in other_arms(arm, best.prior.local, body.poses):
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
