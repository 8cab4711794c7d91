"""Motion capture performed by bodies: recordings of skeletons become poses of a body model.

A joint of the model has the rotation in space of the recorded joint of the same name, times a
constant one that takes the model's rest pose to that of the recording:

- trunk and head: the frame of the hip line and the direction from hips to shoulders;
- limbs: the direction of the bone and the axis in which its knee or elbow bends over the recording
  (in the model, in its rest pose), because rest poses of recordings range from T-poses to bones
  that all point one way;
- feet: the mean over frames in which they stand still, when soles are level.

Limbs, trunk and neck are then rotated the shortest way to the recorded directions. Lengths are
scaled by those of the legs. The body moves so that standing feet are where they were recorded, and
limbs leave the recorded directions by a few degrees so that wrists are nearer to where they were
recorded, feet that stand still stay in place, and no sole is more than 5 mm below the floor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel, joints_between
from riemhuman.checks import one_of, real_array, refuse_type
from riemhuman.datasets._skeletons import (
    BENT,
    BONES,
    LIMBS,
    SIDES,
    RecordedSkeleton,
    Skeleton,
    find_joints,
    frame,
    model_joints,
    shortest,
)
from riemhuman.datasets.bvh import SkeletonMotion, nearest_frames
from riemhuman.datasets.motions import ModelMotion
from riemhuman.datasets.open_bodies import load_open_model
from riemhuman.kernels.rotations import exp, log
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.representation import Record
from riemhuman.surfaces.procrustes import AXES

# Soles so near to the floor touch it, metres.
_TOUCHING = 0.005
# Frames in which the lowest point is sought where nobody stands.
_FRAMES_OF_FLOOR = 30
# Still feet are moved by at most so much to stay in place, metres.
_MOST_SHIFT = 0.05
# The body moves with one foot or the other over so many seconds, and a little with feet in the air.
_SHIFTED, _SWING = 0.25, 0.05
# Vertices of a sole that are held above the floor.
_SOLE_VERTICES = 40
# Limbs leave the recorded directions by at most so many radians.
_LIMB = np.radians(3.8)
_BISECTIONS = 12
_TRUNK_STEPS = 3
# Share of the length of a limb that it is stretched to.
_STRETCHED = 0.9995
# Weight of the axis of a knee beside the sine of its angle: a straight knee bends about it.
_HINGE_SHARE = 0.1
# Cosine of the largest angle between bones at rest that counts as the same posture.
_LIKE = 0.5
# Standard deviation of the lengths of bones about those of a person of the model, in lengths of the
# leg; of these lengths about the mean, as their unit is unknown; and the largest coefficient.
_LENGTH_DEVIATION, _LEG_DEVIATION, _MOST_BETA = 0.006, 0.03, 2.5
# Lengths by which a person is found; with the trunk.
_LENGTHS = (*BONES, ("left_shoulder", "right_shoulder"), ("left_hip", "right_hip"))


@dataclass(frozen=True, eq=False, repr=False)
class RetargetingErrors(Record):
    """How far a retargeted motion is from its recording.

    Attributes
    ----------
    bones : tuple of (str, str)
        Joints at the ends of the B bones: upper arms, forearms, thighs, shanks; and the trunk, from
        the middle of the hips to the middle of the shoulders.
    directions : array, shape (n_frames, B)
        Angles between the bone and the recorded one, degrees.
    joints : tuple of str
        Names of the K joints of the limbs.
    positions : array, shape (n_frames, K)
        Distances from the recorded joints, metres. The recording is scaled by the length of the
        legs; both are relative to the middle of the hips.

    Examples
    --------
    >>> rh.datasets.retarget(recording).errors.positions.max()  # doctest: +SKIP
    """

    bones: tuple[tuple[str, str], ...]
    directions: ndarray
    joints: tuple[str, ...]
    positions: ndarray


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
    frames_per_second, n_frames, betas, joints, up
        As for `retarget`.

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
        joints: Mapping[str, str] | None = None,
        up: str | None = None,
    ) -> None:
        super().__init__(*names, frames_per_second, n_frames, model)
        self._recording, self._betas, self._joints, self._up = recording, betas, joints, up

    @property
    def recording(self) -> SkeletonMotion:
        """The recorded skeleton."""
        recording = self._recording
        return recording if isinstance(recording, SkeletonMotion) else recording()

    @property
    def betas(self) -> ndarray:
        return self._performance[0]

    @property
    def errors(self) -> RetargetingErrors:
        """How far the motion is from the recording."""
        return self._performance[3]

    def performed_by(self, betas: Any) -> RetargetedMotion:
        """Return the motion of another person, who does the same in his or her proportions.

        Parameters
        ----------
        betas : array_like, shape (B,)
        """
        other = copy(self)
        other.__dict__.pop("_performance", None)
        other._betas = real_array(betas, "betas", (self.model.n_betas,), batched=False)
        return other

    def _parameters(self, numbers: ndarray) -> tuple[ndarray, ndarray]:
        _, poses, translations, _ = self._performance
        return poses[numbers], translations[numbers]

    @cached_property
    def _performance(self) -> tuple[ndarray, ndarray, ndarray, RetargetingErrors]:
        source = RecordedSkeleton(self.recording, self._joints, self._up)
        betas = self._betas
        if betas is None:
            betas = _similar_person(source, self.model)
        performer = _Performer(source, self.model, betas)
        return betas, *performer.parameters(), performer.errors()


def retarget(
    recording: SkeletonMotion,
    model: BodyModel | None = None,
    *,
    betas: Any = None,
    joints: Mapping[str, str] | None = None,
    up: str | None = None,
    frames_per_second: float | None = None,
) -> RetargetedMotion:
    """Return the motion of a body that does what a recorded skeleton does.

    Rest poses, axes, units and proportions of the recording may be any. Limbs follow the recorded
    directions within 3.8 degrees, the trunk almost exactly; feet are level while they stand still,
    stay in place, and sink by at most 5 mm.

    Parameters
    ----------
    recording : SkeletonMotion
        Recorded skeleton, from `load_bvh`, with hips, knees, ankles, shoulders, elbows and wrists.
    model : BodyModel, optional
        Model with named joints, or with those of SMPL; by default the open model, "coarse".
    betas : array_like, shape (B,), optional
        Shape coefficients of the person; by default bones have the recorded lengths. Those do not
        tell the build, and makers place joints differently: girths and mass may be nobody's. Zeros
        are an average adult.
    joints : mapping of str to str, optional
        Names of joints in the recording by those of the open model, such as
        ``{"left_hip": "LeftUpLeg"}``, where they are not recognised. Names of Mixamo, Biped, Xsens,
        CMU, LAFAN1, Bandai-Namco, SMPL and similar skeletons are.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis of the recording that points up; by default the one along which people stand.
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
    if betas is not None:
        betas = real_array(betas, "betas", (model.n_betas,), batched=False)
    if up is not None:
        one_of(up, "up", AXES)
    model_joints(model)
    find_joints(recording.joint_names, recording.parents, joints)
    rate = recording.frames_per_second
    if frames_per_second is not None:
        frames = nearest_frames(len(recording), rate, frames_per_second)
        rate = float(frames_per_second)
        recording = replace(
            recording,
            rotations=recording.rotations[frames],
            translations=recording.translations[frames],
            frames_per_second=rate,
        )
    names, n_frames = ("", recording.name), len(recording)
    return RetargetedMotion(
        recording, model, names, rate, n_frames, betas=betas, joints=joints, up=up
    )


