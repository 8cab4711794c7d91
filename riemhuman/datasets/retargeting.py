"""Motion capture performed by bodies: recordings of skeletons become poses of a body model.

A recording goes through these stages, each in a module of its own:

- joints are recognised by name, or by the shape of the tree (`_joint_names`, `_joint_tree`);
- the axis that points up is found, and when feet stand (`_upward`, `_recorded_skeletons`);
- the axes of joints are found from positions, whatever the axes of the file (`_joint_axes`);
- limbs, trunk and neck follow the recorded directions (`_limbs`);
- the body moves so that standing feet are where they were recorded, and limbs leave the recorded
  directions by a few degrees so that feet that stand still stay in place; nothing is more than 5 mm
  below the floor (`_standing`).

Lengths are scaled by those of the legs, or the body is (`_units`, `_body_size`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray

from riemhuman.bodies import BodyModel
from riemhuman.checks import one_of, real_array, refuse_type
from riemhuman.datasets._body_size import own_person, recorded_person, scaled_model
from riemhuman.datasets._joint_axes import Figure, make_figure, mean_axes
from riemhuman.datasets._joint_names import BONES, LIMBS, find_joints, model_joints
from riemhuman.datasets._limbs import follow
from riemhuman.datasets._recorded_skeletons import RecordedSkeleton, read_skeleton
from riemhuman.datasets._skeletons import (
    body_frame,
    bone,
    bones,
    check_bones,
    leg_length,
    middle,
    trunk,
)
from riemhuman.datasets._standing import Performance, stand
from riemhuman.datasets._units import guessed_unit, metres_in
from riemhuman.datasets.bvh import SkeletonMotion, nearest_frames
from riemhuman.datasets.motions import ModelMotion
from riemhuman.datasets.open_bodies import load_open_model
from riemhuman.kernels.rotations import log, transpose
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.representation import Record
from riemhuman.surfaces.procrustes import AXES

_RECORDED = "recorded"
_SCALES = ("adult", _RECORDED)
# Lines across the body that are compared with the recorded ones, besides bones.
_LINES = (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"))
_NECK = ("neck", "head")
_PARTS = ("pelvis", "chest", "head")
# Means over the frames that are warned of, degrees and metres.
_MOST_DEGREES, _MOST_METRES = 15.0, 0.07
# Coefficients of the same person, found twice, differ by less.
_SAME_BETAS = 1e-5
# Mean cosine of feet to the front of the body that says that they point backward.
_BACKWARD = 0.3


@dataclass(frozen=True, eq=False, repr=False)
class RetargetingErrors(Record):
    """How far a retargeted motion is from its recording.

    Attributes
    ----------
    bones : tuple of (str, str)
        Joints at the ends of the B bones and lines: upper arms, forearms, thighs and shanks; the
        trunk, from the middle of the hips to the middle of the shoulders; the lines of hips and
        shoulders; and the neck, if both have one.
    directions : array, shape (n_frames, B)
        Angles between the bone or line and the recorded one, degrees.
    joints : tuple of str
        Names of the K joints of the limbs.
    positions : array, shape (n_frames, K)
        Distances from the recorded joints, metres, both relative to the middle of the hips.
    parts : tuple of str
        Parts whose rotations are compared: "pelvis", "chest" and "head", if there is one.
    rotations : array, shape (n_frames, P)
        Angles of the rotations of pelvis and chest to those that the positions of hips and
        shoulders show, degrees; and of the head to the recorded one, which looks ahead in the mean.
    scale : float
        Metres in the unit of the recording: lengths of the recording were multiplied by it.

    Examples
    --------
    >>> rh.datasets.retarget(recording).errors.positions.max()  # doctest: +SKIP
    """

    bones: tuple[tuple[str, str], ...]
    directions: ndarray
    joints: tuple[str, ...]
    positions: ndarray
    parts: tuple[str, ...]
    rotations: ndarray
    scale: float


class _Played(NamedTuple):
    """What a person does: pose vectors and translations, and how far from the recording."""

    poses: ndarray
    translations: ndarray
    errors: RetargetingErrors


class RetargetedMotion(ModelMotion):
    """A recording performed by a person of a body model, from `retarget`.

    Frame i is ``model(betas, pose_vectors[i], translations[i])``: metres, y up, on a floor at
    height 0.

    Parameters
    ----------
    recording : SkeletonMotion, or function that returns it
    model : BodyModel
        As for `retarget`.
    names : (str, str)
        Of the person and of the motion.
    frames_per_second, n_frames
        As for `retarget`.
    betas : array, shape (B,), optional
        Shape coefficients of the person; by default zeros.
    joints : mapping of str to int, optional
        Numbers of joints in the recording by names of the open model.
    up : str, or function that returns it, optional
        As for `retarget`.
    size : float
        Bodies of the model are larger by this factor.

    Attributes
    ----------
    message : str
        What was assumed about lengths: the person, and the unit of the recording.

    Examples
    --------
    >>> jump = rh.datasets.retarget(rh.datasets.load_bvh("jump.bvh"))  # doctest: +SKIP
    >>> other = jump.performed_by(-jump.betas)  # doctest: +SKIP
    """

    def __init__(
        self,
        recording: SkeletonMotion | Callable[[], SkeletonMotion],
        model: BodyModel,
        names: tuple[str, str],
        frames_per_second: float,
        n_frames: int,
        *,
        betas: ndarray | None = None,
        joints: Mapping[str, int] | None = None,
        up: str | Callable[[], str] | None = None,
        size: float = 1.0,
    ) -> None:
        performer = model if size == 1.0 else scaled_model(model, size)
        super().__init__(*names, frames_per_second, n_frames, performer)
        self._recording, self._joints, self._up = recording, joints, up
        self._betas = np.zeros(model.n_betas) if betas is None else betas
        self._unscaled, self._size = model, size

    @property
    def recording(self) -> SkeletonMotion:
        """The recorded skeleton."""
        recording = self._recording
        return recording if isinstance(recording, SkeletonMotion) else recording()

    @property
    def betas(self) -> ndarray:
        return self._betas

    @property
    def errors(self) -> RetargetingErrors:
        """How far the motion is from the recording."""
        return self._played.errors

    @property
    def message(self) -> str:
        """What was done with the lengths of the recording."""
        scale, person = (
            self.errors.scale,
            "an average adult" if not self.betas.any() else "a person",
        )
        if self._size == 1.0:
            return (
                f"The recording was scaled to the legs of {person} of the model: a unit of the "
                f"recording is {scale:.4g} m. Pass scale='recorded' to keep recorded lengths"
            )
        return (
            f"Recorded lengths were kept, a unit of the recording is {scale:.4g} m: bodies of the "
            f"model were scaled by {self._size:.3f}, so that {person} has the recorded legs"
        )

    def performed_by(self, betas: Any) -> RetargetedMotion:
        """Return the motion of another person, who does the same in his or her proportions.

        Parameters
        ----------
        betas : array_like, shape (B,)
        """
        other = copy(self)
        other.__dict__.pop("_played", None)
        other._betas = real_array(betas, "betas", (self.model.n_betas,), batched=False)
        other.model, other._size = self._unscaled, 1.0
        return other

    def _parameters(self, numbers: ndarray) -> tuple[ndarray, ndarray]:
        return self._played.poses[numbers], self._played.translations[numbers]

    @cached_property
    def _played(self) -> _Played:
        recording = self.recording
        figure = make_figure(self.model, self.betas)
        up = self._up() if callable(self._up) else self._up
        own = own_person(recording, self.model) if up in (None, "y") else None
        if own is not None and np.allclose(own.betas, self.betas, rtol=0.0, atol=_SAME_BETAS):
            source = read_skeleton(recording, self._joints, "y")
            chosen = recording.global_rotations[:, own.joints]
            positions = own.metres * recording.positions[:, own.joints]
            performance, scale = Performance(chosen, positions), own.metres
        else:
            source = read_skeleton(recording, self._joints, up)
            scale = figure.leg / source.leg
            performance = stand(source, figure, follow(source, figure, scale), scale)
        errors = _errors(source, figure, performance, scale)
        misplaced = _misplaced(source, figure, performance)
        _warn_of_errors(recording.name, source, errors, misplaced)
        return _Played(*_model_parameters(figure, performance), errors)


def retarget(
    recording: SkeletonMotion,
    model: BodyModel | None = None,
    *,
    betas: Any = None,
    joints: Mapping[str, str] | None = None,
    up: str | None = None,
    unit: str | float | None = None,
    scale: str | None = None,
    frames_per_second: float | None = None,
) -> RetargetedMotion:
    """Return the motion of a body that does what a recorded skeleton does.

    Rest poses, axes, units and proportions of the recording may be any: axes of joints are found
    from the positions of joints over the frames, so that what positions do not tell, such as how
    far the head is lowered, is measured from its mean. Limbs follow the recorded directions within
    3.8 degrees, the trunk almost exactly; feet are level while they stand still, stay in place, and
    nothing sinks by more than 5 mm. A warning says if pelvis, chest, head, a bone or a line is off
    by more than 15 degrees, or a joint by more than 7 cm, in the mean.

    A recording of the model's own skeleton, as `Motion.save` writes it, is played as it is, by the
    person whose bones it has.

    Parameters
    ----------
    recording : SkeletonMotion
        Recorded skeleton, from `load_bvh`, with hips, knees, ankles, shoulders, elbows and wrists.
    model : BodyModel, optional
        Model with named joints, or with those of SMPL; by default the open model, "coarse".
    betas : array_like, shape (B,), or "recorded", optional
        Shape coefficients of the person; by default zeros, an average adult. "recorded" is a person
        whose bones have the recorded lengths. Those do not tell the body shape, and makers place
        joints differently: girths and mass may not belong to any real person.
    joints : mapping of str to str, optional
        Names of joints in the recording by those of the open model, such as
        ``{"left_hip": "LeftUpLeg"}``, where they are not recognised. Where names do not tell, the
        shape of the skeleton does, with a warning that lists the joints.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis of the recording that points up; by default it is found, with a warning where people
        may as well lie on the floor as stand along another axis.
    unit : str or number, optional
        Unit of the recording's lengths: "m", "cm", "mm", "inch", "foot", in words or abbreviated,
        or the metres in one. By default that of the recording, if it is known.
    scale : {"adult", "recorded"}, optional
        Whether the recording is scaled to the legs of the person ("adult"), or the person to the
        recorded legs: a child, an adult and a giant keep their lengths. By default "recorded" if
        the unit is given to `retarget` or the reader, or the file names it, else "adult". Without
        a unit, "recorded" takes the one in which legs are most like an adult's, with a warning.
    frames_per_second : float, optional
        Frame rate, at most that of the recording: the frames nearest in time are used.

    Examples
    --------
    >>> jump = rh.datasets.retarget(rh.datasets.load_bvh("jump.bvh"))  # doctest: +SKIP
    """
    if not isinstance(recording, SkeletonMotion):
        refuse_type(recording, "recording", "a SkeletonMotion")
    model = load_open_model("coarse") if model is None else model
    if not isinstance(model, BodyModel):
        refuse_type(model, "model", "a BodyModel")
    if not (betas is None or isinstance(betas, str)):
        betas = real_array(betas, "betas", (model.n_betas,), batched=False)
    elif betas is not None:
        one_of(betas, "betas", (_RECORDED,))
    if up is not None:
        one_of(up, "up", AXES)
    if scale is not None:
        one_of(scale, "scale", _SCALES)
    unit = recording.unit if unit is None else unit
    metres = None if unit is None else metres_in(unit)
    model_joints(model)
    rate = recording.frames_per_second
    if frames_per_second is not None:
        rate = float(frames_per_second)
        recording = _thinned(recording, rate)
    found = find_joints(recording.joint_names, recording.parents, joints, recording.positions)
    check_bones(recording.positions, found, recording.joint_names)
    is_recorded = scale == _RECORDED or (scale is None and metres is not None)
    own, size = own_person(recording, model), 1.0
    if own is not None and (betas is None or isinstance(betas, str)):
        betas, size, is_recorded = own.betas, own.size, False
    elif isinstance(betas, str):
        betas = recorded_person(recording.positions, found, model)
    if is_recorded:
        leg = leg_length(recording.positions, found)
        if metres is None:
            metres = _guessed_metres(leg, recording)
        person = np.zeros(model.n_betas) if betas is None else betas
        size = metres * leg / make_figure(model, person).leg
    names, n_frames = ("", recording.name), len(recording)
    return RetargetedMotion(
        recording, model, names, rate, n_frames, betas=betas, joints=found, up=up, size=size
    )


def _thinned(recording: SkeletonMotion, rate: float) -> SkeletonMotion:
    """Return a recording at a lower frame rate."""
    frames = nearest_frames(len(recording), recording.frames_per_second, rate)
    return replace(
        recording,
        rotations=recording.rotations[frames],
        translations=recording.translations[frames],
        frames_per_second=rate,
    )


def _guessed_metres(leg: float, recording: SkeletonMotion) -> float:
    """Return the metres in the unit of a recording, with a warning."""
    name, metres = guessed_unit(leg, recording.joint_names)
    warnings.warn(
        f"{recording.name or 'recording'}: lengths were taken to be in {name}, in which legs are "
        f"{metres * leg:.2f} m long; pass unit= if they are not",
        stacklevel=3,
    )
    return metres


def _model_parameters(figure: Figure, performance: Performance) -> tuple[ndarray, ndarray]:
    """Return the pose vectors and the translations of a performance."""
    parents, rotations = figure.model.parents, performance.rotations
    local = rotations.copy()
    limbs = np.flatnonzero(parents >= 0)
    local[:, limbs] = transpose(rotations[:, parents[limbs]]) @ rotations[:, limbs]
    root = figure.model.joint_order[0]
    return log(np.eye(3), local), performance.positions[:, root] - figure.rest[root]


def _errors(
    source: RecordedSkeleton, figure: Figure, performance: Performance, scale: float
) -> RetargetingErrors:
    """Return directions, positions and rotations beside those recorded."""
    pairs = (*BONES, *_LINES)
    if all({*_NECK} <= skeleton.joints.keys() for skeleton in (source, figure)):
        pairs = (*pairs, _NECK)
    names = tuple(name for limb in LIMBS for name in limb)
    made, made_places = _bones_and_places(performance.positions, figure.joints, pairs, names)
    shown, shown_places = _bones_and_places(source.positions, source.joints, pairs, names)
    sines = np.linalg.norm(np.cross(made, shown), axis=-1)
    angles = np.degrees(np.arctan2(sines, np.sum(made * shown, axis=-1)))
    # The trunk is the last of `bones`, and comes after the limbs in the errors.
    order = [*range(len(BONES)), len(pairs), *range(len(BONES), len(pairs))]
    labels = (*BONES, ("hips", "shoulders"), *pairs[len(BONES) :])
    apart = np.linalg.norm(made_places - scale * shown_places, axis=-1)
    parts, rotations = _part_errors(source, figure, performance)
    return RetargetingErrors(labels, angles[:, order], names, apart, parts, rotations, scale)


def _bones_and_places(
    positions: ndarray,
    joints: Mapping[str, int],
    pairs: Sequence[tuple[str, str]],
    names: Sequence[str],
) -> tuple[ndarray, ndarray]:
    """Return vectors between joints, and the places of joints relative to the hips."""
    places = positions[:, [joints[name] for name in names]]
    return bones(positions, joints, pairs), places - middle(positions, joints, "hip")[:, None]


def _part_errors(
    source: RecordedSkeleton, figure: Figure, performance: Performance
) -> tuple[tuple[str, ...], ndarray]:
    """Return the parts of the trunk, and the angles of their rotations to the recorded ones."""
    angles = []
    for line in ("hip", "shoulder"):
        made = body_frame(performance.positions, figure.joints, line)
        angles.append(_angles(made, body_frame(source.positions, source.joints, line)))
    if not all("head" in joints for joints in (source.joints, figure.joints)):
        return _PARTS[:2], np.stack(angles, axis=1)
    made = performance.rotations[:, figure.joints["head"]]
    shown = source.rotation("head")
    axes = mean_axes(shown, made, source.kept)
    return _PARTS, np.stack([*angles, _angles(made, shown @ axes)], axis=1)


def _angles(first: ndarray, second: ndarray) -> ndarray:
    """Return the angles between rotations, degrees."""
    return np.degrees(np.linalg.norm(log(first, second), axis=-1))


def _misplaced(source: RecordedSkeleton, figure: Figure, performance: Performance) -> ndarray:
    """Return how far joints are from where recorded directions lead with the figure's bones."""
    joints = figure.joints
    hips = middle(performance.positions, joints, "hip")
    back = unit(trunk(source.positions, source.joints))
    shoulders = hips + np.linalg.norm(trunk(figure.rest, joints)) * back
    distances = []
    for limb in LIMBS:
        side, part = limb[0].split("_")
        sign = 0.5 if side == "left" else -0.5
        line = unit(bone(source.positions, source.joints, f"right_{part}", f"left_{part}"))
        width = np.linalg.norm(figure.bone(f"right_{part}", f"left_{part}"))
        place = (hips if part == "hip" else shoulders) + sign * width * line
        for pair in ((), limb[:2], limb[1:]):
            if pair:
                direction = unit(bone(source.positions, source.joints, *pair))
                place = place + np.linalg.norm(figure.bone(*pair)) * direction
            name = pair[1] if pair else limb[0]
            apart = performance.positions[:, joints[name]] - place
            distances.append(np.linalg.norm(apart, axis=1))
    return np.stack(distances, axis=1)


