"""The parts of a body model by the usual names of its joints, arms as surfaces, and distances.

`BodyParts` says which vertices each joint moves. `ArmSurface` is a forearm with its hand, and knows
how far its joints can bend. `move_end` moves the end of a limb as far as it reaches.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.bodies import BodyModel, rotation_matrix
from riemhuman.bodies.skinning import JointMotions, Skeleton, usual_joint_names
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import unit_vectors
from riemhuman.registration._constants import (
    ELBOW_DEGREES,
    HAND_MOVES_METRES,
    HINGE_DEGREES,
    LEAST_GAIN,
    N_STANDARD_ERRORS,
)
from riemhuman.registration._posed_body import ModelSamples, Pose
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template

TRUNK = ("pelvis", "lower_spine", "middle_spine", "upper_spine", "chest")
_ARM_JOINTS = ("collar", "shoulder", "elbow", "wrist")
# Joints that move a smaller share of the model's vertices are ignored.
_LIMB = 0.01


@dataclass(frozen=True, eq=False)
class BodyParts:
    """The joints of a model by their usual names, and the vertices that each moves most."""

    model: BodyModel

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Return the usual names of the joints."""
        return usual_joint_names(self.model)

    @cached_property
    def owners(self) -> Integers:
        """Return the joint that moves each vertex most."""
        owners: Integers = self.model.weights.argmax(axis=1)
        return owners

    @cached_property
    def arms(self) -> list[Integers]:
        """Return the joints of each arm, from the collar to the wrist."""
        arms = [[f"{side}_{joint}" for joint in _ARM_JOINTS] for side in ("left", "right")]
        return [np.array(self.numbers(*arm)) for arm in arms if {*arm} <= {*self.names}]

    @cached_property
    def on_hands(self) -> Booleans:
        """Return which vertices belong to the hands."""
        return self.vertices(int(arm[-1]) for arm in self.arms)

    @cached_property
    def on_trunk(self) -> Booleans:
        """Return which vertices belong to the trunk."""
        on_trunk: Booleans = np.isin(self.owners, self.numbers(*TRUNK))
        return on_trunk

    @cached_property
    def bare(self) -> Booleans:
        """Return which vertices people wear no clothes on: those of the head and the hands."""
        return self.on_hands | self.vertices(self.numbers("head"))

    @cached_property
    def bare_ends(self) -> Booleans:
        """Return which vertices belong to the head, the hands and the feet."""
        return self.bare | self.vertices(self.numbers("left_ankle", "right_ankle"))

    @cached_property
    def halves(self) -> list[Booleans]:
        """Return which vertices are of the legs, and which above the waist."""
        if not {"left_hip", "right_hip", "middle_spine"} <= {*self.names}:
            return []
        ends = (("left_hip", "right_hip"), ("middle_spine",))
        return [self.vertices(self.numbers(*names)) for names in ends]

    def numbers(self, *names: str) -> list[int]:
        """Return the joints with these names that the model has."""
        return [self.names.index(name) for name in names if name in self.names]

    def vertices(self, joints: Iterable[int]) -> Booleans:
        """Return which vertices belong to some joints or to joints below them."""
        below = {*joints}
        for k in map(int, self.model.joint_order):
            if int(self.model.parents[k]) in below:
                below.add(k)
        return np.isin(self.owners, sorted(below))

    def limb_vertices(self, joint: int) -> Booleans:
        """Return which vertices belong to a joint or to those below it, or above it on an arm."""
        joints = [joint]
        for arm in self.arms:
            joints += arm[1:].tolist() if joint in arm[1:] else []
        return self.vertices(joints)

    def shares(self, chosen: Booleans) -> Array:
        """Return the share of the vertices of each joint that are chosen; 1 for small joints."""
        counts = np.bincount(self.owners, minlength=self.model.n_joints)
        chosen_counts = np.bincount(self.owners, chosen, minlength=self.model.n_joints)
        return np.where(counts >= _LIMB * len(chosen), chosen_counts / np.maximum(counts, 1), 1.0)


