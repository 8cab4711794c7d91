"""Limbs of a fitted body that other candidates explain almost as well: these are not trusted.

Distances from the scan cannot tell a right hand from a wrong one: both are small, because a hand
that is turned over still lies within the surface of the right one. What tells are the candidates,
other poses of the limb fitted to the same points. Where all that are within reach of the nearest
one agree, the limb is trusted.

Limbs in a wrong place are another matter: after the elastic step the scan is farther from them than
from the rest of the same body, whatever its noise and flesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, Integers
from riemhuman.bodies import rotation_matrix
from riemhuman.registration._arms_and_hands import BodyFit, fit_starts
from riemhuman.registration._constants import (
    DENSE_SCALES,
    HEAD_MARGIN,
    HEAD_TURNS,
    LEAST_OF_LIMB,
    LEAST_OWN,
    LIMB_MARGIN,
    LIMB_METRES,
    MOST_FINGER_EXCESS,
    MOST_LIMB_EXCESS,
    MOST_TOUCHING,
    SAME_METRES,
    TOUCHING_METRES,
)
from riemhuman.registration._crossed_limbs import crossing_fits, crossing_joints
from riemhuman.registration._dense_fit import LimbFit
from riemhuman.registration._limbs import ArmSurface, faces_among, limited_distances, points_on
from riemhuman.registration._messages import MARK_JOINTS, MARK_WRISTS, OPEN_HANDS, part_in_words
from riemhuman.registration._posed_body import pose_body


@dataclass(frozen=True)
class LimbDoubt:
    """A limb that is not trusted."""

    vertices: Booleans  # (V,) which vertices are not trusted
    reason: str
    remedy: str = MARK_JOINTS  # what to do


def find_limb_doubts(body: BodyFit, matched: Booleans, excess: Array) -> list[LimbDoubt]:
    """Return the limbs that fit badly, or that other candidates explain almost as well.

    Parameters
    ----------
    matched : ndarray, shape (V,)
        Vertices that have counterparts in the scan.
    excess : ndarray, shape (J,)
        How many times farther the scan is from a limb than from the rest of the body.
    """
    # Garments are looser in some places than in others, and tell nothing by it.
    doubts = [] if body.task.scan.clothed else _ill_fitting_limbs(body, excess)
    for arm, fits in body.arm_fits.items():
        uncertain = arm.vertices[_uncertain(fits, LIMB_MARGIN)]
        reason = f"{arm.side} forearm: its rotation is ambiguous"
        doubts += _doubts_about(body, uncertain, reason, MARK_WRISTS)
    for arm in body.task.body.arm_surfaces:
        doubts += _other_hand(body, arm, matched, excess)
    doubts += _turned_head(body)
    for joint in crossing_joints(body.task.body, body.fit.pose):
        doubts += _exchanged_limbs(body, joint)
    return doubts


def _uncertain(fits: Sequence[LimbFit], margin: float) -> Booleans:
    """Return which vertices of the first candidate are elsewhere in others within reach.

    Within reach is what is farther from the scan than the nearest by no more than a share.
    """
    uncertain, least = np.zeros(len(fits[0].surface), dtype=bool), min(fit.cost for fit in fits)
    for fit in fits:
        displaced = np.linalg.norm(fit.surface - fits[0].surface, axis=1) > SAME_METRES
        if fit.cost <= (1.0 + margin) * least and displaced.mean() > LEAST_OF_LIMB:
            uncertain |= displaced
    return uncertain


def _doubts_about(
    body: BodyFit, numbers: Integers, reason: str, remedy: str = MARK_JOINTS
) -> list[LimbDoubt]:
    vertices = np.zeros(len(body.fit.points), dtype=bool)
    vertices[numbers] = True
    return [LimbDoubt(vertices, reason, remedy)] if len(numbers) else []


def _ill_fitting_limbs(body: BodyFit, excess: Array) -> list[LimbDoubt]:
    """Return doubt about limbs that fit worse than the rest of the body, with what they carry."""
    parts = body.task.body.parts
    return [
        LimbDoubt(
            parts.vertices([k]),
            f"{part_in_words(name)}: it fits {excess[k]:.1f} times worse than the rest of the body",
        )
        for k, name in enumerate(parts.names)
        if not name.endswith("wrist") and excess[k] > MOST_LIMB_EXCESS
    ]


def _other_hand(
    body: BodyFit, arm: ArmSurface, matched: Booleans, excess: Array
) -> list[LimbDoubt]:
    """Return doubt about fingers that may be in another pose."""
    fits, margin = body.hand_fits.get(arm, []), np.inf
    if _touches_other_hand(body, arm):
        why = "it touches the other"
    elif not fits:
        return []
    elif matched[arm.on_hand].mean() < LEAST_OWN:
        why = "the scan shows little of it"
    elif excess[arm.joints[-1]] > MOST_FINGER_EXCESS:
        why = "no pose of its fingers fits the scan"
    else:
        margin, why = LIMB_MARGIN, "its fingers may be open or bent"
    uncertain = arm.on_hand
    if fits:
        uncertain = arm.vertices[_uncertain(fits, margin)]
    return _doubts_about(body, uncertain, f"{arm.side} hand: {why}", OPEN_HANDS)


def _touches_other_hand(body: BodyFit, arm: ArmSurface) -> bool:
    """Return whether so much of a hand touches the other that they hide each other's fingers."""
    on_hands, points = body.task.body.parts.on_hands, body.fit.points
    hand = body.task.body.parts.vertices([int(arm.joints[-1])])
    other = points[on_hands & ~hand]
    if not len(other):
        return False
    gaps = cKDTree(other).query(points[hand])[0]
    return bool(np.mean(gaps < TOUCHING_METRES) > MOST_TOUCHING)


