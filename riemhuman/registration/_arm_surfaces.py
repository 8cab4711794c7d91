"""Forearms with their hands as separate surfaces, and how far joints of arms can bend."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.kernels.surface import unit_vectors
from riemhuman.registration._posed_body import ModelSamples
from riemhuman.registration._start_poses import BodyParts
from riemhuman.registration.settings import ArmSettings
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template


class ArmSurface:
    """The surface of a forearm with its hand, and the axes of the elbow and the wrist."""

    def __init__(
        self,
        model: BodyModel,
        parts: BodyParts,
        joints: np.ndarray,
        skin: ModelSamples,
        few: ModelSamples,
        settings: ArmSettings,
    ) -> None:
        # `skin` are all vertices of the model, `few` some points of it.
        self.joints = joints  # from the collar to the wrist
        self.side = parts.names[joints[-1]].split("_")[0]
        self.settings = settings
        inside = parts.vertices(joints[-2:].tolist())
        faces = model.faces[inside[model.faces].all(axis=1)]
        self.vertices, corners = np.unique(faces, return_inverse=True)  # numbers in the model
        self.faces = corners.reshape(-1, 3)
        template = Template(model.template.vertices[self.vertices], self.faces)
        self.metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=1.0)
        self.skin = skin.only(self.vertices)
        # A few points of the whole arm, and the vertices that poses of the hand move.
        on_arm = parts.vertices(joints[1:].tolist())
        self.samples = few.only(on_arm[few.numbers] & (few.numbers >= 0))
        moves = np.abs(model.hand_directions[self.vertices]).max(axis=(1, 2), initial=0.0)
        self.on_hand = self.vertices[moves > settings.hand_moves_metres]
        # Coefficients of poses of this hand; NaN for the other.
        hands = [model.hand_pose(pose).reshape(2, -1) for pose in model.hand_poses]
        on_side = np.array([[self.side == "left"], [self.side == "right"]])
        self.hands = [np.where(on_side, both, np.nan).ravel() for both in hands]

        # Rotations of the bones from the rest pose to a T-pose, with the palms down: there, y is up
        # and z forward, the hinge of the elbow is y and that of the wrist z.
        shoulder, elbow, wrist = self.samples.skeleton.rest_joints[joints[1:]]
        upper, self._forearm = unit_vectors(np.stack([elbow - shoulder, wrist - elbow]))
        sideways = np.array([1.0 if self.side == "left" else -1.0, 0.0, 0.0])
        self._raised = _shortest(upper, sideways)
        self._straight = _shortest(self._raised @ self._forearm, sideways) @ self._raised

    def distances(self, surface: np.ndarray, points: np.ndarray, farthest: float) -> np.ndarray:
        """Return the distances of points from the surface of the arm, metres."""
        return np.minimum(nearest_points(points, surface, self.faces)[1], farthest)

    def strain(self, local: np.ndarray) -> float:
        """Return the factor by which distances count more, the less plausible the arm is."""
        elbow, wrist = local[self.joints[-2:]]
        height = (self._raised @ elbow @ self._forearm)[1]
        outward = np.degrees(np.arcsin(np.clip(height, 0.0, 1.0)))
        turned = Rotation.from_matrix(self._straight @ wrist @ self._straight.T).as_rotvec()
        off_hinge = np.degrees(np.hypot(turned[0], turned[1]))
        settings = self.settings
        outward, off_hinge = outward / settings.elbow_degrees, off_hinge / settings.hinge_degrees
        return float(1.0 + outward**2 + off_hinge**2)

    def rotated(self, local: np.ndarray, forearm: float, wrist: float) -> np.ndarray:
        """Return rotations of the joints with the forearm rotated about itself and the wrist bent.

        Both angles are in degrees; the wrist is straight at 0.
        """
        *_, elbow, hand = self.joints
        turned = local.copy()
        about_forearm = Rotation.from_rotvec(np.radians(forearm) * self._forearm).as_matrix()
        turned[elbow] = local[elbow] @ about_forearm
        hinge = self._straight.T @ np.array([0.0, 0.0, np.radians(wrist)])
        turned[hand] = Rotation.from_rotvec(hinge).as_matrix()
        return turned


def _shortest(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the shortest rotation from one unit vector to another."""
    rotation: np.ndarray = Rotation.align_vectors(end, start)[0].as_matrix()
    return rotation
