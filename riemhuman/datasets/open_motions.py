"""The open motions: ten people in fourteen motions, computed from the open body model."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Integers
from riemhuman.bodies import BodyModel
from riemhuman.bodies.open_model import load_open_model
from riemhuman.checks import checked, checked_rate
from riemhuman.datasets.open_poses import Curve, pose_vectors, read_table, with_both_sides
from riemhuman.mocap.motions import ModelMotion, Motions, choose_names

# Largest deviations of a performance from the defined motion.
_TEMPO = 0.07
_START = 0.1  # of a cycle
_AMPLITUDE = 0.06  # each joint's, about its mean angle
_LAG = 0.015  # each joint's, of a cycle
_HABIT_DEGREES = 2.5  # each angle's
_SEED = 2022


class _JointCurves(NamedTuple):
    """How a person moves a joint: angles in degrees, about axes, over a cycle."""

    axes: str
    curves: Sequence[Curve]
    delay: float  # of a cycle
    amplitude: float  # as a factor, about the mean of each curve
    habit: Array  # degrees, added to each angle


class OpenMotion(ModelMotion):
    """An open motion, with a person's own tempo, start, amplitudes and habits."""

    def __init__(
        self, subject: str, sequence: str, model: BodyModel, frames_per_second: float
    ) -> None:
        table = read_table("open_motions")
        person_number = list(table["people"]).index(subject)
        motion_number = list(table["motions"]).index(sequence)
        rng = np.random.default_rng([_SEED, person_number, motion_number])
        definition = table["motions"][sequence]
        self._definition = definition
        self._cycle = definition["seconds"] * (1.0 + rng.uniform(-_TEMPO, _TEMPO))
        self._start = rng.uniform(-_START, _START)
        self._joints: dict[str, _JointCurves] = {}
        angles = with_both_sides(definition["angles"], model.joint_names)
        for joint, (axes, *curves) in angles.items():
            # The right joints of an alternating motion follow half a cycle later.
            follows = joint.startswith("right_") and joint not in definition["angles"]
            delay = 0.5 if definition["alternating"] and follows else 0.0
            delay += rng.uniform(-_LAG, _LAG)
            amplitude = 1.0 + rng.uniform(-_AMPLITUDE, _AMPLITUDE)
            habit = rng.uniform(-_HABIT_DEGREES, _HABIT_DEGREES, len(axes))
            self._joints[joint] = _JointCurves(axes, curves, delay, amplitude, habit)
        n_frames = int(self._cycle * definition["cycles"] * frames_per_second) + 1
        super().__init__(subject, sequence, frames_per_second, n_frames, model)

    @property
    def betas(self) -> Array:
        return np.array(read_table("open_motions")["people"][self.subject])

    def _parameters(self, numbers: Integers) -> tuple[Array, Array]:
        poses, translations = self._performance
        return poses[numbers], translations[numbers]

    @cached_property
    def _performance(self) -> tuple[Array, Array]:
        times = np.arange(len(self)) / self.frames_per_second
        poses = pose_vectors(self.joint_rotations(times), self.model)
        names = self.model.joint_names
        feet = [name.endswith(("ankle", "toes")) for name in names]
        standing = [names.index(f"{side}_ankle") for side in self._definition["standing_on"]]
        rest = self.model.joints(self.betas)
        moved = rest - self.model.joints(self.betas, poses)
        translations = np.zeros((len(self), 3))
        if standing:
            translations[:] = moved[:, standing].mean(axis=1)
        height = _values(self._definition["height"], times / self._cycle + self._start)
        translations[:, 1] = moved[:, feet, 1].max(axis=1) + height
        return poses, translations

    def joint_rotations(self, times: Array) -> Array:
        """Return the rotations of all joints from the T-pose at any times, (n, J, 3, 3)."""
        rotations = np.tile(np.eye(3), (len(times), self.model.n_joints, 1, 1))
        phases = times / self._cycle + self._start
        for joint, moves in self._joints.items():
            joint_phases = phases - moves.delay
            angles = np.stack([_values(curve, joint_phases) for curve in moves.curves], axis=-1)
            means = np.array([np.mean(curve) for curve in moves.curves])
            angles = means + moves.amplitude * (angles - means) + moves.habit
            matrices = Rotation.from_euler(moves.axes, angles, degrees=True).as_matrix()
            rotations[:, self.model.joint_names.index(joint)] = matrices
        return rotations


@checked(frames_per_second=checked_rate)
def load_open_motions(
    resolution: str = "full",
    subjects: Sequence[str] | str | None = None,
    sequences: Sequence[str] | str | None = None,
    frames_per_second: float = 60,
) -> Motions[OpenMotion]:
    """Return the open motions: ten people in fourteen motions of a few seconds each.

    The motions resemble those of Dynamic FAUST and have their names; they are defined by joint
    angles over a cycle (data/open_motions.json). Every person performs them with a slightly
    different tempo, start, amplitude and habit. The five women and five men are not those of
    `load_open_bodies`, so a basis learned from these motions can be tested on other people there.
    All calls return the same motions, and both resolutions show the same performances: all motions
    of the first person, then of the second, and so on. Frames are computed on access.

    Parameters
    ----------
    resolution : {"full", "coarse"}
        See `load_open_model`.
    subjects, sequences : sequence of str or str, optional
        Names of the people and of the motions; by default all.
    frames_per_second : float

    Examples
    --------
    >>> len(rh.datasets.load_open_motions("coarse", sequences=["knees", "punching"]))
    20
    """
    table = read_table("open_motions")
    people = choose_names(subjects, "subjects", tuple(table["people"]))
    names = choose_names(sequences, "sequences", tuple(table["motions"]))
    model = load_open_model(resolution)
    return Motions(
        OpenMotion(person, name, model, frames_per_second) for person in people for name in names
    )


def _values(curve: Curve, phases: Array) -> Array:
    """Return a curve at phases in cycles: periodic, smooth, and within its given values."""
    from scipy.interpolate import PchipInterpolator  # takes long to import

    values = np.atleast_1d(np.asarray(curve, dtype=np.float64))
    # The slope at a value depends on the two values beside it.
    numbers = np.arange(-2, len(values) + 3)
    periodic = PchipInterpolator(numbers / len(values), values[numbers % len(values)])
    at_phases: Array = periodic(phases % 1.0)
    return at_phases
