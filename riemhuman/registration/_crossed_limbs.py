"""Crossed arms or legs, and which of the two limbs is which.

In goes a `DenseFit`; out comes one whose crossed limbs are exchanged where that is nearer to the
scan. The last stage asks the same of the final pose.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Integers
from riemhuman.bodies.skinning import JointMotions, Skeleton
from riemhuman.registration._constants import (
    DENSE_SCALES,
    LEAST_OF_LIMB,
    LIMB_METRES,
    NEAR_METRES,
)
from riemhuman.registration._dense_fit import (
    DenseFit,
    DenseTask,
    LimbFit,
    fit_again,
    fit_joints,
)
from riemhuman.registration._limbs import (
    BodyParts,
    are_less,
    faces_among,
    limited_distances,
    move_end,
    points_on,
)
from riemhuman.registration._posed_body import Pose, Prior
from riemhuman.registration._registration_model import RegistrationModel

_MIRROR = np.diag([-1.0, 1.0, 1.0])
# The joints of one side, from the one that stays, for the arms and legs whose ends cross.
_LIMBS = {
    "elbow": ("collar", "shoulder", "elbow", "wrist"),
    "knee": ("hip", "knee", "ankle", "toes"),
}


def crossing_joints(body: RegistrationModel, pose: Pose) -> list[str]:
    """Return elbow or knee, or both, if the forearms or shins below are near each other."""
    return [joint for joint in _LIMBS if _are_near(body, pose, joint)]


def _are_near(body: RegistrationModel, pose: Pose, joint: str) -> bool:
    surface = body.surface(pose)
    lower = _lower_limbs(body.parts, joint)
    return any(
        np.mean(cKDTree(surface[opposite]).query(surface[limb])[0] < NEAR_METRES) > LEAST_OF_LIMB
        for limb, opposite in permutations(lower, 2)
    )


def _lower_limbs(parts: BodyParts, joint: str) -> list[Integers]:
    """Return the numbers of the vertices below the left and the right joint."""
    ends = parts.numbers(f"left_{joint}", f"right_{joint}")
    limbs = [np.flatnonzero(parts.vertices([end])) for end in ends]
    return [limb for limb in limbs if len(limb)]


def crossing_fits(task: DenseTask, pose: Pose, joint: str) -> tuple[Integers, list[LimbFit]]:
    """Return the vertices of both forearms or shins, and how these fit as they are and exchanged.

    The vertices are those below elbow or knee; without points of a scan on them, nothing fits.
    """
    numbers = np.sort(np.concatenate(_lower_limbs(task.body.parts, joint)))
    points = points_on(task.scan.points, task.body.surface(pose), numbers)
    if not len(points):
        return numbers, []
    faces = faces_among(task.body.model.faces, numbers)
    arms = task.body.arm_surfaces if joint == "elbow" else []
    fits = []
    for candidate, prior in [(pose, task.prior), *exchanged_limbs(task, pose, joint)]:
        surface = task.body.surface(candidate)[numbers]
        strain = np.mean([arm.strain(candidate.local) for arm in arms]) if arms else 1.0
        distances = strain * limited_distances(points, surface, faces, LIMB_METRES)
        fits.append(LimbFit(candidate, prior, surface, distances))
    return numbers, fits


def exchanged_limbs(task: DenseTask, pose: Pose, joint: str) -> list[tuple[Pose, Prior]]:
    """Return the body with arms or legs exchanged and fitted again, and their priors."""
    pairs = _pairs(task.body.parts, joint)
    moving = np.array(pairs).ravel()
    on_limbs = task.body.parts.vertices(moving.tolist())
    samples = task.samples.only((task.samples.numbers >= 0) & on_limbs[task.samples.numbers])
    mirrored = _mirror_limbs(pose.local, pairs), _mirror_limbs(task.prior.local, pairs)
    starts = [(pose._replace(local=mirrored[0]), task.prior._replace(local=mirrored[1]))]
    if len(pairs) == len(_LIMBS[joint]):
        starts.append((_swap_ends(task.samples.skeleton, pose, joint, np.array(pairs)), task.prior))
    return [
        (fit_joints(replace(task, prior=prior), moving, samples, DENSE_SCALES, start), prior)
        for start, prior in starts
    ]


def uncross_limbs(dense: DenseFit) -> DenseFit:
    """Return a body with crossed arms and legs exchanged where that is nearer to the scan."""
    for joint in crossing_joints(dense.task.body, dense.pose):
        _, fits = crossing_fits(dense.task, dense.pose, joint)
        nearest = min(fits, key=lambda fit: fit.cost, default=None)
        if nearest is not None and are_less(nearest.distances, fits[0].distances):
            task, pose = fit_again(dense.task, nearest)
            dense = replace(dense, task=task, pose=pose)
    return dense


def _mirror_limbs(local: Array, pairs: list[list[int]]) -> Array:
    """Return rotations mirrored between left and right."""
    mirrored = local.copy()
    for left, right in pairs:
        # Mirrored: y and z change sign.
        mirrored[[left, right]] = _MIRROR @ local[[right, left]] @ _MIRROR
    return mirrored


def _swap_ends(skeleton: Skeleton, pose: Pose, joint: str, pairs: Integers) -> Pose:
    """Return a pose with both hands or feet exchanged, as far as the limbs reach."""
    # An arm moves from its shoulder, a leg from its hip.
    first = _LIMBS[joint].index("shoulder" if joint == "elbow" else "hip")
    left, right = pairs[first : first + 3].T
    positions = JointMotions(skeleton, pose.local, pose.betas).positions
    shift = positions[right[-1]] - positions[left[-1]]
    return move_end(skeleton, move_end(skeleton, pose, left, shift), right, -shift)


def _pairs(parts: BodyParts, joint: str) -> list[list[int]]:
    """Return the left and right joints of arms or legs that a model has."""
    pairs = [parts.numbers(f"left_{name}", f"right_{name}") for name in _LIMBS[joint]]
    return [pair for pair in pairs if len(pair) == 2]
