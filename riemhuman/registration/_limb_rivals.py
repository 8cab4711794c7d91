"""Limbs of a fitted body that another explanation fits almost as well: these are not trusted.

Distances from the scan cannot tell a right hand from a wrong one: both are small, because a hand
that is turned over still lies within the surface of the right one. What tells is the next best
explanation of the same points. If it is nearly as near to them, either may be right.

Limbs in a wrong place are another matter: after the elastic step the scan is farther from them than
from the rest of the same body, whatever its noise and flesh.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.bodies import rotation_matrix
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.registration._arms_and_hands import (
    BodyFit,
    HandFit,
    elastic_arms,
    fit_starts,
    other_arms_again,
)
from riemhuman.registration._constants import (
    ACROSS_CONTACT,
    CROSSING_SHARE,
    DENSE_SCALES,
    DISPLACED_METRES,
    ELBOW_SWINGS,
    EXCHANGED_METRES,
    HAND_MARGIN,
    HEAD_MARGIN,
    HEAD_TURNS,
    LEAST_DISPLACED,
    LEAST_HAND_SHOWN,
    LEAST_SWUNG,
    LEAST_TOLD_APART,
    LIMB_MARGIN,
    MOST_FINGER_EXCESS,
    MOST_LIMB_EXCESS,
    MOST_TOUCHING,
    N_FIRST_STEPS,
    N_RIVAL_COMPARED,
    RIVAL_COMPARED_EVERY,
    RIVAL_MOST_FARTHER,
    TOUCHING_METRES,
)
from riemhuman.registration._crossed_limbs import (
    crossing_joints,
    exchanged_limbs,
    find_crossing,
)
from riemhuman.registration._limbs import (
    ArmSurface,
    elbow_bend,
    faces_among,
    limited_distances,
    move_end,
    points_on,
    swing_elbow,
)
from riemhuman.registration._messages import MARK_JOINTS, MARK_WRISTS, OPEN_HANDS, part_in_words
from riemhuman.registration._posed_body import ModelSamples, Pose, pose_body
from riemhuman.surfaces.nearest_points import nearest_points


@dataclass(frozen=True)
class LimbDoubt:
    """A limb that is not trusted."""

    vertices: Booleans  # (V,) which vertices are not trusted
    reason: str
    remedy: str = MARK_JOINTS  # what to do


@dataclass(frozen=True)
class _Limb:
    """A part of the body that is fitted alone from other starts."""

    vertices: Integers  # numbers of those that are compared
    joints: Integers  # those that move
    samples: ModelSamples
    arm: ArmSurface | None = None  # whose unlikely bends count

    def strain(self, pose: Pose) -> float:
        return 1.0 if self.arm is None else self.arm.strain(pose.local)


@dataclass(frozen=True, eq=False)
class _LimbSurface:
    """The surface of a limb, which is compared with the points of a scan near it."""

    limb: _Limb
    skin: ModelSamples  # the limb's vertices
    faces: Triangles  # its triangles, numbered among these

    def points(self, pose: Pose) -> Array:
        """Return the limb's vertices in a pose."""
        return pose_body(self.skin, pose).points

    def costs(self, poses: list[Pose], points: Array, farthest: float) -> Array:
        """Return the limited mean distance of points in each pose, raised where it is unlikely."""
        costs = [
            self.limb.strain(pose)
            * limited_distances(points, self.points(pose), self.faces, farthest).mean()
            for pose in poses
        ]
        return np.array(costs)


@dataclass(frozen=True)
class _Start:
    """A pose from which a limb is fitted; rivals from there have moved a joint, if it is given."""

    pose: Pose
    joint: int | None = None


class ShownLimbs(NamedTuple):
    """What a scan shows of limbs."""

    matched: Booleans  # (V,) vertices that have counterparts in it
    excess: Array  # (J,) how many times farther it is from a limb than from the rest


