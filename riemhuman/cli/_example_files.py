"""Example files to try the commands on: registered bodies, raw scans, visits and a walk."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

import riemhuman as rh
from riemhuman.arrays import Array, Points, Triangles
from riemhuman.io.files import write_text
from riemhuman.io.text_tables import csv_text

Angles = Mapping[str, tuple[str, *tuple[float, ...]]]

# Four women and four men of the ten open people.
PEOPLE = {
    "anna": "athletic woman",
    "carla": "older full-figured woman",
    "emma": "tall slim woman",
    "gina": "petite woman",
    "ben": "lanky man",
    "david": "heavy man",
    "felix": "tall muscular man",
    "henry": "older lean man",
}

_STANDING: Angles = {"shoulder": ("xz", 10, -58), "elbow": ("y", -18), "hip": ("z", 5)}
# On a high stool: at hips that bend further, the model's skin folds, and elastic paths to other
# poses keep part of the fold half way.
_SITTING: Angles = {
    "pelvis": ("x", 6),
    "shoulder": ("xz", -8, -66),
    "elbow": ("y", -62),
    "hip": ("zx", 8, -55),
    "knee": ("x", 60),
}

_SCAN_POINTS = 12_000
_SCAN_NOISE = 0.0015  # metres
_SCAN_HOLES = 0.06  # share of the surface
_OTHER_POINTS = 6_000
# In metres; the first is from the middle of the floor to its sides.
_FLOOR_METRES = 0.8
_FLOOR_SPACING = 0.03
_FLOOR_NOISE = 0.001

# Changes of shape coefficients between the visits, about four kilograms, and noise in metres.
_CHANGE_OF_SHAPE = {1: 0.4, 2: -0.3}
_VISIT_NOISE = 0.0005

# File, person, pose and, for visits, the date.
_FILES_OF_PEOPLE = (
    ("anna.ply", "anna", _STANDING, ""),
    ("ben.ply", "ben", _STANDING, ""),
    ("sit.ply", "felix", _SITTING, ""),
    ("stand.ply", "felix", _STANDING, ""),
    ("visit1.ply", "gina", _STANDING, "2026-03-02"),
    ("visit2.ply", "gina", {**_STANDING, "shoulder": ("xz", 6, -50)}, "2026-06-15"),
)
_SCANNED = ("anna", "ben")

_STRIDES = 4
_FRAMES_OF_STRIDE, _FRAMES_PER_SECOND = 66, 60
_STEPS, _FRAMES_BETWEEN_STEPS = 11, 6  # one stride
# Joint angles of a walk in degrees, at equal intervals of one stride of the left side, which begins
# when its heel touches the floor.
_HIP = (28, 24, 12, 0, -10, -2, 20, 30)
_KNEE = (6, 18, 12, 6, 12, 48, 60, 22)
_ANKLE = (0, 6, -4, -10, -6, 16, 4, 0)
_ARM = (-20, -15, 0, 14, 20, 15, 0, -14)


def write_example_files(folder: Path) -> dict[str, str]:
    """Fill a folder with example files; return a description of each for readers."""
    bodies = rh.datasets.load_open_bodies("coarse")
    betas = {
        name: np.asarray(bodies.betas)[bodies.subject == bodies.subject_names.index(subject)][0]
        for name, subject in PEOPLE.items()
    }
    rng = np.random.default_rng(0)
    _write_bodies(folder / "bodies", bodies)
    _write_scans(folder / "scans", betas, rng)
    _write_people(folder, betas, rng)
    walk = _walk(betas["anna"])
    walk.save(folder / "walk.bvh")
    walk.save(folder / "walk.npz")
    (run,) = rh.datasets.load_open_motions("coarse", "average man", "running_on_spot")
    run.save(folder / "run.bvh")
    (folder / "steps").mkdir()
    model = rh.datasets.load_open_model("full")
    for number in range(_STEPS):
        frame = number * _FRAMES_BETWEEN_STEPS
        points = model(walk.betas, walk.pose_vectors[frame]) + walk.translations[frame]
        points[:, 1] -= points[:, 1].min()
        rh.save_mesh(folder / "steps" / f"frame_{number:04d}.ply", points, model.faces)
    _write_other_mesh(folder / "other_mesh.ply", betas["david"], rng)
    contents = {
        "bodies/": "80 coarse registered bodies: eight people in ten poses, and labels.csv",
        "anna.ply, ben.ply": "two people in the same pose, registered",
        "sit.ply, stand.ply": "one person in two poses, registered",
        "scans/anna.ply, scans/ben.ply": "raw scans with a floor, noise and holes",
        "labels.csv, scans/labels.csv": "who is in which file: person, sex and date of the visit",
        "visit1.ply, visit2.ply": "one person before and after losing four kilograms",
        "walk.bvh, walk.npz": "a walk, as a recorded skeleton and in the layout of AMASS",
        "run.bvh": "another person, running on the spot",
        "steps/": f"the first stride of the walk, as {_STEPS} registered bodies",
        "other_mesh.ply": "a body whose mesh has different vertices and triangles",
    }
    lines = [
        "Simulated people, made with the open body model of riemhuman and in the public domain",
        "(CC0). Lengths are in metres; y points up.",
        "",
        *(f"{names:32}{text}" for names, text in contents.items()),
    ]
    write_text(folder / "README.txt", "\n".join(lines) + "\n")
    return contents


def _sex(person: str) -> str:
    return "woman" if PEOPLE[person].endswith("woman") else "man"


def _write_bodies(folder: Path, bodies: rh.datasets.Bodies) -> None:
    folder.mkdir()
    rows: list[Sequence[object]] = [("file", "subject", "pose", "sex")]
    for name, subject in PEOPLE.items():
        of_person = np.flatnonzero(bodies.subject == bodies.subject_names.index(subject))
        for number in of_person:
            pose = bodies.pose_names[bodies.pose[number]]
            file = folder / f"{name}_{pose}.ply"
            rh.save_mesh(file, bodies.points[number], bodies.template.faces)
            rows.append((file.name, name, pose, _sex(name)))
    write_text(folder / "labels.csv", csv_text(rows))


def _write_people(folder: Path, betas: Mapping[str, Array], rng: np.random.Generator) -> None:
    """Write single bodies, noisy ones for visits, and their table of labels."""
    model = rh.datasets.load_open_model("full")
    rows: list[Sequence[object]] = [("file", "person", "sex", "date")]
    shapes = dict(betas)
    for name, person, angles, day in _FILES_OF_PEOPLE:
        points = _on_the_floor(model, shapes[person], angles)
        if day:
            points += _VISIT_NOISE * rng.standard_normal(points.shape)
            shapes[person] = shapes[person].copy()  # until the next visit
            for number, change in _CHANGE_OF_SHAPE.items():
                shapes[person][number] += change
        rh.save_mesh(folder / name, points, model.faces)
        rows.append((name, person, _sex(person), day))
    write_text(folder / "labels.csv", csv_text(rows))


def _write_scans(folder: Path, betas: Mapping[str, Array], rng: np.random.Generator) -> None:
    folder.mkdir()
    model = rh.datasets.load_open_model("full")
    rows: list[Sequence[object]] = [("file", "person", "sex", "date")]
    for person in _SCANNED:
        rows.append((f"{person}.ply", person, _sex(person), ""))
        scan = rh.registration.simulated_scan(
            _on_the_floor(model, betas[person], _STANDING),
            model.faces,
            rng,
            n_points=_SCAN_POINTS,
            mesh=True,
            noise=_SCAN_NOISE,
            missing=_SCAN_HOLES,
        )
        assert scan.faces is not None
        points, triangles = _floor(rng)
        rh.save_mesh(
            folder / f"{person}.ply",
            np.concatenate([scan.points, points]),
            np.concatenate([scan.faces, triangles + len(scan.points)]),
        )
    write_text(folder / "labels.csv", csv_text(rows))


def _floor(rng: np.random.Generator) -> tuple[Points, Triangles]:
    """Return a square of floor around the origin as a mesh."""
    steps = np.arange(-_FLOOR_METRES, _FLOOR_METRES, _FLOOR_SPACING)
    n = len(steps)
    x, z = np.meshgrid(steps, steps, indexing="ij")
    points = np.stack([x, np.zeros_like(x), z], axis=-1).reshape(-1, 3)
    corners = np.arange(n * n).reshape(n, n)
    here, right = corners[:-1, :-1].ravel(), corners[1:, :-1].ravel()
    ahead, both = corners[:-1, 1:].ravel(), corners[1:, 1:].ravel()
    triangles = np.concatenate([np.c_[here, ahead, right], np.c_[right, ahead, both]])
    return points + _FLOOR_NOISE * rng.standard_normal(points.shape), triangles


def _write_other_mesh(file: Path, betas: Array, rng: np.random.Generator) -> None:
    model = rh.datasets.load_open_model("full")
    body = _on_the_floor(model, betas, _STANDING)
    remeshed = rh.registration.simulated_scan(
        body, model.faces, rng, n_points=_OTHER_POINTS, mesh=True, noise=0.0, rotate=False
    )
    assert remeshed.faces is not None
    rh.save_mesh(file, remeshed.points, remeshed.faces)


def _on_the_floor(model: rh.BodyModel, betas: Array, angles: Angles) -> Points:
    rotations = rh.datasets.joint_rotations(angles, model)
    points = model(betas, rh.datasets.pose_vectors(rotations, model))
    standing: Points = points - [0.0, points[:, 1].min(), 0.0]
    return standing


def _walk(betas: Array) -> rh.datasets.ArrayMotion:
    """Return a walk in which the foot that carries the body does not slide."""
    model = rh.datasets.load_open_model("coarse")
    phases = np.arange(_FRAMES_OF_STRIDE) / _FRAMES_OF_STRIDE
    stride = [
        rh.datasets.pose_vectors(rh.datasets.joint_rotations(angles, model), model)
        for angles in _strides(phases)
    ]
    poses = np.tile(np.stack(stride), (_STRIDES, 1, 1))
    joints = model.joints(betas, poses)
    left, right = (
        joints[:, model.joint_names.index(f"{side}_ankle")] for side in ("left", "right")
    )
    carries_left = np.tile(phases < 0.5, _STRIDES)[:, None]
    carrying = np.where(carries_left, left, right)
    carried_on = np.where(carries_left[:-1], left[1:], right[1:])
    translations = np.zeros((len(poses), 3))
    translations[1:] = np.cumsum(carrying[:-1] - carried_on, axis=0)
    translations[:, 1] = -model(betas, poses)[..., 1].min(axis=1)
    return rh.datasets.ArrayMotion(
        ("anna", "walk"), float(_FRAMES_PER_SECOND), model, betas, poses, translations
    )


def _strides(phases: Array) -> Iterator[Angles]:
    """Yield the joint angles of a walk at phases in strides."""
    angles = np.array([_HIP, _KNEE, _ANKLE, _ARM], dtype=np.float64).T
    closed = np.concatenate([angles, angles[:1]])
    curve = CubicSpline(np.linspace(0.0, 1.0, len(closed)), closed, bc_type="periodic")
    for sides in zip(curve(phases % 1.0), curve((phases + 0.5) % 1.0), strict=True):
        pose: dict[str, tuple[str, *tuple[float, ...]]] = {"pelvis": ("x", 3)}
        for side, sign, (hip, knee, ankle, arm) in zip(
            ("left", "right"), (1, -1), sides, strict=True
        ):
            pose[f"{side}_hip"] = ("zx", sign * 2, -hip)
            pose[f"{side}_knee"] = ("x", knee)
            pose[f"{side}_ankle"] = ("x", ankle)
            pose[f"{side}_shoulder"] = ("zx", sign * -75, -arm)
            pose[f"{side}_elbow"] = ("y", sign * -24)
        yield pose