def _feet_point_backward(source: RecordedSkeleton) -> bool:
    """Return whether the toes are behind the ankles of a body with these sides."""
    forward = body_frame(source.positions, source.joints, "hip")[..., 2]
    feet = [
        np.sum(unit(bone(source.positions, source.joints, ankle, toes)) * forward, axis=1).mean()
        for ankle, toes in (("left_ankle", "left_toes"), ("right_ankle", "right_toes"))
        if toes in source.joints
    ]
    return bool(feet) and max(feet) < -_BACKWARD


def _warn_of_errors(
    name: str, source: RecordedSkeleton, errors: RetargetingErrors, misplaced: ndarray
) -> None:
    """Warn if the body is far from the recording in the mean over the frames.

    Distances are those that proportions of the person do not explain.
    """
    angles = np.concatenate([errors.directions, errors.rotations], axis=1).mean(axis=0)
    distances = misplaced.mean(axis=0)
    labels = [" to ".join(pair) for pair in errors.bones] + list(errors.parts)
    found = [
        f"{label} by {angle:.0f} degrees"
        for label, angle in zip(labels, angles, strict=True)
        if angle > _MOST_DEGREES
    ]
    found += [
        f"{joint} by {100.0 * distance:.0f} cm"
        for joint, distance in zip(errors.joints, distances, strict=True)
        if distance > _MOST_METRES
    ]
    hips, shoulders = (unit(bone(source.positions, source.joints, *line)) for line in _LINES)
    if np.sum(hips * shoulders, axis=1).mean() < 0.0:
        found.append("the hips face away from the shoulders: their sides may have been swapped")
    elif _feet_point_backward(source):
        found.append("feet point backward: left and right may have been swapped")
    if found:
        warnings.warn(
            f"{name or 'recording'}: the body differs from the recording in the mean, "
            f"{', '.join(found)}; see errors. Joints may have been taken for others: pass joints=",
            stacklevel=2,
        )
