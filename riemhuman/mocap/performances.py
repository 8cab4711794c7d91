"""What a body does in a recording, and how far it is from the recorded skeleton."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from riemhuman.arrays import Array
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import LIMBS
from riemhuman.errors import warn
from riemhuman.kernels.rotations import log, transpose
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.kernels.threads import Run, in_runs
from riemhuman.mocap._body_size import own_person
from riemhuman.mocap._joint_axes import Figure, make_figure, mean_axes
from riemhuman.mocap._joint_names import BONES, SIDES
from riemhuman.mocap._limbs import NECK, RUN, follow
from riemhuman.mocap._recorded_skeletons import RecordedSkeleton, read_skeleton, stands_on
from riemhuman.mocap._skeletons import body_frame, bone, bones, middle
from riemhuman.mocap._standing import Performance, stand
from riemhuman.mocap.skeleton_motion import SkeletonMotion
from riemhuman.representation import Record

# The recorded skeleton, its limbs, feet on the floor, and errors.
_STAGES = 4
# Lines across the body that are compared with the recorded ones, besides bones.
_LINES = (("left_hip", "right_hip"), ("left_shoulder", "right_shoulder"))
# Mean over the frames above which a warning is issued.
_MOST_DEGREES = 15.0
# Distances from recorded joints, metres, that no person's proportions explain.
_MOST_UNLIKE, _MEAN_UNLIKE = 0.16, 0.12
# Soles of standing feet, degrees.
_MOST_PITCH = 30.0
# Coefficients of the same person, estimated twice, differ by less than this.
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
        shoulders; and the neck, if both skeletons have one.
    directions : array, shape (n_frames, B)
        Angles between the bone or line and the recorded one, degrees.
    joints : tuple of str
        Names of the K joints of the limbs.
    positions : array, shape (n_frames, K)
        Distances from the recorded joints, metres, both relative to the middle of the hips.
    parts : tuple of str
        Parts whose rotations are compared: "pelvis", "chest", and "head", "left_foot" and
        "right_foot", if they are recorded.
    rotations : array, shape (n_frames, P)
        Angles between the rotations of pelvis and chest and those derived from the positions of
        hips and shoulders, degrees; and between head and feet and the recorded ones, which on
        average are as those of the body.
    scale : float
        Metres in the unit of the recording: lengths of the recording were multiplied by it.

    Examples
    --------
    >>> rh.datasets.retarget(recording).errors.positions.max()  # doctest: +SKIP
    """

    bones: tuple[tuple[str, str], ...]
    directions: Array
    joints: tuple[str, ...]
    positions: Array
    parts: tuple[str, ...]
    rotations: Array
    scale: float


class Performed(NamedTuple):
    """What a person does: pose vectors and translations, and how far from the recording."""

    poses: Array
    translations: Array
    errors: RetargetingErrors


def perform(
    recording: SkeletonMotion,
    model: BodyModel,
    betas: Array,
    joints: Mapping[str, int] | None,
    up: str | None,
    progress: bool = False,
) -> Performed:
    """Return what a person of the model does in a recording, with a warning if it is far off."""
    bar = tqdm(total=_STAGES, desc="Performing", disable=not progress, unit="stage")
    figure = make_figure(model, betas)
    person = own_person(recording, model) if up in (None, "y") else None
    if person is not None and np.allclose(person.betas, betas, rtol=0.0, atol=_SAME_BETAS):
        source = read_skeleton(recording, joints, "y")
        scale = person.metres
        performance = Performance(
            recording.global_rotations[:, person.joints],
            scale * recording.positions[:, person.joints],
        )
    else:
        source = read_skeleton(recording, joints, up)
        scale = figure.leg / source.leg
        bar.update()
        rotations = follow(source, figure, scale)
        bar.update()
        performance = stand(source, figure, rotations, scale)
    bar.update()
    errors = _errors(source, figure, performance, scale)
    pitches = _pitches(source, figure, performance)
    _warn_of_errors(recording.name, source, errors, pitches)
    poses, translations = _model_parameters(figure, performance)
    bar.update()
    bar.close()
    return Performed(poses, translations, errors)


def _model_parameters(figure: Figure, performance: Performance) -> tuple[Array, Array]:
    """Return the pose vectors and the translations of a performance."""
    parents = figure.model.parents
    limbs = np.flatnonzero(parents >= 0)

    def pose_vectors(frames: Run) -> Array:
        rotations = performance.rotations[frames]
        local = rotations.copy()
        # Products of matrices that are not contiguous take several times as long.
        back = np.ascontiguousarray(transpose(rotations[:, parents[limbs]]))
        local[:, limbs] = back @ rotations[:, limbs]
        return np.asarray(log(np.eye(3), local))

    poses = np.concatenate(in_runs(pose_vectors, len(performance.rotations), RUN))
    root = figure.model.joint_order[0]
    return poses, performance.positions[:, root] - figure.rest[root]


