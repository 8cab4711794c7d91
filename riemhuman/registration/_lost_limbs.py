"""A body fitted again without the limbs that its scan does not show.

The model always has all limbs. One that the scan does not show is drawn to points of other parts,
and draws the part above it out of place: an upper arm follows the forearm that is fitted to the
trunk, and is rotated about itself with it. In goes a fit of all limbs; out comes one without those
that are lost, and what the scan shows of it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Booleans
from riemhuman.kernels.surface import unit_vectors
from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._constants import (
    DENSE_SCALES,
    FARTHER_WITHOUT_LIMBS,
    LEAST_NEAR_OF_LIMB,
    N_JUDGED,
)
from riemhuman.registration._dense_fit import DenseTask, fit_closest
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._even_points import even_points
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._shown_parts import ShownParts, find_shown_parts
from riemhuman.surfaces.nearest_points import nearest_points

# Joints of upper arms and thighs, and those of the limbs that they carry.
_CARRIERS = (
    ("left_shoulder", "left_elbow"),
    ("right_shoulder", "right_elbow"),
    ("left_hip", "left_knee"),
    ("right_hip", "right_knee"),
)
_LEAST_TWIST = 1e-6


def leave_out_lost_limbs(
    fitted: BodyFit, scan: PreparedScan, *, is_refused: bool
) -> tuple[BodyFit, ShownParts]:
    """Return a body fitted without the limbs that a scan does not show, and what it shows.

    A body that is refused anyway stays as it is, and so does one whose limb may be elsewhere in
    the scan.
    """
    shown = find_shown_parts(fitted, scan)
    if is_refused or not (shown.lost & fitted.task.visible).any():
        return fitted, shown
    if not _explains_scan(fitted):
        return fitted, shown  # the limb may be where points are far from the body
    without = _fit_without(fitted, shown.lost)
    # If the limb is in the scan after all, its points are now far from the body.
    before, after = (_distances_from(body).mean() for body in (fitted, without))
    is_farther = after > FARTHER_WITHOUT_LIMBS * before
    if is_farther or not _explains_scan(without):
        return fitted, shown
    return without, find_shown_parts(without, scan)


def _fit_without(fitted: BodyFit, lost: Booleans) -> BodyFit:
    """Return a body fitted again, and its elastic step, without some vertices."""
    task, visible = fitted.task, fitted.task.visible & ~lost
    areas = task.samples.areas * visible[task.samples.numbers]
    samples = task.samples._replace(areas=areas / areas.sum())
    # A scan hardly shows how what carries a lost limb is rotated about itself: the limb had said
    # so alone, wherever it was.
    local, expected = fitted.fit.pose.local.copy(), task.prior.local.copy()
    for carrier, end in _find_carriers(task.body.parts, lost):
        local[carrier] = expected[carrier] = _with_usual_twist(task, local, carrier, end)
    task = replace(
        task, visible=visible, samples=samples, prior=task.prior._replace(local=expected)
    )
    start = fitted.fit.pose._replace(local=local)
    pose = fit_closest(samples, start, task.prior, task.scan, DENSE_SCALES)
    return replace(fitted, task=task, fit=leave_model(task, pose))


def _find_carriers(parts: BodyParts, lost: Booleans) -> list[tuple[int, int]]:
    """Return the joints of upper arms and thighs that carry lost limbs, and those of the limbs."""
    carriers = []
    for names in _CARRIERS:
        joints = parts.numbers(*names)
        if len(joints) == 2:
            is_lost = [bool(lost[parts.owners == joint].any()) for joint in joints]
            if is_lost == [False, True]:
                carriers.append((joints[0], joints[1]))
    return carriers


def _with_usual_twist(task: DenseTask, local: Array, carrier: int, end: int) -> Array:
    """Return a joint's rotation, twisted about its bone as in the start pose that is nearest."""
    rest = task.samples.skeleton.rest_joints
    bone = unit_vectors(rest[end] - rest[carrier])
    direction = local[carrier] @ bone
    nearest = max(
        (pose[carrier] for pose in task.body.poses.values()),
        key=lambda rotation: float(rotation @ bone @ direction),
    )
    change = Rotation.from_matrix(local[carrier].T @ nearest).as_quat()
    # The twist of a rotation about an axis keeps only that part of its quaternion.
    twist = np.append((change[:3] @ bone) * bone, change[3])
    if np.linalg.norm(twist) < _LEAST_TWIST:  # half a turn the other way: no twist is nearest
        unchanged: Array = local[carrier]
        return unchanged
    twisted: Array = local[carrier] @ Rotation.from_quat(twist).as_matrix()
    return twisted


def _explains_scan(fitted: BodyFit) -> bool:
    """Return whether so much of a scan is near a body that no limb of the scan is elsewhere."""
    near = fitted.task.scan.near_metres
    share = np.mean(_distances_from(fitted) < near)
    return bool(share >= LEAST_NEAR_OF_LIMB)


def _distances_from(fitted: BodyFit) -> Array:
    """Return the distances of some points of a scan from a body, limited, metres."""
    points = fitted.task.scan.points
    some = points[even_points(points, N_JUDGED)]
    _, distances = nearest_points(some, fitted.fit.points, fitted.task.body.model.faces)
    limited: Array = np.minimum(distances, fitted.task.scan.near_metres)
    return limited
