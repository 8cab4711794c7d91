"""Training data of the networks that ship: random people of the open body model in random poses.

Every joint is drawn between the limits of its movement. The people and poses of the open bodies,
plain or natural, are not among them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy import ndarray
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.checks import Rng, generator, whole_number
from riemhuman.datasets import pose_vectors

# Axes, and least and largest angles in degrees from the T-pose, in the notation of `open_poses`,
# for joints without a side and for left joints.
_LIMITS: dict[str, tuple[str, tuple[float, ...], tuple[float, ...]]] = {
    "pelvis": ("xyz", (-15, -15, -10), (25, 15, 10)),
    "lower_spine": ("xyz", (-8, -10, -8), (15, 10, 8)),
    "middle_spine": ("xyz", (-8, -10, -8), (15, 10, 8)),
    "upper_spine": ("xyz", (-8, -10, -8), (15, 10, 8)),
    "chest": ("xyz", (-6, -8, -6), (10, 8, 6)),
    "neck": ("xyz", (-20, -25, -15), (20, 25, 15)),
    "head": ("xyz", (-20, -25, -15), (20, 25, 15)),
    "collar": ("yz", (-15, -10), (10, 22)),
    "shoulder": ("xzy", (-100, -85, -100), (60, 65, 40)),
    "elbow": ("xy", (-90, -150), (90, 2)),
    "wrist": ("xyz", (-25, -35, -80), (25, 35, 80)),
    "hip": ("zyx", (-12, -20, -110), (35, 25, 35)),
    "knee": ("x", (0,), (125,)),
    "ankle": ("xz", (-25, -10), (30, 10)),
    "toes": ("x", (-30,), (15,)),
}
_LIMBS = {
    "arm": ("shoulder", "elbow"),
    "hand": ("wrist",),
    "leg": ("hip", "knee", "ankle", "toes"),
}


class TrainingBodies(NamedTuple):
    """People, each in several poses.

    Attributes
    ----------
    points : array, shape (n_people * n_poses, V, 3)
        Surfaces, person by person, metres.
    subject : array of int, shape (n_people * n_poses,)
        Number of the person.
    betas : array, shape (n_people * n_poses, B)
        Shape coefficients.
    poses : array, shape (n_people * n_poses, J, 3)
        Axis-angle vectors of the joints, radians.
    """

    points: ndarray
    subject: ndarray
    betas: ndarray
    poses: ndarray


def random_bodies(model: BodyModel, n_people: int, n_poses: int, rng: Rng = 0) -> TrainingBodies:
    """Draw random people in random poses.

    Parameters
    ----------
    model : BodyModel
        The open model, at any resolution.
    n_people, n_poses : int
        Number of people, and of poses of each.
    rng : int or numpy.random.Generator
        Seed, or the generator to draw from.

    Returns
    -------
    TrainingBodies
        Shape coefficients are standard normal.

    Raises
    ------
    ArgumentError
        If a number is less than one.
    """
    n_people = whole_number(n_people, "n_people", minimum=1)
    n_poses = whole_number(n_poses, "n_poses", minimum=1)
    rng = generator(rng)
    betas = np.repeat(rng.standard_normal((n_people, model.n_betas)), n_poses, axis=0)
    poses = random_poses(model, len(betas), rng)
    points = np.empty((len(betas), model.n_vertices, 3))
    for start in range(0, len(betas), 64):  # posing all at once would need much memory
        some = slice(start, start + 64)
        points[some] = model(betas[some], poses[some])
    return TrainingBodies(points, np.repeat(np.arange(n_people), n_poses), betas, poses)


def random_poses(model: BodyModel, n_poses: int, rng: np.random.Generator) -> ndarray:
    """Draw random poses.

    Each joint is drawn between its limits, and each limb has a random extent from the T-pose.

    Parameters
    ----------
    model : BodyModel
        The open model.
    n_poses : int
        Number of poses.
    rng : numpy.random.Generator
        Generator of the poses.

    Returns
    -------
    array, shape (n_poses, J, 3)
        Axis-angle vectors of the joints, radians.
    """
    limb_of = {joint: limb for limb, joints in _LIMBS.items() for joint in joints}
    extents: dict[str, ndarray] = {}
    turns = np.tile(np.eye(3), (n_poses, model.n_joints, 1, 1))
    for number, name in enumerate(model.joint_names):
        side, _, joint = name.partition("_")
        if side not in ("left", "right"):
            side, joint = "", name
        limb = f"{side} {limb_of.get(joint, 'trunk')}"
        if limb not in extents:
            # Angles of arms are uniform, since arms are rarely held straight out.
            extents[limb] = np.ones(1) if limb.endswith("arm") else rng.random((n_poses, 1))
        axes, least, largest = _LIMITS[joint]
        degrees = rng.uniform(least, largest, (n_poses, len(axes))) * extents[limb]
        if side == "right":
            degrees *= [1.0 if axis == "x" else -1.0 for axis in axes]
        turns[:, number] = Rotation.from_euler(axes, degrees, degrees=True).as_matrix()
    return pose_vectors(turns, model)