def _errors(
    source: RecordedSkeleton, figure: Figure, performance: Performance, scale: float
) -> RetargetingErrors:
    """Return directions, positions and rotations beside those recorded."""
    pairs = (*BONES, *_LINES)
    if set(NECK) <= source.joints.keys() & figure.joints.keys():
        pairs = (*pairs, NECK)
    names = tuple(name for limb in LIMBS for name in limb)
    performed, performed_places = _bones_and_places(
        performance.positions, figure.joints, pairs, names
    )
    recorded, recorded_places = _bones_and_places(source.positions, source.joints, pairs, names)
    sines = np.linalg.norm(np.cross(performed, recorded), axis=-1)
    angles = np.degrees(np.arctan2(sines, np.sum(performed * recorded, axis=-1)))
    # The trunk is the last of `bones`, and comes after the limbs in the errors.
    order = [*range(len(BONES)), len(pairs), *range(len(BONES), len(pairs))]
    labels = (*BONES, ("hips", "shoulders"), *pairs[len(BONES) :])
    apart = np.linalg.norm(performed_places - scale * recorded_places, axis=-1)
    parts, rotations = _part_errors(source, figure, performance)
    return RetargetingErrors(labels, angles[:, order], names, apart, parts, rotations, scale)


def _bones_and_places(
    positions: Array,
    joints: Mapping[str, int],
    pairs: Sequence[tuple[str, str]],
    names: Sequence[str],
) -> tuple[Array, Array]:
    """Return vectors between joints, and the places of joints relative to the hips."""
    places = positions[:, [joints[name] for name in names]]
    return bones(positions, joints, pairs), places - middle(positions, joints, "hip")[:, None]


def _part_errors(
    source: RecordedSkeleton, figure: Figure, performance: Performance
) -> tuple[tuple[str, ...], Array]:
    """Return the parts of the trunk, and the angles of their rotations to the recorded ones."""
    angles = []
    for line in ("hip", "shoulder"):
        performed = body_frame(performance.positions, figure.joints, line)
        recorded = body_frame(source.positions, source.joints, line)
        angles.append(_angles(performed, recorded))
    parts = ["pelvis", "chest"]
    ends = {"head": "head", "left_foot": "left_ankle", "right_foot": "right_ankle"}
    for part, joint in ends.items():
        is_recorded = part == "head" or joint.replace("ankle", "toes") in source.joints
        if is_recorded and {joint} <= source.joints.keys() & figure.joints.keys():
            performed = performance.rotations[:, figure.joints[joint]]
            recorded = source.rotation(joint)
            axes = mean_axes(recorded, performed, source.is_valid)
            angles.append(_angles(performed, recorded @ axes))
            parts.append(part)
    return tuple(parts), np.stack(angles, axis=1)


def _angles(first: Array, second: Array) -> Array:
    """Return the angles between rotations, degrees."""
    angles: Array = np.degrees(np.linalg.norm(log(first, second), axis=-1))
    return angles


def _pitches(source: RecordedSkeleton, figure: Figure, performance: Performance) -> list[float]:
    """Return how far feet that stand still point up on average, degrees."""
    pitches = []
    for side, standing in zip(SIDES, source.flat.T, strict=True):
        # How far the axis to the front points up, as a sine.
        sines = performance.rotations[standing, figure.joints[f"{side}_ankle"], 1, 2]
        if standing.any():
            pitches.append(float(np.degrees(np.arcsin(np.clip(sines, -1.0, 1.0))).mean()))
    return pitches


def _feet_point_backward(source: RecordedSkeleton) -> bool:
    """Return whether the toes of standing feet are behind the ankles of a body with these sides."""
    forward = body_frame(source.positions, source.joints, "hip")[..., 2]
    feet = []
    for side, standing in zip(SIDES, stands_on(source.positions, source.joints).T, strict=True):
        ankle, toes = f"{side}_ankle", f"{side}_toes"
        if toes in source.joints and standing.any():
            direction = unit(bone(source.positions, source.joints, ankle, toes))
            feet.append(np.sum(direction * forward, axis=1)[standing].mean())
    return bool(feet) and max(feet) < -_BACKWARD


def _warn_of_errors(
    name: str, source: RecordedSkeleton, errors: RetargetingErrors, pitches: Sequence[float]
) -> None:
    """Warn if the body is far from the recording in the mean over the frames."""
    angles = np.concatenate([errors.directions, errors.rotations], axis=1).mean(axis=0)
    labels = [" to ".join(pair) for pair in errors.bones] + list(errors.parts)
    doubts = [
        f"{label} by {angle:.0f} degrees"
        for label, angle in zip(labels, angles, strict=True)
        if angle > _MOST_DEGREES
    ]
    sizes = errors.positions.mean(axis=0)
    if sizes.max() > _MOST_UNLIKE or sizes.mean() > _MEAN_UNLIKE:
        worst = errors.joints[int(sizes.argmax())]
        warn(
            f"{name or 'recording'}: the recorded proportions are not those of the body, whose "
            f"joints are {100.0 * sizes.mean():.0f} cm off on average, and {worst} "
            f"{100.0 * sizes.max():.0f} cm: joints may have been confused, or this is no person. "
            "betas='recorded' finds a person with the recorded proportions",
            UserWarning,
        )
    if pitches and min(pitches) < -_MOST_PITCH:
        doubts.append(f"feet that stand still point down by {-min(pitches):.0f} degrees")
    hips, shoulders = (unit(bone(source.positions, source.joints, *line)) for line in _LINES)
    if np.sum(hips * shoulders, axis=1).mean() < 0.0:
        doubts.append("the hips face away from the shoulders: their sides may have been swapped")
    elif _feet_point_backward(source):
        doubts.append("feet point backward: left and right may have been swapped")
    if doubts:
        warn(
            f"{name or 'recording'}: the body differs from the recording, on average: "
            f"{', '.join(doubts)}; see errors. Joints may have been confused: pass joints=",
            UserWarning,
        )