def find_limb_doubts(body: BodyFit, shown: ShownLimbs) -> list[LimbDoubt]:
    """Return the limbs that fit badly, or that other poses explain almost as well."""
    touching = _touching_hands(body)
    # Garments are looser in some places than in others, and tell nothing by it.
    others = [] if body.task.scan.clothed else _ill_fitting_limbs(body, shown)
    for arm, poses in body.doubtful_arms.items():
        others += _turned_arm(body, arm, poses)
    for arm, fits in body.hand_fits.items():
        others += _other_hand(body, arm, fits, shown)
        others += _arm_elsewhere(body, arm)
    others += _turned_head(body)
    for joint in crossing_joints(body.task.body, body.fit.pose):
        others += _exchanged_limbs(body, joint)
    # What is said about both hands need not be repeated for one.
    known = [doubt.vertices for doubt in touching]
    others = [doubt for doubt in others if not known or (doubt.vertices & ~known[0]).any()]
    return [*touching, *others]


def _ill_fitting_limbs(body: BodyFit, shown: ShownLimbs) -> list[LimbDoubt]:
    """Return doubt about limbs that fit worse than the rest of the body, with what they carry."""
    parts = body.task.body.parts
    return [
        LimbDoubt(
            parts.vertices([k]),
            f"{part_in_words(name)}: it fits {shown.excess[k]:.1f} times worse than the rest of "
            "the body",
        )
        for k, name in enumerate(parts.names)
        if not name.endswith("wrist") and shown.excess[k] > MOST_LIMB_EXCESS
    ]


def _touching_hands(body: BodyFit) -> list[LimbDoubt]:
    """Return doubt about the fingers of both hands if they hide each other's."""
    parts, points = body.task.body.parts, body.fit.points
    hands = [np.flatnonzero(parts.vertices([int(arm[-1])])) for arm in parts.arms]
    if len(hands) < 2 or not all(map(len, hands)):
        return []
    shares = [
        np.mean(cKDTree(points[opposite]).query(points[hand])[0] < TOUCHING_METRES)
        for hand, opposite in (hands, hands[::-1])
    ]
    if max(shares) < MOST_TOUCHING:
        return []
    uncertain = [
        _uncertain_fingers(arm, body.hand_fits.get(arm, []), np.inf)
        for arm in body.task.body.arm_surfaces
    ]
    reason = "hands: they touch, so their fingers cannot be told apart"
    return _doubts_about(body, np.concatenate(uncertain), reason, OPEN_HANDS)


def _uncertain_fingers(arm: ArmSurface, fits: list[HandFit], margin: float) -> Integers:
    """Return the vertices of a hand that are elsewhere in poses of it hardly farther from a scan.

    Where all poses agree, nothing depends on them; without fits, all of the hand is uncertain.
    """
    if not fits:
        return arm.on_hand
    best = min(fits, key=lambda fit: fit.cost)
    displaced = np.zeros(len(arm.vertices), dtype=bool)
    for rival in fits:
        if rival.cost < (1.0 + margin) * best.cost:
            displaced |= _displaced(best.surface, rival.surface)
    return arm.vertices[displaced]


def _turned_arm(body: BodyFit, arm: ArmSurface, poses: list[Pose]) -> list[LimbDoubt]:
    """Return doubt about a forearm and hand that another pose brings almost as near to the scan."""
    task, pose = body.task, body.fit.pose
    points = points_on(task.scan.points, body.fit.model_points, arm.vertices)
    if not len(points):
        return []
    surface = pose_body(arm.skin, pose).points
    elsewhere = [
        candidate
        for candidate in other_arms_again(task, pose, arm, poses)
        if _displaced(surface, pose_body(arm.skin, candidate).points).any()
    ]
    if not elsewhere:
        return []
    current, *others = elastic_arms(task, arm, points, [pose, *elsewhere])
    most = (1.0 + LIMB_MARGIN) * current.cost
    displaced = np.zeros(len(arm.vertices), dtype=bool)
    for rival in others:
        if rival.cost < most:
            displaced |= _displaced(surface, rival.surface)
    reason = f"{arm.side} forearm: its rotation is ambiguous"
    return _doubts_about(body, arm.vertices[displaced], reason, MARK_WRISTS)


