"""Forearms and hands of a dense fit in other ways, of which the nearest to the scan is kept."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.kernels.threads import mapped
from riemhuman.registration._arm_surfaces import ArmSurface
from riemhuman.registration._dense_fit import (
    MODEL_SCALES,
    DenseFit,
    DenseFitter,
    DenseTask,
    fit_closest,
    fit_densely,
    fit_elastic,
    leave_model,
)
from riemhuman.registration._posed_body import Pose, Prior, pose_body
from riemhuman.registration._scan_preparation import N_THREADS, PreparedScan
from riemhuman.registration._start_search import Candidate

# Inverse variance of what does not move while an arm is fitted.
_FIXED = 1e15
# Points of a scan farther from the body belong to no part of it, metres.
_FAR_METRES = 0.1


@dataclass(frozen=True)
class ArmFit:
    """One way to explain a part of a scan by an arm."""

    pose: Pose
    surface: np.ndarray  # (n, 3) vertices of the arm on the model
    distances: np.ndarray  # (m,) of points of the scan from the arm after its elastic step, metres
    strain: float  # factor for bends that arms hardly have

    @property
    def cost(self) -> float:
        """The mean distance, more for an arm that can hardly be so, metres."""
        return self.strain * float(self.distances.mean())


def fit_body(
    fitter: DenseFitter, best: Candidate, scan: PreparedScan
) -> tuple[DenseTask, DenseFit]:
    """Return a body fitted to all points of a scan from its likeliest start, and the task."""
    task, pose = fit_densely(fitter, best, scan)
    if not best.known:  # its arms are as a moment before
        pose = rotate_forearms(task, pose)
        task, pose = pose_hands(task, pose)
    return task, leave_model(task, pose)


def rotate_forearms(task: DenseTask, pose: Pose) -> Pose:
    """Return a body whose forearms are rotated so that they come nearest to the scan."""
    for arm in task.fitter.arm_surfaces:
        points = points_on(task, pose, arm.vertices)
        if not len(points):
            continue
        fits = arm_fits(task, pose, arm, points)
        if not fits:
            continue
        current, *others = fits
        nearest = min(others, key=lambda fit: fit.cost)
        if _are_less(arm, nearest.strain * nearest.distances, current.strain * current.distances):
            pose = fit_closest(task.samples, nearest.pose, task.prior, task.scan)
    return pose


def arm_fits(task: DenseTask, pose: Pose, arm: ArmSurface, points: np.ndarray) -> list[ArmFit]:
    """Return fits of one arm to points of a scan, first that of the pose; none without rivals."""
    settings = arm.settings
    starts = [
        pose._replace(local=arm.rotated(pose.local, forearm, wrist))
        for forearm in settings.forearm_angles
        for wrist in settings.wrist_angles
    ]
    # Many starts lead to the same arm, soon.
    first, last = MODEL_SCALES[: settings.n_first_steps], MODEL_SCALES[settings.n_first_steps :]
    fit_first = partial(fit_arm, task, arm, task.prior, scales=first)
    early = _different(arm, list(mapped(fit_first, starts, N_THREADS)), [])
    fit_last = partial(fit_arm, task, arm, task.prior, scales=last)
    fitted = _different(arm, list(mapped(fit_last, early, N_THREADS)), [pose])
    likelihoods = list(
        mapped(lambda other: task.fitter.likelihood(other, task.scan, task.up), fitted, N_THREADS)
    )
    least = max(likelihoods, default=0.0) - settings.least_likely
    likely = [other for other, value in zip(fitted, likelihoods, strict=True) if value > least]
    # The elastic step takes longest, and hardly changes which arms are near.
    few = points[:: max(len(points) // settings.n_compared, 1)]
    costs = [_cost(arm, few, other) for other in (pose, *likely)]
    most = settings.most_farther * min(costs)
    near = [other for other, cost in zip(likely, costs[1:], strict=True) if cost < most]
    compared = [pose, *near] if near else []
    return list(mapped(partial(_elastic_arm, task, arm, points), compared, N_THREADS))


def _cost(arm: ArmSurface, points: np.ndarray, pose: Pose) -> float:
    """Return the mean distance of points from an arm, more for an arm that can hardly be so."""
    surface = pose_body(arm.skin, pose).points
    distances = arm.distances(surface, points, arm.settings.arm_metres)
    return arm.strain(pose.local) * float(distances.mean())


def _different(arm: ArmSurface, poses: list[Pose], known: list[Pose]) -> list[Pose]:
    """Return the poses in which the arm is where it is in no earlier one."""
    surfaces = [pose_body(arm.skin, pose).points for pose in known]
    different = []
    for pose in poses:
        surface = pose_body(arm.skin, pose).points
        gaps = (np.linalg.norm(surface - other, axis=1).mean() for other in surfaces)
        if min(gaps, default=np.inf) > arm.settings.different_metres:
            surfaces.append(surface)
            different.append(pose)
    return different


def _elastic_arm(task: DenseTask, arm: ArmSurface, points: np.ndarray, pose: Pose) -> ArmFit:
    """Return how near an arm comes to points of the scan after an elastic step."""
    surface = pose_body(arm.skin, pose).points
    fitted, _ = fit_elastic(arm.metric, surface, surface, task.scan, arm.settings.stiffnesses)
    distances = arm.distances(fitted, points, arm.settings.arm_metres)
    return ArmFit(pose, surface, distances, arm.strain(pose.local))


def pose_hands(task: DenseTask, pose: Pose) -> tuple[DenseTask, Pose]:
    """Return a body whose hands have the poses that come nearest to the scan, and its prior."""
    # The elastic step would hide a wrong one: it presses fingers into a fist. Only points on
    # the hand count, because those on the forearm lie as near in all poses.
    n_betas = task.fitter.model.n_betas
    # Twice, because the wrist moves with the first change, if there is one.
    tried: dict[ArmSurface, Pose] = {}
    for arm in (*task.fitter.arm_surfaces, *task.fitter.arm_surfaces):
        if tried.get(arm) is pose:
            continue
        tried[arm] = pose
        points = points_on(task, pose, arm.on_hand)
        if not len(points):
            continue
        now = task.prior.betas[n_betas:]
        others = [now, *(np.where(np.isnan(hands), now, hands) for hands in arm.hands)]
        first, *fits = mapped(partial(_fit_hand, task, pose, arm, points), others, N_THREADS)
        distances, other, prior = min(fits, key=lambda fit: fit[0].mean())
        if _are_less(arm, distances, first[0]):
            task = replace(task, prior=prior)
            pose = fit_closest(task.samples, other, prior, task.scan)
    return task, pose


def _fit_hand(
    task: DenseTask, pose: Pose, arm: ArmSurface, points: np.ndarray, hands: np.ndarray
) -> tuple[np.ndarray, Pose, Prior]:
    """Return distances of points from an arm with other hands, its pose and prior."""
    n_betas = task.fitter.model.n_betas
    prior = task.prior._replace(betas=np.append(task.prior.betas[:n_betas], hands))
    start = pose._replace(betas=np.append(pose.betas[:n_betas], hands))
    fitted = fit_arm(task, arm, prior, start)
    surface = pose_body(arm.skin, fitted).points
    return arm.distances(surface, points, arm.settings.hand_metres), fitted, prior


def points_on(task: DenseTask, pose: Pose, vertices: np.ndarray) -> np.ndarray:
    """Return the points of the scan that lie near some vertices."""
    surface = task.fitter.surface(pose)
    near = cKDTree(surface).query(task.scan.points, distance_upper_bound=_FAR_METRES)[1]
    points: np.ndarray = task.scan.points[np.isin(near, vertices)]
    return points


def fit_arm(
    task: DenseTask,
    arm: ArmSurface,
    prior: Prior,
    start: Pose,
    scales: tuple[float, ...] = MODEL_SCALES,
) -> Pose:
    """Fit one arm and its hand; all else stays as it starts."""
    model = task.fitter.model
    moving = np.isin(np.arange(model.n_joints), arm.joints[1:])
    of_hands = np.arange(len(start.betas)) >= model.n_betas
    of_arm = Prior(
        np.where(moving[:, np.newaxis, np.newaxis], prior.local, start.local),
        np.where(moving, prior.precisions, _FIXED),
        np.where(of_hands, prior.betas, start.betas),
        np.where(of_hands, prior.betas_precisions, _FIXED),
    )
    samples = arm.samples
    samples = samples._replace(areas=samples.areas * task.visible[samples.numbers])
    return fit_closest(samples, start, of_arm, task.scan, scales)


def _are_less(arm: ArmSurface, some: np.ndarray, others: np.ndarray) -> bool:
    """Return whether distances of the same points are less, by more than chance makes them."""
    gains = others - some
    chance = arm.settings.n_errors * np.sqrt(np.mean(gains**2) / len(gains))
    return bool(gains.mean() > max(arm.settings.least_gain * others.mean(), chance))