@dataclass(frozen=True, eq=False)
class ArmSurface:
    """The surface of a forearm with its hand, and the axes of the elbow and the wrist.

    Parameters
    ----------
    joints : array of int, shape (4,)
        From the collar to the wrist.
    side : {"left", "right"}
    vertices : array of int, shape (n,)
        Numbers in the model of the vertices of the surface.
    faces : array of int, shape (F, 3)
        Triangles of these vertices.
    metric : ElasticMetric
    skin : ModelSamples
        The vertices of the surface.
    samples : ModelSamples
        Some points of the whole arm.
    on_hand : array of int
        Numbers in the model of the vertices that poses of the hand move.
    hands : list of array
        Coefficients of the poses of this hand; NaN for those of the other.
    forearm : array, shape (3,)
        Direction of the forearm in the rest pose.
    raised, straight : array, shape (3, 3)
        Rotations of the upper arm and the forearm from the rest pose to a T-pose with the palms
        down: there, y is up and z forward, the hinge of the elbow is y and that of the wrist z.
    """

    joints: Integers
    side: str
    vertices: Integers
    faces: Triangles
    metric: ElasticMetric
    skin: ModelSamples
    samples: ModelSamples
    on_hand: Integers
    hands: list[Array]
    forearm: Array
    raised: Array
    straight: Array

    def strain(self, local: Array) -> float:
        """Return the factor by which distances count more, the less plausible the arm is."""
        elbow, wrist = local[self.joints[-2:]]
        height = (self.raised @ elbow @ self.forearm)[1]
        outward = np.degrees(np.arcsin(np.clip(height, 0.0, 1.0)))
        turned = Rotation.from_matrix(self.straight @ wrist @ self.straight.T).as_rotvec()
        off_hinge = np.degrees(np.hypot(turned[0], turned[1]))
        outward, off_hinge = outward / ELBOW_DEGREES, off_hinge / HINGE_DEGREES
        return float(1.0 + outward**2 + off_hinge**2)

    def rotated(self, local: Array, forearm: float, wrist: float) -> Array:
        """Return rotations of the joints with the forearm rotated about itself and the wrist bent.

        Both angles are in degrees; the wrist is straight at 0.
        """
        *_, elbow, hand = self.joints
        turned = local.copy()
        about_forearm = Rotation.from_rotvec(np.radians(forearm) * self.forearm).as_matrix()
        turned[elbow] = local[elbow] @ about_forearm
        hinge = self.straight.T @ np.array([0.0, 0.0, np.radians(wrist)])
        turned[hand] = Rotation.from_rotvec(hinge).as_matrix()
        return turned


def make_arm_surface(
    parts: BodyParts, joints: Integers, skin: ModelSamples, few: ModelSamples
) -> ArmSurface:
    """Return the surface of an arm; `skin` are all vertices of the model, `few` some points."""
    model, side = parts.model, parts.names[joints[-1]].split("_")[0]
    inside = parts.vertices(joints[-2:].tolist())
    vertices, corners = np.unique(model.faces[inside[model.faces].all(axis=1)], return_inverse=True)
    faces = corners.reshape(-1, 3)
    template = Template(model.template.vertices[vertices], faces)
    on_arm = parts.vertices(joints[1:].tolist())
    samples = few.only(on_arm[few.numbers] & (few.numbers >= 0))
    moves = np.abs(model.hand_directions[vertices]).max(axis=(1, 2), initial=0.0)
    hands = [model.hand_pose(pose).reshape(2, -1) for pose in model.hand_poses]
    on_side = np.array([[side == "left"], [side == "right"]])
    shoulder, elbow, wrist = samples.skeleton.rest_joints[joints[1:]]
    upper, forearm = unit_vectors(np.stack([elbow - shoulder, wrist - elbow]))
    sideways = np.array([1.0 if side == "left" else -1.0, 0.0, 0.0])
    raised = _shortest(upper, sideways)
    return ArmSurface(
        joints=joints,
        side=side,
        vertices=vertices,
        faces=faces,
        metric=ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=1.0),
        skin=skin.only(vertices),
        samples=samples,
        on_hand=vertices[moves > HAND_MOVES_METRES],
        hands=[np.where(on_side, both, np.nan).ravel() for both in hands],
        forearm=forearm,
        raised=raised,
        straight=_shortest(raised @ forearm, sideways) @ raised,
    )


