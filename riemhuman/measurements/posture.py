"""Posture: angles between landmarks of bodies as they stand, in degrees."""

from __future__ import annotations

from collections.abc import Mapping

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
# Landmarks between which limbs are straight if they are not bent at the joint.
_LIMBS = {
    "knee": ("trochanterion", "lateral_epicondyle", "lateral_malleolus"),
    "elbow": ("acromion", "radiale", "stylion"),
}


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
    places = _places_of(measurements, points, trusted_vertices)
    high = np.array(_AXES[up])
    across = places["left_trochanterion"] - places["right_trochanterion"]
    level = across - (across @ high)[..., np.newaxis] * high
    left = level / np.linalg.norm(level, axis=-1, keepdims=True)
    forward = np.cross(left, high)
    trunk = places["cervicale"] - _middle(places, "trochanterion")

    def rise(steps: Array, along: Array) -> Array:
        """Return how steeply vectors rise, seen against the plane of up and an axis."""
        return _degrees(steps @ high, np.sum(steps * along, axis=-1))

    angles = {
        "head over neck": rise(_middle(places, "tragion") - places["cervicale"], forward),
        "head tilt": rise(_to_the_left(places, "tragion"), left),
        "shoulder tilt": rise(_to_the_left(places, "acromion"), left),
        "pelvis tilt": rise(_to_the_left(places, "iliocristale"), left),
        "trunk lean forward": 90.0 - rise(trunk, forward),
        "trunk lean to the left": 90.0 - rise(trunk, left),
    }
    shoulders = _to_the_left(places, "acromion")
    back = -np.sum(shoulders * forward, axis=-1)
    angles["shoulders turned to the left"] = _degrees(back, np.sum(shoulders * left, axis=-1))
    for joint, names in _LIMBS.items():
        for side in _SIDES:
            first, second, third = (places[f"{side}_{name}"] for name in names)
            angles[f"{side} {joint} bent"] = _angle(second - first, third - second)
    for side in _SIDES:
        arm = places[f"{side}_radiale"] - places[f"{side}_acromion"]
        angles[f"{side} arm from the trunk"] = _angle(arm, -trunk)
    for side in _SIDES:
        heel = (places[f"{side}_heel_inside"] + places[f"{side}_heel_outside"]) / 2
        ball = (places[f"{side}_first_metatarsal"] + places[f"{side}_fifth_metatarsal"]) / 2
        foot = ball - heel
        outward = np.sum(foot * left, axis=-1) * (1.0 if side == "left" else -1.0)
        angles[f"{side} foot turned out"] = _degrees(outward, np.sum(foot * forward, axis=-1))
    return angles


def _places_of(
    measurements: Measurements, points: ArrayLike, trusted_vertices: ArrayLike | None
) -> dict[str, Array]:
    """Return the landmarks of bodies, shape (..., 3), NaN where vertices are not trusted."""
    definitions = measurements.definitions
    names = ["cervicale", *(f"{side}_{name}" for name in _SIDED for side in _SIDES)]
    missing = [name for name in names if name not in definitions.landmarks]
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
    for name in names:
        vertices, weights = definitions.landmarks[name]
        place = np.einsum("k,...kc->...c", weights, points[..., vertices, :])
        if trusted_vertices is not None:
            trusted = trusted_vertices[..., vertices]
            place = np.where(trusted.all(axis=-1, keepdims=True), place, np.nan)
        places[name] = place
    return places


def _middle(places: Mapping[str, Array], name: str) -> Array:
    return (places[f"left_{name}"] + places[f"right_{name}"]) / 2


def _to_the_left(places: Mapping[str, Array], name: str) -> Array:
    return places[f"left_{name}"] - places[f"right_{name}"]


def _angle(first: Array, second: Array) -> Array:
    across = np.linalg.norm(np.cross(first, second), axis=-1)
    return _degrees(across, np.sum(first * second, axis=-1))


def _degrees(opposite: Array, adjacent: Array) -> Array:
    angles: Array = np.degrees(np.arctan2(opposite, adjacent))
    return angles
