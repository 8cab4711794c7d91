"""Rebuild the measurements of the open body model from the geometry of its mean body.

    python tutorials/remake/build_open_measurements.py [folder] [--ansur FOLDER]

writes open_body_full.json, open_body_coarse.json and seated.json, by default over those that ship,
and then the page of the documentation that lists them. Run it after a change of `open_definitions`.
With --ansur, a folder with men.csv and women.csv, it also rebuilds what depends on them: the
statistics of adults (build_statistics.py) and the percentiles (build_percentiles.py, minutes).
Until then, a new measurement has neither predictions nor percentiles; its ± comes from
build_noise_of_poses.py, which takes longer.

Some landmarks are found on the mean body in the standard pose (legs straight down, arms straight at
50 degrees below the horizontal; y is up, x left, z forward); `open_definitions` lists the others.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import build_measurement_page
import build_percentiles
import build_statistics
import numpy as np
from numpy import ndarray
from open_definitions import (
    LANDMARKS,
    LEGS,
    PARTS,
    SEATED_POSE,
    STANDARD_POSE,
    TRUNK,
    open_definitions,
    seated_definitions,
)

from riemhuman.bodies import BodyModel
from riemhuman.datasets import joint_rotations, load_open_model, pose_vectors
from riemhuman.errors import FileError
from riemhuman.measurements import Girth, Measurements, MeasurementSet
from riemhuman.measurements.measurement_set import DATA
from riemhuman.surfaces.nearest_points import nearest_points

_FRAME = ("pelvis", "neck", "right_hip", "left_hip")
_UP = np.array([0.0, 1.0, 0.0])
_FORWARD = np.array([0.0, 0.0, 1.0])
_RIGHT = np.array([-1.0, 0.0, 0.0])
# Height of the glabella, just above the brows, as a share of the stature.
_GLABELLA = 0.953
# Distances below the crotch and below the fold of the breast, and between levels, metres.
_BELOW_CROTCH, _BELOW_FOLD = 0.03, 0.01
_STEP = 0.005
# Signs of x: y is up, x left, z forward.
_SIDES = {"left": 1.0, "right": -1.0}


def main(arguments: Sequence[str] | None = None) -> None:
    """Find the landmarks and write both files."""
    parser = argparse.ArgumentParser(description="Rebuild the open body's measurements.")
    parser.add_argument("folder", nargs="?", type=Path, default=DATA)
    parser.add_argument("--ansur", type=Path, help="folder with men.csv and women.csv")
    options = parser.parse_args(arguments)
    folder = options.folder
    if not folder.is_dir():
        raise FileError(f"{folder} is not a folder; it must exist to receive the measurements")
    full = load_open_model("full")
    points, fractions = find_landmarks(full)
    for resolution in ("full", "coarse"):
        path = folder / f"open_body_{resolution}.json"
        build(load_open_model(resolution), points, fractions).save(path)
        sys.stdout.write(f"{path}: {len(points)} landmarks, {path.stat().st_size / 1e3:.0f} kB\n")
    vectors = pose_vectors(joint_rotations(SEATED_POSE, full), full).round(6)
    seated = {
        "standard_pose": {
            name: vector.tolist()
            for name, vector in zip(full.joint_names, vectors, strict=True)
            if vector.any()
        },
        "measurements": [measurement.to_dict() for measurement in seated_definitions()],
    }
    (folder / "seated.json").write_text(json.dumps(seated, indent=1, ensure_ascii=False) + "\n")
    if options.ansur is not None:
        build_statistics.main([str(options.ansur), str(folder)])
        build_percentiles.main([str(options.ansur), str(folder)])
    if folder == DATA:
        build_measurement_page.main()


def build(
    model: BodyModel, points: dict[str, ndarray], fractions: dict[str, float]
) -> MeasurementSet:
    """Return the measurements of the model at one resolution.

    Parameters
    ----------
    model : BodyModel
        The model.
    points : dict of str to array, shape (3,)
        Landmarks of the mean body in the standard pose, metres.
    fractions : dict of str to float
        Places on their bones, from 0 to 1, where limbs are thickest or thinnest.

    Returns
    -------
    MeasurementSet
    """
    surface = model(pose=standard_pose(model))
    places, _ = nearest_points(np.array(list(points.values())), surface, model.faces)
    landmarks = {}
    for name, face, weights in zip(points, *places, strict=True):
        # Landmarks on an edge belong to two triangles, of which either may be the nearest.
        order = np.argsort(model.faces[face])
        kept = order[weights[order].round(6) > 0.0]
        landmarks[name] = model.faces[face][kept], weights[kept].round(6)
    bare = _bare(model)
    return replace(bare, landmarks=landmarks, measurements=open_definitions(fractions))


def find_landmarks(model: BodyModel) -> tuple[dict[str, ndarray], dict[str, float]]:
    """Find the landmarks of the mean body in the standard pose.

    Parameters
    ----------
    model : BodyModel
        The model at full resolution.

    Returns
    -------
    points : dict of str to array, shape (3,)
        Landmarks on or near the surface, metres.
    fractions : dict of str to float
        Places on their bones, from 0 to 1, where limbs are thickest or thinnest.
    """
    body = _Body(model)
    points = _landmarks_of_head(body) | _nipples(body)
    points["under_bust"] = _fold(body, points["left_nipple"])
    points |= _landmarks_of_waist(body, points["under_bust"][1]) | _buttocks(body)
    points["crotch"] = body.hits(body.joints["pelvis"], -_UP)[0]
    for side in _SIDES:
        points |= _landmarks_of_side(body, side, points["crotch"])
    for name, weights in LANDMARKS.items():
        points[name] = sum(weight * body.surface[vertex] for vertex, weight in weights.items())
        if name.startswith("right"):
            points[name.replace("right", "left")] = points[name] * [-1.0, 1.0, 1.0]
    fractions = {
        "forearm": _extreme_girth(body, "right_elbow", "right_wrist", 0.1, 0.5, np.nanargmax),
        "wrist": _extreme_girth(body, "right_elbow", "right_wrist", 0.8, 1.0, np.nanargmin),
        "calf": _extreme_girth(body, "right_knee", "right_ankle", 0.1, 0.5, np.nanargmax),
        "ankle": _extreme_girth(body, "right_knee", "right_ankle", 0.7, 0.98, np.nanargmin),
    }
    return points, fractions


class _Body:
    """The mean body in the standard pose."""

    def __init__(self, model: BodyModel) -> None:
        self.model = model
        self._set = _bare(model)
        self.surface = model(pose=standard_pose(model))
        joints = model.joints(pose=standard_pose(model))
        self.joints = dict(zip(model.joint_names, joints, strict=True))
        self._corners = self.surface[self._set.faces]

    def vertices_of(self, *parts: str) -> ndarray:
        """Return the vertices of parts."""
        return self.surface[np.unique(self._set.faces[self._set.in_parts(parts)])]

    def hits(self, origin: ndarray, *directions: ndarray) -> list[ndarray]:
        """Return where rays from inside first leave the surface."""
        places = []
        a = self._corners[:, 0]
        u, v = self._corners[:, 1] - a, self._corners[:, 2] - a
        for direction in directions:
            matrix = np.stack([u, v, np.broadcast_to(-direction, u.shape)], axis=-1)
            solvable = np.abs(np.linalg.det(matrix)) > 1e-14
            right = (origin - a)[solvable][..., np.newaxis]
            s, t, distance = np.linalg.solve(matrix[solvable], right)[..., 0].T
            inside = (s >= 0) & (t >= 0) & (s + t <= 1) & (distance > 0)
            places.append(origin + distance[inside].min() * direction)
        return places

    def girth(self, at: Any, normal: Any, parts: tuple[str, ...], **landmarks: Any) -> float:
        """Return the length of the hull of a section."""
        girth = Girth(name="girth", at=at, normal=normal, parts=parts, hull=True)
        definitions = replace(self._set, measurements=[girth], landmarks=landmarks)
        return float(Measurements(definitions).measure(self.surface, axes="space").values[0])

    def level_girth(self, height: float) -> float:
        """Return the length of the hull of a level section of the trunk."""
        back = self.hits(np.array([0.0, height, 0.0]), -_FORWARD)
        places, _ = nearest_points(np.array(back), self.surface, self._set.faces)
        landmark = self._set.faces[places.triangles[0]], places.barycentric[0]
        return self.girth("back", "up", TRUNK, back=landmark)


def _landmarks_of_head(body: _Body) -> dict[str, ndarray]:
    surface, joints = body.surface, body.joints
    stature, floor = float(np.ptp(surface[:, 1])), float(surface[:, 1].min())
    brows = np.array([0.0, floor + _GLABELLA * stature, joints["head"][2]])
    glabella, opisthocranion = body.hits(brows, _FORWARD, -_FORWARD)
    return {
        "crown": surface[surface[:, 1].argmax()],
        "glabella": glabella,
        "opisthocranion": opisthocranion,
        "skull_top": body.hits(0.5 * (glabella + opisthocranion), _UP)[0],
        "cervicale": body.hits(joints["neck"], -_FORWARD)[0],
        "right_neck": body.hits(0.7 * joints["neck"] + 0.3 * joints["head"], _RIGHT)[0],
    }


def _nipples(body: _Body) -> dict[str, ndarray]:
    trunk, joints, nipples = body.vertices_of(*TRUNK), body.joints, {}
    breasts = trunk[(trunk[:, 1] > joints["upper_spine"][1]) & (trunk[:, 1] < joints["neck"][1])]
    for side, sign in _SIDES.items():
        half = breasts[(sign * breasts[:, 0] > 0.03) & (sign * breasts[:, 0] < 0.14)]
        nipples[f"{side}_nipple"] = half[half[:, 2].argmax()]
    return nipples


def _landmarks_of_waist(body: _Body, highest: float) -> dict[str, ndarray]:
    waist = _narrowest(body, body.joints["lower_spine"][1], highest)
    directions = {"waist_front": _FORWARD, "waist_back": -_FORWARD}
    directions |= {"right_waist": _RIGHT, "left_waist": -_RIGHT}
    places = body.hits(np.array([0.0, waist, 0.0]), *directions.values())
    return dict(zip(directions, places, strict=True))


def _buttocks(body: _Body) -> dict[str, ndarray]:
    lower, buttocks = body.vertices_of(*TRUNK, *LEGS), {}
    lower = lower[lower[:, 1] < body.joints["lower_spine"][1]]
    for side, sign in _SIDES.items():
        half = lower[sign * lower[:, 0] > 0]
        buttocks[f"{side}_buttock"] = half[half[:, 2].argmin()]
    return buttocks


def _landmarks_of_side(body: _Body, side: str, crotch: ndarray) -> dict[str, ndarray]:
    """Return landmarks of an arm, a leg and a foot."""
    joints, outward = body.joints, -_SIDES[side] * _RIGHT
    thigh = joints[f"{side}_hip"] * [1.0, 0.0, 1.0] + crotch * [0.0, 1.0, 0.0]
    over_shoulder = 0.3 * outward + 0.954 * _UP
    foot = body.surface[np.isin(body.model.weights.argmax(axis=1), _feet(body.model, side))]
    return {
        f"{side}_thigh": body.hits(thigh - _BELOW_CROTCH * _UP, outward)[0],
        f"{side}_acromion": body.hits(joints[f"{side}_shoulder"], over_shoulder)[0],
        f"{side}_sole": body.hits(joints[f"{side}_ankle"], -_UP)[0],
        f"{side}_heel": foot[foot[:, 2].argmin()],
        f"{side}_toe": foot[foot[:, 2].argmax()],
    }


def _extreme_girth(
    body: _Body,
    upper: str,
    lower: str,
    first: float,
    last: float,
    choose: Callable[[list[float]], np.intp],
) -> float:
    """Return where along a bone, between two shares of its length, a limb has the chosen girth."""
    shares = np.arange(first, last + 1e-9, 0.02)
    part = "right arm" if "elbow" in upper else "right leg"
    girths = [
        body.girth({upper: 1.0 - share, lower: share}, (lower, upper), (part,)) for share in shares
    ]
    return round(float(shares[choose(girths)]), 2)


def _fold(body: _Body, nipple: ndarray) -> ndarray:
    """Return the place just below the sharpest bend of the profile under a nipple."""
    heights = np.arange(nipple[1] - 0.11, nipple[1] - 0.02, _STEP)
    inside = [np.array([nipple[0], height, 0.0]) for height in heights]
    profile = np.array([body.hits(place, _FORWARD)[0][2] for place in inside])
    smooth = np.convolve(profile, np.ones(3) / 3.0, "same")
    bend = smooth[4:] - 2.0 * smooth[2:-2] + smooth[:-4]
    fold = 3 + int(bend[1:-1].argmax())
    return body.hits(inside[fold] - _BELOW_FOLD * _UP, _FORWARD)[0]


def _narrowest(body: _Body, low: float, high: float) -> float:
    heights = np.arange(low, high, _STEP)
    return float(heights[np.argmin([body.level_girth(height) for height in heights])])


def _feet(model: BodyModel, side: str) -> list[int]:
    return [model.joint_names.index(f"{side}_{joint}") for joint in ("ankle", "toes")]


def standard_pose(model: BodyModel) -> ndarray:
    """Return the standard pose of the open model.

    Parameters
    ----------
    model : BodyModel
        The model, at any resolution.

    Returns
    -------
    array, shape (J, 3)
        Axis-angle vectors, radians.
    """
    return pose_vectors(joint_rotations(STANDARD_POSE, model), model)


def _bare(model: BodyModel) -> MeasurementSet:
    """Return the parts, axes and standard pose, without landmarks and measurements."""
    mass = model.weights[model.faces].sum(axis=1)
    main = np.array(model.joint_names)[mass.argmax(axis=1)]
    parts = {name: np.flatnonzero(np.isin(main, joints)) for name, joints in PARTS.items()}
    vectors = standard_pose(model).round(6)
    poses = {n: v for n, v in zip(model.joint_names, vectors, strict=True) if v.any()}
    return MeasurementSet(model, (), {}, parts, _FRAME, standard_pose=poses)


if __name__ == "__main__":
    main()
