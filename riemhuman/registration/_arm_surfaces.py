"""Forearms with their hands as separate surfaces, and how far joints of arms can bend.

`make_arm_surface` takes what is known of a model and returns one arm's `ArmSurface`, made once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Integers, Triangles
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import unit_vectors
from riemhuman.registration._body_parts import BodyParts
from riemhuman.registration._constants import (
    ELBOW_DEGREES,
    HAND_MOVES_METRES,
    HINGE_DEGREES,
)
from riemhuman.registration._posed_body import ModelSamples
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template


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

    def distances(self, surface: Array, points: Array, farthest: float) -> Array:
        """Return the distances of points from the surface of the arm, metres."""
        return np.minimum(nearest_points(points, surface, self.faces)[1], farthest)

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