class _Performer(Skeleton):
    """A person of a model who does what a skeleton does: rotations and positions in space."""

    def __init__(self, source: RecordedSkeleton, model: BodyModel, betas: ndarray) -> None:
        super().__init__(model.parents, model.joints(betas), model_joints(model))
        self.source, self.model, self.betas = source, model, betas
        self.order = model.joint_order
        self.scale = self.leg / source.leg
        # Takes directions in the model's rest pose to those in the recording's.
        self.between = source.frame @ self.frame.T
        n_frames = len(source.positions)
        self.rotations = np.empty((n_frames, len(self.rest), 3, 3))
        self.positions = np.empty((n_frames, len(self.rest), 3))
        own = self._trunk()
        for side in SIDES:
            own |= self._collar(side) | self._foot(side)
        for limb in LIMBS:
            own |= self._limb(limb)
        for joint in self.order:
            self.rotations[:, joint] = own.get(joint, self.rotations[:, self.parents[joint]])
        self._straighten_trunk()
        for arm in LIMBS[2:]:
            shoulder, wrist = self.joints[arm[0]], source.joints[arm[2]]
            self._reach(arm, self.scale * source.positions[:, wrist] - self.positions[:, shoulder])
        self._stand(model(betas))

    def _recorded(self, name: str, start: ndarray) -> ndarray:
        """Return the recorded rotations of a joint after a rotation from rest to rest."""
        return self.source.rotations[:, self.source.joints[name]] @ start

    def _pointed(self, rotations: ndarray, first: str, second: str) -> ndarray:
        """Rotate a bone the shortest way to the recorded directions."""
        directions = self.source.direction(first, second)
        return shortest(rotations @ unit(self.bone(first, second)), directions) @ rotations

    def _trunk(self) -> dict[int, ndarray]:
        pelvis, chest = (self._recorded(name, self.between) for name in ("pelvis", "chest"))
        spine = joints_between(self.parents, self.joints["pelvis"], self.joints["chest"])
        own = dict(zip(spine, _interpolated(pelvis, chest, len(spine)), strict=True))
        head = self._recorded("head", self.between) if "head" in self.source.joints else chest
        neck = _interpolated(chest, head, 3)[1]
        if all({"neck", "head"} <= skeleton.joints.keys() for skeleton in (self, self.source)):
            neck = self._pointed(neck, "neck", "head")
        parts = {"neck": neck, "head": head}
        return own | {self.joints[k]: part for k, part in parts.items() if k in self.joints}

    def _collar(self, side: str) -> dict[int, ndarray]:
        name, bone = f"{side}_collar", (f"{side}_collar", f"{side}_shoulder")
        if name not in self.joints or name not in self.source.joints:
            return {}
        start, recorded = self.between, unit(self.source.bone(*bone))
        modelled = start @ unit(self.bone(*bone))
        # Where the rest pose is no posture of a body, the direction of the bone itself counts.
        if recorded @ modelled < _LIKE:
            start = shortest(modelled, recorded) @ start
        return {self.joints[name]: self._recorded(name, start)}

    def _limb(self, limb: tuple[str, ...]) -> dict[int, ndarray]:
        axis, recorded_axis = self._hinge(limb), self.source.hinge(*limb)
        upper, recorded = (unit(skeleton.bone(*limb[:2])) for skeleton in (self, self.source))
        if recorded_axis is None:
            swing = shortest(self.between @ upper, recorded)
            recorded_axis = swing @ self.between @ axis
        own = {}
        for bone in (limb[:2], limb[1:]):
            start = frame(self.source.bone(*bone), recorded_axis) @ frame(self.bone(*bone), axis).T
            own[self.joints[bone[0]]] = self._pointed(self._recorded(bone[0], start), *bone)
        if limb[2].endswith("wrist"):
            own[self.joints[limb[2]]] = self._recorded(limb[2], start)
        return own

    def _hinge(self, limb: tuple[str, ...]) -> ndarray:
        """Return the axis in which a knee or elbow of the model bends, in the rest pose."""
        upper, lower = unit(self.bone(*limb[:2])), unit(self.bone(*limb[1:]))
        axis = np.cross(upper, lower)
        if np.linalg.norm(axis) > np.sin(np.radians(BENT)):
            return unit(axis)
        up, left, _ = self.frame.T
        if limb[0].endswith("hip"):
            return left
        # With arms straight to the sides, elbows bend forward.
        outward = left if limb[0].startswith("left") else -left
        return shortest(outward, upper) @ np.cross(outward, np.cross(left, up))

    def _foot(self, side: str) -> dict[int, ndarray]:
        bone = f"{side}_ankle", f"{side}_toes"
        flat = self.source.flat[:, SIDES.index(side)]
        if not all(bone[1] in skeleton.joints for skeleton in (self, self.source)):
            return {self.joints[bone[0]]: self._recorded(bone[0], self.between)}
        # Soles are level in the mean over frames in which the foot stands still.
        level = frame(self.frame[:, 0], self.bone(*bone))
        standing = frame(np.array([0.0, 1.0, 0.0]), self.source.direction(*bone)[flat])
        modelled = self.between @ unit(self.bone(*bone))
        start = shortest(modelled, unit(self.source.bone(*bone))) @ self.between
        own = {}
        for part in bone:
            if flat.any():
                local = np.swapaxes(self._recorded(part, np.eye(3))[flat], -1, -2) @ standing
                start = Rotation.from_matrix(local).mean().as_matrix() @ level.T
            own[self.joints[part]] = self._recorded(part, start)
        return own

    def _set_positions(self) -> None:
        """Place the joints, the middle of the hips where it was recorded."""
        for joint in self.order:
            parent = self.parents[joint]
            self.positions[:, joint] = 0.0
            if parent >= 0:
                bone = self.rotations[:, parent] @ (self.rest[joint] - self.rest[parent])
                self.positions[:, joint] = self.positions[:, parent] + bone
        hips = self.middle(self.positions, "hip")
        self.positions += (self.scale * self.source.hips - hips)[:, None]

    def _straighten_trunk(self) -> None:
        """Rotate the spine until shoulders are above hips as recorded."""
        spine = joints_between(self.parents, self.joints["pelvis"], self.joints["chest"])[1:-1]
        wanted = unit(self.source.trunk)
        for _ in range(_TRUNK_STEPS if spine else 0):
            self._set_positions()
            hips, shoulders = (self.middle(self.positions, part) for part in ("hip", "shoulder"))
            start = self.positions[:, spine[0]]
            length = np.linalg.norm(shoulders - hips, axis=1, keepdims=True)
            towards = unit(hips + length * wanted - start)
            rotation = shortest(unit(shoulders - start), towards)
            self.rotations[:, spine] = rotation[:, None] @ self.rotations[:, spine]
        self._set_positions()

    def _reach(self, limb: tuple[str, ...], to_end: ndarray) -> None:
        """Bend a limb so that its end is as near to a place as its directions may go."""
        bones = [self.bone(*limb[:2]), self.bone(*limb[1:])]
        a, b = (float(np.linalg.norm(bone)) for bone in bones)
        joints = [self.joints[name] for name in limb[:2]]
        known = self.source.direction(*limb[:2]), self.source.direction(*limb[1:])
        # A straight limb bends about its hinge, a bent one in its plane.
        hinge = self.rotations[:, joints[0]] @ self._hinge(limb)
        axis = np.cross(*known) + _HINGE_SHARE * hinge
        end = a * known[0] + b * known[1]
        low, high = np.zeros((len(end), 1)), np.ones((len(end), 1))
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            found = _bent(end + middle * (to_end - end), a, b, axis)
            cosines = [np.sum(new * old, axis=1) for new, old in zip(found, known, strict=True)]
            is_near = np.minimum(*cosines)[:, None] > np.cos(_LIMB)
            low, high = np.where(is_near, middle, low), np.where(is_near, high, middle)
        found = _bent(end + low * (to_end - end), a, b, axis)
        for joint, old, new in zip(joints, known, found, strict=True):
            self.rotations[:, joint] = shortest(old, new) @ self.rotations[:, joint]

    def _stand(self, surface: ndarray) -> None:
        """Move the body with its standing feet, and its feet to the floor."""
        feet = [self.joints[f"{side}_ankle"] for side in SIDES]
        self._move(
            self.scale * self.source.positions[:, self.source.ankles] - self.positions[:, feet]
        )
        soles = [self._sole(surface, side) for side in SIDES]
        lows, balls = (np.stack(parts, axis=1) for parts in zip(*soles, strict=True))
        targets = self._footholds(self.positions[:, feet], lows, balls)
        self._move(targets - self.positions[:, feet])
        for k, leg in enumerate(LIMBS[:2]):
            self._reach(leg, targets[:, k] - self.positions[:, self.joints[leg[0]]])
        hips = self.middle(self.positions, "hip")
        self._set_positions()
        self.positions += (hips - self.middle(self.positions, "hip"))[:, None]
        below = -np.min(self.positions[:, feet, 1] + lows, axis=1)
        self.positions[..., 1] += np.maximum(0.0, below - _TOUCHING)[:, None]

    def _move(self, shifts: ndarray) -> None:
        """Move the body by the mean shift of its feet, above all of those that stand still."""
        width = max(1, round(_SHIFTED * self.source.frames_per_second))
        still = self.source.still.astype(np.float64)
        weights = _SWING + uniform_filter1d(still, width, axis=0, mode="nearest")
        shares = weights / weights.sum(axis=1, keepdims=True)
        self.positions += np.sum(shares[..., None] * shifts, axis=1)[:, None]

    def _sole(self, surface: ndarray, side: str) -> tuple[ndarray, ndarray]:
        """Return the height of a foot's lowest vertex, and its ball, relative to its ankle."""
        names = [f"{side}_{part}" for part in ("ankle", "toes")]
        foot = [self.joints[name] for name in names if name in self.joints]
        weights = self.model.weights[:, foot]
        total = weights.sum(axis=1)
        vertices = np.flatnonzero(total >= 0.5 * total.max())
        vertices = vertices[np.argsort(surface[vertices] @ self.frame[:, 0])[:_SOLE_VERTICES]]
        ball = self.rotations[:, foot[0]] @ (self.rest[foot[-1]] - self.rest[foot[0]])
        heights = np.zeros((len(ball), len(vertices)))
        for k, joint in enumerate(foot):
            share = weights[vertices, k] / total[vertices]
            moved = self.rotations[:, joint, 1] @ (surface[vertices] - self.rest[joint]).T
            heights += share * (moved + (ball[:, 1:2] if k else 0.0))
        return heights.min(axis=1), ball

    def _footholds(self, ankles: ndarray, lows: ndarray, balls: ndarray) -> ndarray:
        """Return where ankles must be for still feet to stay in place, and no sole below 0."""
        heights = ankles[..., 1] + lows
        grounded = self.source.grounded
        floor = np.median(heights[grounded]) if grounded.any() else self._lowest_point()
        targets, above = ankles - [0.0, floor, 0.0], heights - floor
        apart = np.sign(above) * np.maximum(np.abs(above) - _TOUCHING, 0.0)
        frames = np.arange(len(ankles))
        for k, still in enumerate(self.source.still.T):
            shift = np.zeros_like(balls[:, k])
            shift[:, 1] = np.where(grounded[:, k], -apart[:, k], 0.0)
            for stand in np.ma.clump_unmasked(np.ma.masked_array(frames, ~still)):
                drift = (ankles[stand, k] + balls[stand, k])[:, [0, 2]]
                shift[stand, ::2] = drift.mean(axis=0) - drift
            size = np.linalg.norm(shift[:, ::2], axis=1, keepdims=True)
            shift[:, ::2] *= _MOST_SHIFT / np.maximum(size, _MOST_SHIFT)
            # In between, feet move from one place to the next.
            known = np.flatnonzero(still)
            for column in shift.T:
                column[:] = np.interp(frames, known, column[known]) if len(known) else 0.0
            shift[:, 1] += np.maximum(0.0, -(above[:, k] + shift[:, 1] + _TOUCHING))
            targets[:, k] += shift
        return targets

    def _lowest_point(self) -> float:
        """Return the height of the lowest vertex in some frames."""
        poses, translations = self.parameters()
        n_frames = len(poses)
        some = np.unique(np.linspace(0, n_frames - 1, _FRAMES_OF_FLOOR).astype(np.int64))
        return float(self.model(self.betas, poses[some], translations[some])[..., 1].min())

    def parameters(self) -> tuple[ndarray, ndarray]:
        """Return the pose vectors and the translations."""
        local = self.rotations.copy()
        limbs = np.flatnonzero(self.parents >= 0)
        above = np.swapaxes(self.rotations[:, self.parents[limbs]], -1, -2)
        local[:, limbs] = above @ self.rotations[:, limbs]
        root = self.order[0]
        return log(np.eye(3), local), self.positions[:, root] - self.rest[root]

    def errors(self) -> RetargetingErrors:
        """Return directions and positions beside those recorded."""
        source, names = self.source, tuple(name for limb in LIMBS for name in limb)
        own, recorded = self.bones(self.positions), source.bones(source.positions)
        sines = np.linalg.norm(np.cross(own, recorded), axis=-1)
        angles = np.degrees(np.arctan2(sines, np.sum(own * recorded, axis=-1)))
        own, recorded = (
            skeleton.positions[:, [skeleton.joints[name] for name in names]]
            - skeleton.middle(skeleton.positions, "hip")[:, None]
            for skeleton in (self, source)
        )
        apart = np.linalg.norm(own - self.scale * recorded, axis=-1)
        return RetargetingErrors((*BONES, ("hips", "shoulders")), angles, names, apart)


