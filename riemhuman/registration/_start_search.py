"""The search over headings, start poses and up directions, which drops unlikely starts.

Start poses hold both arms alike, which people do not; and a hand that touches the body matches the
scan nearly as well when it and its forearm are rotated about themselves. So the arms of the best
body are tried in other ways afterwards.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from riemhuman.bodies import BodyModel, rotation_matrix
from riemhuman.datasets import joint_rotations, pose_vectors
from riemhuman.kernels.threads import mapped
from riemhuman.registration._fitting_steps import Prior, annealed
from riemhuman.registration._posed_body import ModelSamples, Pose, posed, rotation, sample_model
from riemhuman.registration._scan_points import thinned

_AXES = np.concatenate([np.eye(3), -np.eye(3)])
_UP = np.array([0.0, 1.0, 0.0])
_N_HEADINGS = 6

# What the likelihood gains where another arm is right, and more than it differs between fits.
_ARM_GAIN = 0.02

N_THREADS = 2
"""Bodies that are fitted at once."""


@dataclass(frozen=True)
class Round:
    """One round of the search."""

    n_model: int
    n_scan: int
    sigmas: tuple[float, float]
    n_steps: int
    n_best: int


ROUNDS = (
    Round(250, 400, (0.20, 0.09), 5, 24),
    Round(500, 800, (0.09, 0.04), 6, 6),
    Round(1000, 1500, (0.04, 0.015), 9, 3),
)
"""The rounds for a scan without a known start."""

ARM_ROUNDS = (Round(250, 400, (0.12, 0.05), 5, 4), Round(1000, 1500, (0.04, 0.015), 5, 1))
"""The rounds for a body with another arm."""

WARM_ROUNDS = (Round(500, 800, (0.08, 0.04), 5, 1), Round(1000, 1500, (0.03, 0.015), 4, 1))
"""The rounds from a known start."""


@dataclass(frozen=True)
class Candidate:
    """A body fitted from one start."""

    pose: Pose
    prior: Prior
    likelihood: float
    up: np.ndarray


class StartSearch:
    """The search over starts for one body model."""

    def __init__(self, model: BodyModel) -> None:
        self.model = model
        self._samples: dict[int | None, ModelSamples] = {}

    def samples(self, n_samples: int | None) -> ModelSamples:
        """Return points of the model, which are computed once."""
        if n_samples not in self._samples:
            self._samples[n_samples] = sample_model(self.model, n_samples)
        return self._samples[n_samples]

    @cached_property
    def poses(self) -> dict[str, np.ndarray]:
        """The start poses."""
        return start_poses(self.model)

    @cached_property
    def precisions(self) -> np.ndarray:
        """Inverse variances of the joints' turns from a start pose."""
        return joint_precisions(self.model)

    def run(
        self,
        points: np.ndarray,
        normals: np.ndarray,
        *,
        up: np.ndarray | None,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> list[Candidate]:
        """Return the bodies from the likeliest starts, the best first."""
        centre = points.mean(axis=0)
        first, *others = ROUNDS
        ups = _AXES if up is None else up[np.newaxis]
        if up is None:
            few = [name for name in FEW if name in self.poses] or list(self.poses)
            starts = [c for way in ups for c in self._starts(few, way, centre)]
            found = self._advanced(starts, first, points, normals, signed, landmarks)
            best = {tuple(each.up): each.likelihood for each in reversed(found)}
            ways = sorted(best, key=lambda way: -best[way])
            ups = np.array([way for way in ways[:2] if best[way] > best[ways[0]] - 0.15])
        starts = [c for way in ups for c in self._starts(list(self.poses), way, centre)]
        found = self._advanced(starts, first, points, normals, signed, landmarks)
        for each in others:
            found = self._advanced(found, each, points, normals, signed, landmarks)
        likeliest = found[0]
        for arm in arms_of(self.model):
            likeliest = self._with_likeliest_arm(likeliest, arm, points, normals, signed, landmarks)
        # Rivals still have the arms they had, so that likelihoods compare as they were.
        return [replace(likeliest, likelihood=found[0].likelihood), *found[1:]]

    def run_from(
        self,
        pose: Pose,
        up: np.ndarray,
        points: np.ndarray,
        normals: np.ndarray,
        *,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> Candidate:
        """Return the body from one known start."""
        found = [Candidate(pose, Prior(pose.local, self.precisions, pose.betas, 4.0), -np.inf, up)]
        for each in WARM_ROUNDS:
            found = self._advanced(found, each, points, normals, signed, landmarks)
        return found[0]

    def likelihood(self, pose: Pose, points: np.ndarray, normals: np.ndarray) -> float:
        """Return the mean log-likelihood of a scan with the last deviation of the last round."""
        last = ROUNDS[-1]
        prior = Prior(pose.local, self.precisions, pose.betas, 1.0)
        each = Round(last.n_model, last.n_scan, (last.sigmas[1], last.sigmas[1]), 0, 1)
        up = np.zeros(3)
        candidate = Candidate(pose, prior, -np.inf, up)
        return self._advanced([candidate], each, points, normals, True, {})[0].likelihood

    def _starts(self, names: list[str], up: np.ndarray, centre: np.ndarray) -> list[Candidate]:
        body = self.samples(ROUNDS[0].n_model)
        root = int(np.flatnonzero(self.model.parents < 0)[0])
        upright = _turn_between(_UP, up)
        betas = np.zeros(self.model.n_betas)
        starts = []
        for name in names:
            for angle in np.arange(_N_HEADINGS) * (2.0 * np.pi / _N_HEADINGS):
                local = self.poses[name].copy()
                local[root] = upright @ rotation(angle * _UP) @ local[root]
                pose = Pose(local, betas, np.zeros(3))
                shift = centre - body.areas @ posed(body, pose)[0]
                prior = Prior(self.poses[name], self.precisions, betas, 1.0)
                starts.append(Candidate(Pose(local, betas, shift), prior, -np.inf, up))
        return starts

    def _with_likeliest_arm(
        self,
        body: Candidate,
        arm: np.ndarray,
        points: np.ndarray,
        normals: np.ndarray,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> Candidate:
        """Return a body with one arm as a start pose holds it if that is likelier, or as it is."""
        first, last = ARM_ROUNDS
        others = []
        for turns in other_arms(arm, body.prior.local, self.poses):
            local, expected = body.pose.local.copy(), body.prior.local.copy()
            local[arm] = expected[arm] = turns
            pose, prior = body.pose._replace(local=local), body.prior._replace(local=expected)
            others.append(replace(body, pose=pose, prior=prior))
        others = self._advanced(others, first, points, normals, signed, landmarks)
        (other,) = self._advanced(others, last, points, normals, signed, landmarks)
        (own,) = self._advanced([body], last, points, normals, signed, landmarks)
        return other if other.likelihood > own.likelihood + _ARM_GAIN else body

    def _advanced(
        self,
        candidates: list[Candidate],
        each: Round,
        points: np.ndarray,
        normals: np.ndarray,
        signed: bool,
        landmarks: dict[int, np.ndarray],
    ) -> list[Candidate]:
        body = self.samples(each.n_model)
        chosen = thinned(points, each.n_scan, np.random.default_rng(0))
        scan = points[chosen].astype(np.float32)
        scan_normals = normals[chosen].astype(np.float32)
        known = np.full((len(body.areas), 3), np.nan)
        n_vertices = len(body.areas) - self.model.n_joints
        for joint, place in landmarks.items():
            known[n_vertices + joint] = place
        # The likelihood is that before the last step, so one more step is needed.
        sigmas = np.append(np.geomspace(*each.sigmas, each.n_steps), each.sigmas[1])

        def advance(candidate: Candidate) -> Candidate:
            pose, likelihood = annealed(
                body, candidate.pose, candidate.prior, scan, scan_normals, sigmas, signed, known
            )
            return Candidate(pose, candidate.prior, likelihood, candidate.up)

        found = list(mapped(advance, candidates, N_THREADS))
        found.sort(key=lambda candidate: -candidate.likelihood)
        return _different(found, body)[: each.n_best]


def _different(candidates: list[Candidate], body: ModelSamples) -> list[Candidate]:
    """Return candidates without those that are close to a better one."""
    kept: list[Candidate] = []
    places: list[np.ndarray] = []
    for candidate in candidates:
        points = posed(body, candidate.pose)[0]
        if all(np.sqrt(np.mean((points - other) ** 2) * 3) > 0.03 for other in places):
            kept.append(candidate)
            places.append(points)
    return kept


def _turn_between(start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the shortest rotation from one unit vector to another."""
    axis = np.cross(start, end)
    sine, cosine = np.linalg.norm(axis), start @ end
    if sine < 1e-9:
        return np.eye(3) if cosine > 0 else np.diag([1.0, -1.0, -1.0])
    vector: np.ndarray = axis * (np.arctan2(sine, cosine) / sine)
    return rotation(vector)


# Axes and degrees of joints from the T-pose, as for `riemhuman.datasets.joint_rotations`.
_Angles = dict[str, tuple[Any, ...]]

_DOWN: _Angles = {"shoulder": ("xz", 10, -78), "elbow": ("y", -10), "hip": ("z", 3)}
_A: _Angles = {"shoulder": ("xz", 10, -50), "elbow": ("y", -18), "hip": ("z", 6)}
_WALK: _Angles = {
    "left_hip": ("x", -32),
    "left_knee": ("x", 15),
    "right_hip": ("x", 22),
    "right_knee": ("x", 28),
    "left_shoulder": ("zx", -74, 28),
    "right_shoulder": ("zx", 74, -28),
    "left_elbow": ("y", -30),
    "right_elbow": ("y", 30),
}
_KNEE: _Angles = {**_A, "left_hip": ("x", -85), "left_knee": ("x", 85)}
_ONE_ARM: _Angles = {**_DOWN, "right_shoulder": ("z", -55), "right_elbow": ("y", 15)}

_START_POSES: dict[str, _Angles] = {
    "a": _A,
    "down": _DOWN,
    "t": {"shoulder": ("z", -5), "hip": ("z", 6)},
    "up": {"collar": ("z", 15), "shoulder": ("z", 55), "elbow": ("y", -15)},
    "forward": {"collar": ("y", -8), "shoulder": ("y", -75), "elbow": ("y", -10)},
    "elbows": {"shoulder": ("xz", 10, -70), "elbow": ("y", -95)},
    "hips": {"shoulder": ("xyz", 45, 15, -45), "elbow": ("y", -95), "hip": ("z", 7)},
    "head": {"shoulder": ("xz", -60, 25), "elbow": ("y", -115)},
    "guard": {"shoulder": ("xzy", 0, -55, -35), "elbow": ("y", -130)},
    "walk": _WALK,
    "knee": _KNEE,
    "one_arm": _ONE_ARM,
    "squat": {
        "pelvis": ("x", 20),
        "hip": ("zx", 10, -85),
        "knee": ("x", 90),
        "shoulder": ("xzy", 0, -10, -60),
    },
    "bend": {
        "pelvis": ("x", 35),
        "lower_spine": ("x", 15),
        "middle_spine": ("x", 12),
        "hip": ("x", -40),
        "shoulder": ("xzy", 0, -50, -40),
    },
    "sit": {"hip": ("x", -85), "knee": ("x", 85), **{k: _DOWN[k] for k in ("shoulder", "elbow")}},
    "wide": {"shoulder": ("z", 20), "hip": ("z", 22)},
    "lunge": {**_WALK, "left_hip": ("x", -75), "left_knee": ("x", 75), "right_knee": ("x", 20)},
}
_SIDED = ("walk", "knee", "one_arm", "lunge")

FEW = ("a", "t", "up", "knee", "squat")
"""The poses by which the direction up is found."""

# The first joints of SMPL, SMPL-H and SMPL-X by the names of the open model, and their parents.
_SMPL_TREE = {
    "pelvis": -1,
    "left_hip": 0,
    "right_hip": 0,
    "lower_spine": 0,
    "left_knee": 1,
    "right_knee": 2,
    "middle_spine": 3,
    "left_ankle": 4,
    "right_ankle": 5,
    "upper_spine": 6,
    "left_toes": 7,
    "right_toes": 8,
    "neck": 9,
    "left_collar": 9,
    "right_collar": 9,
    "head": 12,
    "left_shoulder": 13,
    "right_shoulder": 14,
    "left_elbow": 16,
    "right_elbow": 17,
    "left_wrist": 18,
    "right_wrist": 19,
}

# Standard deviations of joints from a start pose, degrees.
_DEGREES = {
    "spine": 10.0,
    "chest": 8.0,
    "neck": 12.0,
    "head": 15.0,
    "collar": 10.0,
    "shoulder": 45.0,
    "elbow": 45.0,
    "wrist": 20.0,
    "hip": 40.0,
    "knee": 40.0,
    "ankle": 15.0,
    "toes": 12.0,
}
_OTHER_DEGREES = 15.0


def joint_names(model: BodyModel) -> tuple[str, ...]:
    """Return the names of a model's joints; those of SMPL's tree are named as in the open model."""
    if "left_shoulder" in model.joint_names:
        return model.joint_names
    if model.parents[: len(_SMPL_TREE)].tolist() == list(_SMPL_TREE.values()):
        return (*_SMPL_TREE, *model.joint_names[len(_SMPL_TREE) :])
    return model.joint_names


def start_poses(model: BodyModel) -> dict[str, np.ndarray]:
    """Return the poses to start from, as rotations of the joints."""
    names = joint_names(model)
    if "left_shoulder" not in names:
        return {"rest": np.tile(np.eye(3), (model.n_joints, 1, 1))}
    if names != model.joint_names:
        model = _renamed(model, names)
    written = dict(_START_POSES)
    for name in _SIDED:
        written[f"{name}_right"] = _mirrored(_START_POSES[name])
    poses = {}
    for name, angles in written.items():
        known = {joint: own for joint, own in angles.items() if _has(names, joint)}
        vectors = pose_vectors(joint_rotations(known, model), model)
        poses[name] = np.ascontiguousarray(rotation_matrix(vectors))
    return poses


def joint_precisions(model: BodyModel) -> np.ndarray:
    """Return inverse variances of the joints' turns from a start pose, 0 for the root."""
    degrees = [
        _DEGREES.get(name.removeprefix("left_").removeprefix("right_").split("_")[-1])
        for name in joint_names(model)
    ]
    deviations = np.radians([_OTHER_DEGREES if each is None else each for each in degrees])
    return np.where(model.parents < 0, 0.0, deviations**-2.0)


def _has(names: tuple[str, ...], joint: str) -> bool:
    return joint in names or f"left_{joint}" in names


def _mirrored(angles: _Angles) -> _Angles:
    """Return angles with left and right exchanged."""
    swapped: _Angles = {}
    for name, (axes, *degrees) in angles.items():
        side, _, joint = name.partition("_")
        if side in ("left", "right"):
            other = f"{'right' if side == 'left' else 'left'}_{joint}"
            turned = [a if axis == "x" else -a for axis, a in zip(axes, degrees, strict=True)]
            swapped[other] = (axes, *turned)
        else:
            swapped[name] = (axes, *degrees)
    return swapped


def _renamed(model: BodyModel, names: tuple[str, ...]) -> BodyModel:
    return BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs,
        model.joint_regressor,
        model.weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        joint_names=names,
    )


_JOINTS = ("collar", "shoulder", "elbow", "wrist")
# Arms whose rotations differ by less are alike.
_ALIKE = 0.05
_TURNS = np.radians(60.0 * np.arange(6))


def arms_of(model: BodyModel) -> list[np.ndarray]:
    """Return the joints of each arm, from the collar to the wrist."""
    names = joint_names(model)
    arms = [[f"{side}_{joint}" for joint in _JOINTS] for side in ("left", "right")]
    return [np.array([names.index(name) for name in arm]) for arm in arms if {*arm} <= {*names}]


def other_arms(
    arm: np.ndarray, own: np.ndarray, poses: dict[str, np.ndarray]
) -> Iterator[np.ndarray]:
    """Yield the rotations of an arm's joints in some poses, without those that are alike."""
    seen = [own[arm]]
    for pose in poses.values():
        if all(np.abs(pose[arm] - other).max() > _ALIKE for other in seen):
            seen.append(pose[arm])
            yield pose[arm]


def turned_forearms(pose: Pose, arm: np.ndarray, rest_joints: np.ndarray) -> Iterator[Pose]:
    """Yield a pose with one hand straight, and its forearm turned by sixths of a circle."""
    *_, elbow, wrist = arm
    forearm = rest_joints[wrist] - rest_joints[elbow]
    for angle in _TURNS:
        local = pose.local.copy()
        local[elbow] = local[elbow] @ rotation(angle * forearm / np.linalg.norm(forearm))
        local[wrist] = np.eye(3)
        yield pose._replace(local=local)
