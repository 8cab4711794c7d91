"""Posture: angles between landmarks of bodies as they stand, in degrees."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, ArrayLike
from riemhuman.checks import checked, choice, instance, mask, real_array
from riemhuman.errors import ArgumentError
from riemhuman.measurements.measuring import Measurements

_SIDES = ("left", "right")
_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
# Landmarks with a left and a right side.
_SIDED = (
    *("acromion", "tragion", "iliocristale", "trochanterion"),
    *("lateral_epicondyle", "lateral_malleolus", "radiale", "stylion"),
    *("heel_inside", "heel_outside", "first_metatarsal", "fifth_metatarsal"),
)


@checked(measurements=instance(Measurements), up=choice(*_AXES))
def posture_angles(
    measurements: Measurements,
    points: ArrayLike,
    *,
    up: str = "y",
    trusted_vertices: ArrayLike | None = None,
) -> dict[str, Array]:
    """Return angles that describe the posture of bodies, in degrees.

    Forward is the horizontal direction across the hips. Tilts are positive if the left side is
    higher; leans are positive if they go forward or to the left. "head over neck" is the
    craniovertebral angle: the elevation of the ears above the horizontal, seen from the seventh
    cervical vertebra; it is smaller the further forward the head is. Knee and elbow angles are
    measured between thigh and shin, and between upper arm and forearm. There are also the angles of
    the arms from the trunk, and of the feet turned out.

    Parameters
    ----------
    measurements : Measurements
        Measurements with the landmarks of the open body model.
    points : array_like, shape (..., V, 3)
        Bodies in their own pose, metres.
    up : {"x", "y", "z"}
        Axis that points up.
    trusted_vertices : array_like of bool, shape (..., V), optional
        Which vertices to trust; angles of landmarks on other vertices are NaN.

    Returns
    -------
    dict of str to array, shape (...)

    Raises
    ------
    ArgumentError
        If the set lacks landmarks.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measurements = rh.measurements.Measurements(bodies.model)
    >>> angles = rh.measurements.posture_angles(measurements, bodies[0])
    >>> bool(abs(angles["shoulder tilt"]) < 4.0)
    True
    """
    definitions = measurements.definitions
    missing = [name for name in _landmarks() if name not in definitions.landmarks]
    if missing:
        more = f" and {len(missing) - 1} more" if len(missing) > 1 else ""
        raise ArgumentError(
            f"measurements must have the landmarks of the open body; it lacks {missing[0]}{more}"
        )
    points = real_array(points, "points", (definitions.n_vertices, 3))
    if trusted_vertices is not None:
        shape = points.shape[:-1]
        trusted_vertices = mask(trusted_vertices, "trusted_vertices", (shape, shape[-1:]))
    places = {}
    for name in _landmarks():
        vertices, weights = definitions.landmarks[name]
        place = np.einsum("k,...kc->...c", weights, points[..., vertices, :])
        if trusted_vertices is not None:
            trusted = trusted_vertices[..., vertices]
            place = np.where(trusted.all(axis=-1, keepdims=True), place, np.nan)
        places[name] = place
    stand = _Stand.of(places, np.array(_AXES[up]))
    return {name: angle(stand) for name, angle in _ANGLES.items()}


def _landmarks() -> list[str]:
    return ["cervicale", *(f"{side}_{name}" for name in _SIDED for side in _SIDES)]


@dataclass(frozen=True)
class _Stand:
    """Landmarks of bodies, and the directions up, forward and left, each of shape (..., 3)."""

    places: Mapping[str, Array]
    up: Array
    forward: Array
    left: Array

    @classmethod
    def of(cls, places: Mapping[str, Array], up: Array) -> _Stand:
        across = places["left_trochanterion"] - places["right_trochanterion"]
        level = across - (across @ up)[..., np.newaxis] * up
        left = level / np.linalg.norm(level, axis=-1, keepdims=True)
        return cls(places, up, np.cross(left, up), left)

    def middle(self, name: str) -> Array:
        return (self.places[f"left_{name}"] + self.places[f"right_{name}"]) / 2

    def rise(self, steps: Array, along: Array) -> Array:
        """Return how steeply vectors rise, seen against the plane of up and an axis, degrees."""
        angles: Array = np.degrees(np.arctan2(steps @ self.up, np.sum(steps * along, axis=-1)))
        return angles

    def tilt(self, name: str) -> Array:
        return self.rise(self.places[f"left_{name}"] - self.places[f"right_{name}"], self.left)

    def lean(self, along: Array) -> Array:
        """Return how far the trunk leans along an axis, degrees."""
        return 90.0 - self.rise(self._trunk(), along)

    def head(self) -> Array:
        return self.rise(self.middle("tragion") - self.places["cervicale"], self.forward)

    def turn(self) -> Array:
        """Return how far the shoulders are turned against the hips, to the left, degrees."""
        across = self.places["left_acromion"] - self.places["right_acromion"]
        back = -np.sum(across * self.forward, axis=-1)
        angles: Array = np.degrees(np.arctan2(back, np.sum(across * self.left, axis=-1)))
        return angles

    def bend(self, side: str, names: tuple[str, str, str]) -> Array:
        """Return the angle by which a limb is bent at the second of three landmarks, degrees."""
        first, second, third = (self.places[f"{side}_{name}"] for name in names)
        return _angle(second - first, third - second)

    def abduction(self, side: str) -> Array:
        arm = self.places[f"{side}_radiale"] - self.places[f"{side}_acromion"]
        return _angle(arm, -self._trunk())

    def turn_out(self, side: str) -> Array:
        heel = (self.places[f"{side}_heel_inside"] + self.places[f"{side}_heel_outside"]) / 2
        inner_ball = self.places[f"{side}_first_metatarsal"]
        outer_ball = self.places[f"{side}_fifth_metatarsal"]
        foot = (inner_ball + outer_ball) / 2 - heel
        outward = np.sum(foot * self.left, axis=-1) * (1.0 if side == "left" else -1.0)
        angles: Array = np.degrees(np.arctan2(outward, np.sum(foot * self.forward, axis=-1)))
        return angles

    def _trunk(self) -> Array:
        return np.asarray(self.places["cervicale"] - self.middle("trochanterion"))


def _angle(first: Array, second: Array) -> Array:
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    angles: Array = np.degrees(np.arctan2(across, np.sum(first * second, axis=-1)))
    return angles


_LEG = ("trochanterion", "lateral_epicondyle", "lateral_malleolus")
_ARM = ("acromion", "radiale", "stylion")
_ANGLES: Mapping[str, Callable[[_Stand], Array]] = {
    "head over neck": _Stand.head,
    "head tilt": lambda stand: stand.tilt("tragion"),
    "shoulder tilt": lambda stand: stand.tilt("acromion"),
    "pelvis tilt": lambda stand: stand.tilt("iliocristale"),
    "trunk lean forward": lambda stand: stand.lean(stand.forward),
    "trunk lean to the left": lambda stand: stand.lean(stand.left),
    "shoulders turned to the left": _Stand.turn,
    "left knee bent": lambda stand: stand.bend("left", _LEG),
    "right knee bent": lambda stand: stand.bend("right", _LEG),
    "left elbow bent": lambda stand: stand.bend("left", _ARM),
    "right elbow bent": lambda stand: stand.bend("right", _ARM),
    "left arm from the trunk": lambda stand: stand.abduction("left"),
    "right arm from the trunk": lambda stand: stand.abduction("right"),
    "left foot turned out": lambda stand: stand.turn_out("left"),
    "right foot turned out": lambda stand: stand.turn_out("right"),
}