def _shortest(start: Array, end: Array) -> Array:
    """Return the shortest rotation from one unit vector to another."""
    rotation: Array = Rotation.align_vectors(end, start)[0].as_matrix()
    return rotation


# Limbs are never moved to reach farther than this share of their length: a straight one, which
# bends by less than 11 degrees, would not say in which plane it bends.
_STRAIGHTEST = 0.995
# Nor less far: with bones of equal length, that is a bend by 151 degrees; people reach about 150.
_MOST_BENT = 0.25


def move_end(skeleton: Skeleton, pose: Pose, joints: Integers, shift: Array) -> Pose:
    """Return a pose with a hand or foot shifted, as far as its limb reaches, and not rotated.

    The joints are shoulder, elbow and wrist, or hip, knee and ankle; the shift is in metres.
    """
    motions = JointMotions(skeleton, pose.local, pose.betas)
    start, middle, end = motions.positions[joints]
    upper, lower = middle - start, end - middle
    lengths = np.linalg.norm(upper), np.linalg.norm(lower)
    goal = end + shift - start
    reach = np.clip(np.linalg.norm(goal), _MOST_BENT * sum(lengths), _STRAIGHTEST * sum(lengths))
    # The elbow bends until the hand is as far from the shoulder as its goal (law of cosines).
    bend = np.arccos(np.clip((reach**2 - np.dot(lengths, lengths)) / (2 * np.prod(lengths)), -1, 1))
    present = np.arccos(np.clip(upper @ lower / np.prod(lengths), -1.0, 1.0))
    hinge = unit_vectors(np.cross(upper, lower))
    turn = rotation_matrix((bend - present) * hinge)
    aim = Rotation.align_vectors(goal, upper + turn @ lower)[0].as_matrix()
    local = pose.local.copy()
    for joint, rotation in zip(joints, (aim, turn, (aim @ turn).T), strict=True):
        local[joint] = motions.axes[joint].T @ rotation @ motions.rotations[joint]
    return pose._replace(local=local)


# Points of a scan that are farther from all vertices belong to no part, metres: a point near the
# surface (5 cm) has a vertex within this, even of a coarse mesh with edges of 15 cm.
_FARTHEST_VERTEX = 0.1


def points_on(points: Array, surface: Array, vertices: Integers) -> Array:
    """Return the points of a scan that lie near some vertices of a surface."""
    # V where no vertex is near.
    nearest = cKDTree(surface).query(points, distance_upper_bound=_FARTHEST_VERTEX)[1]
    near: Array = points[np.isin(nearest, vertices)]
    return near


def faces_among(faces: Triangles, vertices: Integers) -> Triangles:
    """Return the triangles of some vertices, in ascending order, numbered among these."""
    inside = np.isin(faces, vertices).all(axis=1)
    return np.searchsorted(vertices, faces[inside])


def limited_distances(points: Array, surface: Array, faces: Triangles, farthest: float) -> Array:
    """Return the distances of points from a surface, metres, with an upper limit."""
    return np.minimum(nearest_points(points, surface, faces)[1], farthest)


def are_less(some: Array, others: Array) -> bool:
    """Return whether distances of the same points are smaller by more than chance."""
    gains = others - some
    chance = N_STANDARD_ERRORS * np.sqrt(np.mean(gains**2) / len(gains))
    return bool(gains.mean() > max(LEAST_GAIN * others.mean(), chance))
