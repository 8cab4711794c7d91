"""Limbs of a fitted body that another explanation fits almost as well: these are not trusted.

Distances from the scan cannot tell a right hand from a wrong one: both are small, because a hand
that is turned over still lies within the surface of the right one. What tells is the next best
explanation of the same points. If it is nearly as near to them, either may be right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.bodies import rotation_matrix
from riemhuman.kernels.threads import mapped
from riemhuman.registration._arm_surfaces import ArmSurface
from riemhuman.registration._arms_and_hands import (
    BodyFit,
    HandFit,
    elastic_arms,
    fit_joints,
    near_arms,
    points_on,
)
from riemhuman.registration._dense_fit import DenseTask
from riemhuman.registration._posed_body import Pose, pose_body
from riemhuman.registration._scan_preparation import N_THREADS
from riemhuman.registration._start_poses import BodyParts
from riemhuman.registration.settings import RivalSettings
from riemhuman.surfaces.nearest_points import nearest_points

_EQUAL = "two explanations fit almost equally"
_MIRROR = np.diag([-1.0, 1.0, 1.0])


@dataclass(frozen=True)
class LimbDoubt:
    """A limb that is not trusted."""

    vertices: np.ndarray  # (V,) which vertices are not trusted
    reason: str


def find_limb_doubts(body: BodyFit, settings: RivalSettings) -> list[LimbDoubt]:
    """Return the limbs of a fitted body that something else explains almost as well."""
    touching = _touching_hands(body, settings)
    others: list[LimbDoubt] = []
    for arm in body.doubtful_arms:
        others += _turned_arm(body, arm, settings)
    for arm, fits in body.hand_fits.items():
        others += _other_hand(body, arm, fits, settings)
    others += _turned_head(body, settings)
    for joint in ("elbow", "knee"):
        others += _exchanged_limbs(body, joint, settings)
    # What is said of both hands need not be said of one.
    known = [doubt.vertices for doubt in touching]
    others = [doubt for doubt in others if not known or (doubt.vertices & ~known[0]).any()]
    return [*touching, *others]


def _touching_hands(body: BodyFit, settings: RivalSettings) -> list[LimbDoubt]:
    """Return doubt about both hands if they hide each other's fingers."""
    parts, points = body.task.body.parts, body.fit.points
    hands = [np.flatnonzero(parts.vertices([int(arm[-1])])) for arm in parts.arms]
    if len(hands) < 2 or not all(map(len, hands)):
        return []
    shares = [
        np.mean(cKDTree(points[other]).query(points[hand])[0] < settings.touching_metres)
        for hand, other in (hands, hands[::-1])
    ]
    if max(shares) < settings.most_touching:
        return []
    reason = "hands: they touch, and the scan does not tell their fingers apart"
    return [LimbDoubt(parts.on_hands, reason)]


def _turned_arm(body: BodyFit, arm: ArmSurface, settings: RivalSettings) -> list[LimbDoubt]:
    """Return doubt about a forearm and hand that are almost as near to the scan otherwise."""
    task, pose = body.task, body.fit.pose
    points = points_on(task, pose, arm.vertices)
    if not len(points):
        return []
    surface = pose_body(arm.skin, pose).points
    elsewhere = [
        other
        for other in near_arms(task, pose, arm, points)
        if _displaced(surface, pose_body(arm.skin, other).points, settings).any()
    ]
    if not elsewhere:
        return []
    current, *others = elastic_arms(task, arm, points, [pose, *elsewhere])
    most = (1.0 + settings.least_margin) * current.cost
    displaced = np.zeros(len(arm.vertices), dtype=bool)
    for rival in others:
        if rival.cost < most:
            displaced |= _displaced(surface, rival.surface, settings)
    reason = f"{arm.side} hand: {_EQUAL}, in which the forearm is turned differently"
    return _doubts_about(body, arm.vertices[displaced], reason)


def _other_hand(
    body: BodyFit, arm: ArmSurface, fits: list[HandFit], settings: RivalSettings
) -> list[LimbDoubt]:
    """Return doubt about fingers that are almost as near to the scan in another pose."""
    best = min(fits, key=lambda fit: fit.cost)
    if best.cost > np.hypot(settings.doubtful_hand_metres, body.task.scan.noise):
        return _doubts_about(body, arm.on_hand, f"{arm.side} hand: no pose of it fits the scan")
    displaced = np.zeros(len(arm.vertices), dtype=bool)
    for rival in fits:
        if rival.cost < (1.0 + settings.hand_margin) * best.cost:
            displaced |= _displaced(best.surface, rival.surface, settings)
    reason = f"{arm.side} hand: {_EQUAL}, in which its fingers are open or bent"
    return _doubts_about(body, arm.vertices[displaced], reason)


