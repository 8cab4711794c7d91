"""Soft assignment of a scan's points to a body, by which starts are fitted and compared.

In the soft assignment, a scan point x with normal m belongs to the body's point v with normal n and
share of area A with the probability P ∝ A exp(−|v − x|²/2σ² + κ (n·m − 1)); a uniform density
models points that belong to none. This is the mixture of coherent point drift (Myronenko and Song
2010, equations 2 to 4) with areas as weights and a von Mises–Fisher factor for the normals.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial

import numpy as np

from riemhuman.arrays import Array, Booleans
from riemhuman.kernels.compilation import SUM, compiled
from riemhuman.kernels.threads import mapped
from riemhuman.registration._constants import (
    FAR_MISS,
    FINE_ROUND,
    LANDMARK_WEIGHT,
    LEAST_SHOWN,
    MISS_METRES,
    SAME_METRES,
    SCAN_WORTH,
    SEARCH_LONGEST_ROTATION,
    SEARCH_ROUNDS,
    USUAL_AREA,
    SearchRound,
)
from riemhuman.registration._even_points import even_points
from riemhuman.registration._posed_body import ModelSamples, Pose, Prior, pose_body, take_step
from riemhuman.registration._registration_model import End, RegistrationModel
from riemhuman.registration._scan_preparation import N_THREADS, PreparedScan
from riemhuman.registration._starts import Candidate
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
        pose = take_step(
            posed, prior, weight, shares, gaps, posed.normals, 1.0, SEARCH_LONGEST_ROTATION
        )
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
    samples, same_metres = body.samples(stage.n_model), SAME_METRES
    return _different(advanced, samples, stage.n_best, same_metres)


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


def _different(
    candidates: list[Candidate], samples: ModelSamples, n_best: int, same_metres: float
) -> list[Candidate]:
    """Return the best candidates that are not close to a better one."""
    different: list[Candidate] = []
    surfaces: list[Array] = []
    for candidate in candidates:
        if len(different) == n_best:
            break
        points = pose_body(samples, candidate.pose).points
        if all(np.sqrt(np.mean((points - better) ** 2) * 3) > same_metres for better in surfaces):
            different.append(candidate)
            surfaces.append(points)
    return different


def find_likelihoods(
    body: RegistrationModel, poses: Iterable[Pose], scan: PreparedScan, up: Array
) -> list[float]:
    """Return mean log-likelihoods of a scan with the last deviation of the last round."""
    last = SEARCH_ROUNDS[-1]
    stage = last._replace(sigmas=(last.sigmas[1], last.sigmas[1]), n_steps=0)
    candidates = [Candidate(pose, body.prior(pose), -np.inf, up) for pose in poses]
    fitted = _fit_starts(body, candidates, stage, replace(scan, landmarks={}))
    return [candidate.likelihood for candidate in fitted]


def find_likelihood_of_area(
    body: RegistrationModel,
    pose: Pose,
    scan: PreparedScan,
    up: Array,
    visible: Booleans | None = None,
) -> float:
    """Return the log-likelihood for a body of the standard area."""
    model = body.model
    areas = triangle_areas(model(pose.betas[: model.n_betas]), model.faces)
    area = areas.sum() if visible is None else areas @ visible[model.faces[:, 0]]
    (likelihood,) = find_likelihoods(body, [pose], scan, up)
    return likelihood + float(np.log(area / USUAL_AREA))


def anneal_finely(body: RegistrationModel, best: Candidate, scan: PreparedScan) -> Pose:
    """Return a body after soft assignment with smaller deviations than in the search."""
    stage = FINE_ROUND
    return advance(body, [best], stage, replace(scan, landmarks={}))[0].pose