def _other_hand(
    body: BodyFit, arm: ArmSurface, fits: list[HandFit], shown: ShownLimbs
) -> list[LimbDoubt]:
    """Return doubt about fingers that might just as well be in another pose."""
    costs = np.array([fit.cost for fit in fits])
    is_far = shown.excess[arm.joints[-1]] > MOST_FINGER_EXCESS
    # If one pose explains a hand, others are much farther, whatever noise and flesh add.
    is_no_better = costs.min() > LEAST_TOLD_APART * np.median(costs)
    margin, why = np.inf, "no pose of its fingers fits the scan"
    if shown.matched[arm.on_hand].mean() < LEAST_HAND_SHOWN:
        why = "the scan shows little of it"
    elif not is_far and not is_no_better:
        margin, why = HAND_MARGIN, "its fingers may be open or bent"
    uncertain = _uncertain_fingers(arm, fits, margin)
    return _doubts_about(body, uncertain, f"{arm.side} hand: {why}", OPEN_HANDS)


def _arm_elsewhere(body: BodyFit, arm: ArmSurface) -> list[LimbDoubt]:
    """Return doubt about an arm that would be almost as near to the scan elsewhere."""
    skeleton, pose = arm.samples.skeleton, body.fit.pose
    vertices = np.flatnonzero(body.task.body.parts.vertices(arm.joints[1:].tolist()))
    limb = _Limb(vertices, arm.joints[1:], arm.samples, arm)
    swings: list[_Start] = []
    shifts: list[_Start] = []
    elbow, wrist = map(int, arm.joints[2:])
    if elbow_bend(skeleton, pose, arm.joints) > LEAST_SWUNG:
        swings = [
            _Start(swing_elbow(skeleton, pose, arm.joints, degrees), elbow)
            for degrees in ELBOW_SWINGS
        ]
    inward = find_contact(body, arm)
    if inward is not None:
        shifts = [
            _Start(move_end(skeleton, pose, arm.joints[1:], distance * inward), wrist)
            for distance in ACROSS_CONTACT
        ]
    starts = [*swings, *shifts]
    displaced = _displaced_in_rivals(body, limb, starts, LIMB_MARGIN)
    by_swings, by_shifts = (
        rows.any(axis=0) for rows in (displaced[: len(swings)], displaced[len(swings) :])
    )
    ways = ["its elbow may point elsewhere"] * bool(by_swings.any())
    ways += ["its hand may be on the other side of what it touches"] * bool(by_shifts.any())
    reason = f"{arm.side} arm: {', or '.join(ways)}"
    return _doubts_about(body, vertices[by_swings | by_shifts], reason)


def find_contact(body: BodyFit, arm: ArmSurface) -> Array | None:
    """Return the direction from a hand into what it touches, or None if it hardly touches."""
    parts, points, faces = body.task.body.parts, body.fit.points, body.task.body.model.faces
    hand = np.flatnonzero(parts.vertices([int(arm.joints[-1])]))
    others = faces[~parts.vertices(arm.joints[1:].tolist())[faces].any(axis=1)]
    places, gaps = nearest_points(points[hand], points, others)
    touching = gaps < TOUCHING_METRES
    if np.mean(touching) < CROSSING_SHARE:
        return None
    normals = vertex_normals(points, faces)[others[places.triangles[touching], 0]]
    inward: Array = -unit_vectors(normals.mean(axis=0))
    return inward


def _turned_head(body: BodyFit) -> list[LimbDoubt]:
    """Return doubt about a head that would be almost as near to the scan if turned or nodded."""
    task, parts, pose = body.task, body.task.body.parts, body.fit.pose
    joints = parts.numbers("neck", "head")
    if len(joints) < 2:
        return []
    on_neck = parts.vertices(joints)
    samples = task.samples.only((task.samples.numbers >= 0) & on_neck[task.samples.numbers])
    limb = _Limb(np.flatnonzero(parts.vertices(joints[1:])), np.array(joints), samples)
    starts = []
    for turn in HEAD_TURNS:
        local = pose.local.copy()
        local[joints[1]] = local[joints[1]] @ rotation_matrix(np.radians([*turn, 0.0]))
        starts.append(_Start(pose._replace(local=local)))
    displaced = _displaced_in_rivals(body, limb, starts, HEAD_MARGIN)
    reason = "head: it may be turned or nod differently"
    return _doubts_about(body, limb.vertices[displaced.any(axis=0)], reason)