def _turned_head(body: BodyFit, settings: RivalSettings) -> list[LimbDoubt]:
    """Return doubt about a head that is almost as near to the scan turned or nodded otherwise."""
    task, parts, pose = body.task, body.task.body.parts, body.fit.pose
    joints = parts.numbers("neck", "head")
    if len(joints) < 2:
        return []
    head = np.flatnonzero(parts.vertices(joints[1:]))
    seen = points_on(task, pose, head)
    if not len(seen):
        return []
    seen = seen[:: max(len(seen) // settings.n_compared, 1)]
    on_neck = parts.vertices(joints)
    samples = task.samples.only((task.samples.numbers >= 0) & on_neck[task.samples.numbers])

    def fit_from(turn: tuple[float, float]) -> Pose:
        local = pose.local.copy()
        local[joints[1]] = local[joints[1]] @ rotation_matrix(np.radians([*turn, 0.0]))
        start = pose._replace(local=local)
        return fit_joints(task, np.array(joints), samples, task.prior, start)

    poses = [pose, *mapped(fit_from, ((0.0, 0.0), *settings.head_turns), N_THREADS)]
    surfaces = [task.body.surface(each) for each in poses]
    costs = _mean_distances(body, seen, head, surfaces, settings)
    displaced = np.zeros(len(head), dtype=bool)
    for surface, cost in zip(surfaces, costs, strict=True):
        if cost < (1.0 + settings.head_margin) * min(costs[:2]):
            displaced |= _displaced(surfaces[0][head], surface[head], settings)
    reason = f"head: {_EQUAL}, in which it is turned or nods differently"
    return _doubts_about(body, head[displaced], reason)


def _mean_distances(
    body: BodyFit,
    points: np.ndarray,
    vertices: np.ndarray,
    surfaces: list[np.ndarray],
    settings: RivalSettings,
) -> list[float]:
    """Return the mean distance of points from some vertices' part of each surface, metres."""
    faces = body.task.body.model.faces
    faces = faces[np.isin(faces, vertices).all(axis=1)]
    return [
        float(
            np.minimum(nearest_points(points, surface, faces)[1], settings.exchanged_metres).mean()
        )
        for surface in surfaces
    ]


def _displaced(surface: np.ndarray, rival: np.ndarray, settings: RivalSettings) -> np.ndarray:
    """Return which vertices are elsewhere in a rival, none if they are few."""
    displaced = np.linalg.norm(surface - rival, axis=1) > settings.displaced_metres
    return displaced & bool(displaced.mean() > settings.least_displaced)


def _doubts_about(body: BodyFit, numbers: np.ndarray, reason: str) -> list[LimbDoubt]:
    vertices = np.zeros(len(body.fit.points), dtype=bool)
    vertices[numbers] = True
    return [LimbDoubt(vertices, reason)] if len(numbers) else []


def _exchanged_limbs(body: BodyFit, joint: str, settings: RivalSettings) -> list[LimbDoubt]:
    """Return doubt about both forearms or shins if they cross, and fit almost as well exchanged."""
    task, parts = body.task, body.task.body.parts
    ends = parts.numbers(f"left_{joint}", f"right_{joint}")
    if len(ends) < 2:
        return []
    lower = [np.flatnonzero(parts.vertices([end])) for end in ends]
    points = body.fit.points
    near = [
        np.mean(cKDTree(points[other]).query(points[limb])[0] < settings.touching_metres)
        for limb, other in (lower, lower[::-1])
    ]
    if max(near) < settings.crossing_share:
        return []
    both = np.sort(np.concatenate(lower))
    seen = points_on(task, body.fit.pose, both)
    if not len(seen):
        return []
    rival = _exchange(task, body.fit.pose, joint)
    surfaces = [task.body.surface(pose) for pose in (body.fit.pose, rival)]
    costs = _mean_distances(body, seen, both, surfaces, settings)
    if costs[1] > (1.0 + settings.least_margin) * costs[0]:
        return []
    displaced = _displaced(surfaces[0][both], surfaces[1][both], settings)
    limbs = "arms" if joint == "elbow" else "legs"
    return _doubts_about(body, both[displaced], f"{limbs}: they cross, and {_EQUAL}")


def _exchange(task: DenseTask, pose: Pose, joint: str) -> Pose:
    """Return the body with both arms, or both legs, in each other's place, fitted to the scan."""
    pairs = _pairs(task.body.parts, joint)
    local, expected = pose.local.copy(), task.prior.local.copy()
    for left, right in pairs:
        for rotations in (local, expected):
            # Mirrored at the plane between left and right: y and z change sign.
            mirrored = _MIRROR @ rotations[[right, left]] @ _MIRROR
            rotations[[left, right]] = mirrored
    prior = task.prior._replace(local=expected)
    chosen = np.array(pairs).ravel()
    on_limbs = task.body.parts.vertices(chosen.tolist())
    samples = task.samples.only((task.samples.numbers >= 0) & on_limbs[task.samples.numbers])
    return fit_joints(task, chosen, samples, prior, pose._replace(local=local))


def _pairs(parts: BodyParts, joint: str) -> list[list[int]]:
    """Return the left and right joints of arms or legs that a model has."""
    arm, leg = ("collar", "shoulder", "elbow", "wrist"), ("hip", "knee", "ankle", "toes")
    names = arm if joint == "elbow" else leg
    pairs = [parts.numbers(f"left_{name}", f"right_{name}") for name in names]
    return [pair for pair in pairs if len(pair) == 2]