def _turned_head(body: BodyFit) -> list[LimbDoubt]:
    """Return doubt about a head that may be turned or nod differently."""
    task, parts, pose = body.task, body.task.body.parts, body.fit.pose
    joints = parts.numbers("neck", "head")
    if len(joints) < 2:
        return []
    head = np.flatnonzero(parts.vertices(joints[1:]))
    seen = points_on(task.scan.points, body.fit.model_points, head)
    if not len(seen):
        return []
    on_neck = parts.vertices(joints)
    samples = task.samples.only((task.samples.numbers >= 0) & on_neck[task.samples.numbers])
    starts = [pose]
    for turn in HEAD_TURNS:
        local = pose.local.copy()
        local[joints[1]] = local[joints[1]] @ rotation_matrix(np.radians([*turn, 0.0]))
        starts.append(pose._replace(local=local))
    # The head is fitted alone from where it is, too.
    fitted = [pose, *fit_starts(task, np.array(joints), samples, starts, DENSE_SCALES)]
    skin, faces = task.body.samples(None).only(head), faces_among(task.body.model.faces, head)
    fits = []
    for candidate in fitted:
        surface = pose_body(skin, candidate).points
        distances = limited_distances(seen, surface, faces, LIMB_METRES)
        fits.append(LimbFit(candidate, task.prior, surface, distances))
    uncertain = _uncertain(fits, HEAD_MARGIN)
    return _doubts_about(body, head[uncertain], "head: it may be turned or nod differently")


def _exchanged_limbs(body: BodyFit, joint: str) -> list[LimbDoubt]:
    """Return doubt about crossed forearms or shins that fit almost as well exchanged."""
    numbers, fits = crossing_fits(body.task, body.fit.pose, joint)
    if not fits:
        return []
    limbs = "arms" if joint == "elbow" else "legs"
    reason = f"{limbs}: they cross, and left and right may be exchanged"
    return _doubts_about(body, numbers[_uncertain(fits, LIMB_MARGIN)], reason)
