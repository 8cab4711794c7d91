"""Other forearms and hands for a dense fit; those nearest to the scan are kept.

In goes a `DenseFit`; out comes one with the nearest arms and hands, and the others that were tried,
by which the last stage tells whether the nearest are sure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.kernels.threads import mapped
from riemhuman.registration._constants import (
    ARM_MOST_FARTHER,
    ARM_STIFFNESSES,
    DENSE_SCALES,
    DIFFERENT_METRES,
    FOREARM_ANGLES,
    HAND_METRES,
    LIMB_METRES,
    N_FIRST_STEPS,
    N_NEAR,
    UNEXPLAINED_METRES,
    WRIST_ANGLES,
)
from riemhuman.registration._dense_fit import (
    DenseFit,
    DenseTask,
    LimbFit,
    fit_again,
    fit_joints,
)
from riemhuman.registration._elastic_step import ElasticFit, fit_elastic
from riemhuman.registration._limbs import ArmSurface, are_less, limited_distances, points_on
from riemhuman.registration._posed_body import ModelSamples, Pose, Prior, pose_body
from riemhuman.registration._scan_preparation import N_THREADS

Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class BodyFit:
    """A body after the elastic step, and what else its arms and hands might be."""

    task: DenseTask
    fit: ElasticFit
    arm_fits: Mapping[ArmSurface, list[LimbFit]]
    hand_fits: Mapping[ArmSurface, list[LimbFit]]


def fit_arms_and_hands(dense: DenseFit) -> DenseFit:
    """Return the body whose forearms and hands are nearest to a scan."""
    pose, arm_fits = rotate_forearms(dense.task, dense.pose)
    task, pose, hand_fits = pose_hands(dense.task, pose)
    return replace(dense, task=task, pose=pose, arm_fits=arm_fits, hand_fits=hand_fits)


def rotate_forearms(task: DenseTask, pose: Pose) -> tuple[Pose, dict[ArmSurface, list[LimbFit]]]:
    """Return a body whose forearms are turned to be nearest to the scan, and what else is near."""
    arm_fits = {}
    for arm in task.body.arm_surfaces:
        points = points_on(task.scan.points, task.body.surface(pose), arm.vertices)
        near = near_arms(task, pose, arm, points) if len(points) else []
        if not near:
            continue
        current, *others = elastic_arms(task, arm, points, [pose, *near])
        nearest = min(others, key=lambda fit: fit.cost)
        arm_fits[arm] = [current, *others]
        if are_less(nearest.distances, current.distances):
            _, pose = fit_again(task, nearest)
            arm_fits[arm] = [nearest, current, *others]
    return pose, arm_fits


def near_arms(task: DenseTask, pose: Pose, arm: ArmSurface, points: Array) -> list[Pose]:
    """Return other fits of one arm that are almost as near to points of a scan, or nearer."""
    starts = [
        pose._replace(local=arm.rotated(pose.local, forearm, wrist))
        for forearm in FOREARM_ANGLES
        for wrist in WRIST_ANGLES
    ]
    # Many starts soon lead to the same arm.
    fitted = starts
    for scales, known in (
        (DENSE_SCALES[:N_FIRST_STEPS], []),
        (DENSE_SCALES[N_FIRST_STEPS:], [pose]),
    ):
        fitted = fit_starts(task, arm.joints[1:], arm.samples, fitted, scales)
        fitted = _different(arm, fitted, known)
    # The elastic step takes longest and hardly changes which arms are near.
    few = points[:: max(len(points) // N_NEAR, 1)]
    costs = [_cost(arm, few, candidate) for candidate in (pose, *fitted)]
    most = ARM_MOST_FARTHER * min(costs)
    return [candidate for candidate, cost in zip(fitted, costs[1:], strict=True) if cost < most]


def elastic_arms(
    task: DenseTask, arm: ArmSurface, points: Array, poses: list[Pose]
) -> list[LimbFit]:
    """Return how near arms are to points of the scan after an elastic step."""
    return _mapped(partial(_elastic_arm, task, arm, points), poses)


def _cost(arm: ArmSurface, points: Array, pose: Pose) -> float:
    """Return the mean distance of points from an arm, raised if the arm is implausible."""
    surface = pose_body(arm.skin, pose).points
    distances = limited_distances(points, surface, arm.faces, LIMB_METRES)
    return arm.strain(pose.local) * float(distances.mean())


def _different(arm: ArmSurface, poses: list[Pose], known: list[Pose]) -> list[Pose]:
    """Return the poses whose arm differs from that of every earlier pose."""
    surfaces = [pose_body(arm.skin, pose).points for pose in known]
    different = []
    for pose in poses:
        surface = pose_body(arm.skin, pose).points
        gaps = (
            np.linalg.norm(surface - known_surface, axis=1).mean() for known_surface in surfaces
        )
        if min(gaps, default=np.inf) > DIFFERENT_METRES:
            surfaces.append(surface)
            different.append(pose)
    return different


def _elastic_arm(task: DenseTask, arm: ArmSurface, points: Array, pose: Pose) -> LimbFit:
    surface = pose_body(arm.skin, pose).points
    fitted, _ = fit_elastic(arm.metric, surface, surface, task.scan, ARM_STIFFNESSES)
    distances = limited_distances(points, fitted, arm.faces, LIMB_METRES)
    return LimbFit(pose, task.prior, surface, arm.strain(pose.local) * distances)


def pose_hands(
    task: DenseTask, pose: Pose
) -> tuple[DenseTask, Pose, dict[ArmSurface, list[LimbFit]]]:
    """Return a body whose hands come nearest to the scan, with its prior, and all fits of hands."""
    # The elastic step would hide a wrong one: it presses fingers into a fist. Only points on
    # the hand count, because those on the forearm lie as near in all poses.
    n_betas = task.body.model.n_betas
    # Twice, because the wrist moves with the first change, if there is one.
    tried: dict[ArmSurface, Pose] = {}
    hand_fits: dict[ArmSurface, list[LimbFit]] = {}
    for arm in (*task.body.arm_surfaces, *task.body.arm_surfaces):
        if tried.get(arm) is pose:
            continue
        tried[arm] = pose
        points = points_on(task.scan.points, task.body.surface(pose), arm.on_hand)
        if not len(points):
            continue
        now = task.prior.betas[n_betas:]
        others = [now, *(np.where(np.isnan(hands), now, hands) for hands in arm.hands)]
        current, *fits = _mapped(partial(_fit_hand, task, pose, arm, points), others)
        # The arm may fit worse alone than with the body around it.
        unmoved = _hand_as_it_is(task.prior, pose, arm, points)
        current = min(unmoved, current, key=lambda fit: fit.cost)
        hand_fits[arm] = [current, *fits]
        nearest = min(fits, key=lambda fit: fit.cost)
        is_explained = nearest.cost < UNEXPLAINED_METRES
        if is_explained and are_less(nearest.distances, current.distances):
            task, pose = fit_again(task, nearest)
    return task, pose, hand_fits


def _fit_hand(task: DenseTask, pose: Pose, arm: ArmSurface, points: Array, hands: Array) -> LimbFit:
    """Return an arm with given hand coefficients, fitted to points of the scan."""
    n_betas = task.body.model.n_betas
    prior = task.prior._replace(betas=np.append(task.prior.betas[:n_betas], hands))
    start = pose._replace(betas=np.append(pose.betas[:n_betas], hands))
    task = replace(task, prior=prior)
    fitted = fit_joints(task, arm.joints[1:], arm.samples, DENSE_SCALES, start)
    return _hand_as_it_is(prior, fitted, arm, points)


def _hand_as_it_is(prior: Prior, pose: Pose, arm: ArmSurface, points: Array) -> LimbFit:
    surface = pose_body(arm.skin, pose).points
    distances = limited_distances(points, surface, arm.faces, HAND_METRES)
    return LimbFit(pose, prior, surface, distances)


def fit_starts(
    task: DenseTask,
    joints: Integers,
    samples: ModelSamples,
    starts: list[Pose],
    scales: tuple[float, ...],
) -> list[Pose]:
    """Return the fits of some joints from several starts."""
    return _mapped(partial(fit_joints, task, joints, samples, scales), starts)


def _mapped(fit: Callable[[Item], Result], starts: list[Item]) -> list[Result]:
    """Return the results of a fit from several starts, some of them at once."""
    return list(mapped(fit, starts, N_THREADS))