def _bent(to_end: ndarray, a: float, b: float, axis: ndarray) -> tuple[ndarray, ndarray]:
    """Return the directions of two bones of lengths a and b to an end, bent about an axis."""
    length = np.linalg.norm(to_end, axis=1, keepdims=True)
    length = np.clip(length, abs(a - b) + 1e-6, _STRETCHED * (a + b))
    towards = unit(to_end)
    along = (length**2 + a**2 - b**2) / (2.0 * length)
    across = np.sqrt(np.maximum(a**2 - along**2, 0.0))
    joint = along * towards + across * unit(np.cross(towards, axis))
    return joint / a, (length * towards - joint) / b


def _similar_person(source: RecordedSkeleton, model: BodyModel) -> ndarray:
    """Return the shape coefficients of a person whose bones have the recorded proportions."""
    lengths = np.linalg.norm(source.bones(source.positions, _LENGTHS), axis=-1)
    recorded = np.median(lengths, axis=0) / source.leg
    mean, joints = model.joints(), model_joints(model)
    changes = np.tensordot(model.joint_regressor, model.shapedirs, axes=1)

    def residuals(betas: ndarray) -> ndarray:
        body = Skeleton(model.parents, mean + changes @ betas, joints)
        apart = np.linalg.norm(body.bones(body.rest, _LENGTHS), axis=1) / body.leg - recorded
        taller = body.leg / leg - 1.0
        return np.concatenate([apart / _LENGTH_DEVIATION, [taller / _LEG_DEVIATION], betas])

    leg, start = Skeleton(model.parents, mean, joints).leg, np.zeros(model.n_betas)
    return np.asarray(least_squares(residuals, start, bounds=(-_MOST_BETA, _MOST_BETA)).x)


def _interpolated(start: ndarray, end: ndarray, n: int) -> list[ndarray]:
    """Return n rotations from a rotation to another, in each frame."""
    return [exp(share * log(start, end), start) for share in np.linspace(0.0, 1.0, n)]