def _displaced_in_rivals(
    body: BodyFit, limb: _Limb, starts: list[_Start], margin: float
) -> Booleans:
    """Return which vertices of a limb are elsewhere in rivals almost as near, a row for each start.

    The limb is fitted from where it is, too: what it leaves then is elsewhere in all rows.
    """
    task, pose, vertices = body.task, body.fit.pose, limb.vertices
    displaced = np.zeros((len(starts), len(vertices)), dtype=bool)
    if not starts:
        return displaced
    seen = points_on(task.scan.points, body.fit.model_points, vertices)
    if not len(seen):
        return displaced
    seen = seen[:: max(len(seen) // N_RIVAL_COMPARED, 1)]
    skin, faces = task.body.samples(None).only(vertices), task.body.model.faces
    surface_of_limb = _LimbSurface(limb, skin, faces_among(faces, vertices))
    unfitted = [pose, *(start.pose for start in starts)]
    first = fit_starts(task, limb.joints, limb.samples, unfitted, DENSE_SCALES[:N_FIRST_STEPS])
    few = seen[::RIVAL_COMPARED_EVERY]
    costs = surface_of_limb.costs([pose, *first], few, EXCHANGED_METRES)
    # Fits that are still far away will not come nearer.
    near = np.flatnonzero(costs[2:] < RIVAL_MOST_FARTHER * min(costs[:2]))
    nearer = [first[0], *(first[1 + k] for k in near)]
    later = fit_starts(task, limb.joints, limb.samples, nearer, DENSE_SCALES[N_FIRST_STEPS:])
    poses = [pose, *later]
    costs = surface_of_limb.costs(poses, seen, EXCHANGED_METRES)
    surfaces = [surface_of_limb.points(candidate) for candidate in poses]
    joints = [task.body.joint_motions(candidate).positions + candidate.trans for candidate in poses]
    for k, surface, cost, rival in zip(near, surfaces[2:], costs[2:], joints[2:], strict=True):
        joint = starts[k].joint
        moved = np.inf if joint is None else np.linalg.norm(rival[joint] - joints[0][joint])
        if moved > DISPLACED_METRES and cost < (1.0 + margin) * min(costs[:2]):
            displaced[k] = _displaced(surfaces[0], surface)
    return displaced | _displaced(surfaces[0], surfaces[1])


def _displaced(surface: Array, rival: Array) -> Booleans:
    """Return which vertices are elsewhere in a rival; none if there are only a few."""
    displaced = np.linalg.norm(surface - rival, axis=1) > DISPLACED_METRES
    clearly: Booleans = displaced & bool(displaced.mean() > LEAST_DISPLACED)
    return clearly


def _doubts_about(
    body: BodyFit, numbers: Integers, reason: str, remedy: str = MARK_JOINTS
) -> list[LimbDoubt]:
    vertices = np.zeros(len(body.fit.points), dtype=bool)
    vertices[numbers] = True
    return [LimbDoubt(vertices, reason, remedy)] if len(numbers) else []


def _exchanged_limbs(body: BodyFit, joint: str) -> list[LimbDoubt]:
    """Return doubt about crossed forearms or shins that fit almost as well exchanged."""
    task, pose = body.task, body.fit.pose
    crossing = find_crossing(task, pose, joint)
    if crossing is None:
        return []
    both = crossing.vertices
    surface, most = body.fit.model_points[both], crossing.distances(task, pose).mean()
    displaced = np.zeros(len(both), dtype=bool)
    for rival, _ in exchanged_limbs(task, pose, joint):
        if crossing.distances(task, rival).mean() < (1.0 + LIMB_MARGIN) * most:
            displaced |= _displaced(surface, task.body.surface(rival)[both])
    limbs = "arms" if joint == "elbow" else "legs"
    return _doubts_about(
        body, both[displaced], f"{limbs}: they cross, and left and right may be exchanged"
    )
