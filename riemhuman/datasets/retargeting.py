"""Motion capture performed by bodies: recordings of skeletons become poses of a body model.

Joints of both skeletons are matched by their names; the pelvis and the chest are found in the
hierarchy. A joint of the model has the rotation in space of the recorded joint, times a constant
one that takes the model's rest pose to that of the recording:

- trunk and head: the frame of the hip line and the direction from hips to shoulders;
- limbs: the direction of the bone and the axis in which its knee or elbow bends over the recording
  (in the model, in its rest pose), because rest poses of recordings range from T-poses to bones
  that all point one way;
- feet: the mean over frames in which they stand still, when soles are level.

Then limbs, trunk and neck are turned the shortest way to the recorded directions. Lengths are
scaled by those of the legs, and hips are where the recorded ones are. Knees and hips bend a
little more or less so that ankles, too, are where they were recorded, soles of feet that stand
still stay in place, and none goes below the floor.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.ndimage import uniform_filter1d
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from riemhuman.bodies import BodyModel, joints_between
from riemhuman.checks import one_of, real_array
from riemhuman.datasets._skeletons import (
    BENT,
    BONES,
    LIMBS,
    SIDES,
    RecordedSkeleton,
    Skeleton,
    angles_between,
    frame,
    model_joints,
    pointed,
    recorded_joints,
    shortest,
    shortest_within,
    unit,
)
from riemhuman.datasets.bvh import SkeletonMotion
from riemhuman.datasets.motions import Motion
from riemhuman.datasets.open_bodies import load_open_model
from riemhuman.errors import ArgumentTypeError
from riemhuman.kernels.threads import slices
from riemhuman.representation import Record
from riemhuman.surfaces.template import Template

# Soles of still feet so near to the floor, metres, stand on it; higher ones on something else.
_NEAR_FLOOR = 0.03
# Soles at most so far from the floor, metres, touch it.
_TOUCHING = 0.005
# Standard deviation of bone lengths about those of a person of the model, metres.
_LENGTH_DEVIATION = 0.005
# Vertices of a sole that are held above the floor.
_SOLE_VERTICES = 40
# Still feet are moved by at most so much to stay in place, metres.
_MOST_SHIFT = 0.05
# The body moves with one foot or the other over so many seconds …
_SHIFTED = 0.25
# … and a little with feet in the air.
_SWING = 0.05
_TRUNK_STEPS = 3
_REACH_STEPS = 8
# A centimetre that the body moves, or a foot misses, weighs like so many radians a metre.
_SHIFT_WEIGHT, _MISS_WEIGHT = 6.0, 30.0
_STEP = 1e-4
# Thighs and shanks leave the recorded directions by at most 4.5 degrees.
_LEAST_COSINE = np.cos(np.radians(4.5))
_BISECTIONS = 12
# Collars are turned by at most so much towards recorded shoulders.
_COLLAR = np.radians(8.0)
_MOST_BETA = 2.5
# Share of the length of a leg that it is stretched to.
_STRETCHED = 0.9995
# Weight of the axis of a knee beside the sine of its angle.
_HINGE_SHARE = 0.1
# Cosine of the largest angle between bones at rest that counts as the same posture.
_LIKE = 0.5
_FRAMES_AT_A_TIME = 64


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
    """

    bones: tuple[tuple[str, str], ...]
    directions: ndarray
    joints: tuple[str, ...]
    positions: ndarray


class RetargetedMotion(Motion):
    """A recording performed by a person of a body model, from `retarget`.

    Frame i is ``model(betas, pose_vectors[i], translations[i])``: metres, y up, on a floor at
    height 0.

    Parameters
    ----------
    recording : SkeletonMotion, or function that returns it
        Recorded skeleton.
    model : BodyModel
        Model with named joints.
    betas, joints, up
        As for `retarget`.
    subject, sequence : str
        Names of the person and of the motion.
    frames_per_second : float
        Frame rate of the recording.
    n_frames : int
        Number of frames of the recording.

    Examples
    --------
    >>> import riemhuman as rh
    >>> jump = rh.datasets.retarget(rh.datasets.load_bvh("jump.bvh"))  # doctest: +SKIP
    >>> other = jump.performed_by(-jump.betas)  # doctest: +SKIP
    """

    def __init__(
        self,
        recording: SkeletonMotion | Callable[[], SkeletonMotion],
        model: BodyModel,
        *,
        betas: ndarray | None = None,
        joints: Mapping[str, str] | None = None,
        up: str | None = None,
        subject: str,
        sequence: str,
        frames_per_second: float,
        n_frames: int,
    ) -> None:
        super().__init__(subject, sequence, frames_per_second, n_frames, model.faces)
        self.model = model
        self._recording, self._betas, self._joints, self._up = recording, betas, joints, up

    @property
    def template(self) -> Template:
        """The template of the model."""
        return self.model.template

    @property
    def recording(self) -> SkeletonMotion:
        """The recorded skeleton."""
        recording = self._recording
        return recording if isinstance(recording, SkeletonMotion) else recording()

    @property
    def betas(self) -> ndarray:
        """Shape coefficients of the person, shape (B,)."""
        return self._performance[0]

    @property
    def pose_vectors(self) -> ndarray:
        """Axis-angle joint rotations in every frame, shape (n_frames, J, 3), radians."""
        return self._performance[1]

    @property
    def translations(self) -> ndarray:
        """Translation in every frame, shape (n_frames, 3), metres."""
        return self._performance[2]

    @property
    def errors(self) -> RetargetingErrors:
        """Directions and positions of the joints beside those recorded."""
        return self._performance[3]

    def performed_by(self, betas: Any) -> RetargetedMotion:
        """Return the motion of another person.

        Parameters
        ----------
        betas : array_like, shape (B,)
            Shape coefficients of the person.

        Returns
        -------
        RetargetedMotion
        """
        return RetargetedMotion(
            self._recording,
            self.model,
            betas=real_array(betas, "betas", (self.model.n_betas,), batched=False),
            joints=self._joints,
            up=self._up,
            subject=self.subject,
            sequence=self.sequence,
            frames_per_second=self.frames_per_second,
            n_frames=self.n_frames,
        )

    @cached_property
    def _performance(self) -> tuple[ndarray, ndarray, ndarray, RetargetingErrors]:
        source = RecordedSkeleton(self.recording, self._joints, self._up)
        joints = model_joints(self.model)
        betas = self._betas
        if betas is None:
            betas = _similar_person(source, self.model, joints)
        return betas, *_perform(source, self.model, joints, betas)

    def _frames(self, numbers: range) -> ndarray:
        frames = np.empty((len(numbers), self.model.n_vertices, 3))
        betas, poses, translations, _ = self._performance
        for some in slices(len(numbers), _FRAMES_AT_A_TIME):
            chosen = np.asarray(numbers[some], dtype=np.int64)
            frames[some] = self.model(betas, poses[chosen], translations[chosen])
        return frames


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

    Rest poses, axes, units and proportions of the recording may be any. The rotations of limbs
    about themselves come from the axes in which knees and elbows bend, feet are level while they
    stand still, and they neither slide nor go below the floor.

    Parameters
    ----------
    recording : SkeletonMotion
        Recorded skeleton, from `load_bvh`, with hips, knees, ankles, shoulders, elbows and wrists.
    model : BodyModel, optional
        Model with named joints, or with those of SMPL; by default the open model, "coarse".
    betas : array_like, shape (B,), optional
        Shape coefficients of the person; by default one with the proportions of the recording. See
        also `RetargetedMotion.performed_by`.
    joints : mapping of str to str, optional
        Names of joints in the recording by those of the open model, such as
        ``{"left_hip": "LeftUpLeg"}``, where they are not recognised. Names of Mixamo, Biped, Xsens,
        CMU, LAFAN1, Bandai-Namco, SMPL and similar skeletons are.
    up : {"y", "z"}, optional
        Axis of the recording that points up; by default from feet to shoulders in most frames.
    frames_per_second : float, optional
        Frame rate, at most that of the recording: the frames nearest in time are used.

    Returns
    -------
    RetargetedMotion
        Its `errors` are angles of bones and distances of joints from the recording.

    Raises
    ------
    ArgumentError
        If joints are not found, are not in the order of a body, or lie in one place.

    Examples
    --------
    >>> import riemhuman as rh
    >>> recording = rh.datasets.load_bvh("jump.bvh")  # doctest: +SKIP
    >>> jump = rh.datasets.retarget(recording)  # doctest: +SKIP
    >>> jump[0].shape, jump.errors.directions.max()  # doctest: +SKIP
    ((1202, 3), 3.1)
    """
    if not isinstance(recording, SkeletonMotion):
        raise ArgumentTypeError(
            f"recording must be a SkeletonMotion; found {type(recording).__name__}"
        )
    model = load_open_model("coarse") if model is None else model
    if not isinstance(model, BodyModel):
        raise ArgumentTypeError(f"model must be a BodyModel; found {type(model).__name__}")
    if betas is not None:
        betas = real_array(betas, "betas", (model.n_betas,), batched=False)
    if up is not None:
        one_of(up, "up", ("y", "z"))
    model_joints(model)
    recorded_joints(recording, joints)
    if frames_per_second is not None:
        recording = recording.at_rate(frames_per_second)
    return RetargetedMotion(
        recording,
        model,
        betas=betas,
        joints=joints,
        up=up,
        subject="",
        sequence=recording.name,
        frames_per_second=recording.frames_per_second,
        n_frames=len(recording),
    )


def _perform(
    source: RecordedSkeleton, model: BodyModel, joints: dict[str, int], betas: ndarray
) -> tuple[ndarray, ndarray, RetargetingErrors]:
    """Return pose vectors, translations and errors of a person who does what was recorded."""
    body = Skeleton(model.parents, model.joints(betas), joints)
    rotations = _rotations(source, body, model.joint_order)
    _straighten_trunk(source, body, rotations, model.joint_order)
    scale = body.leg / source.leg
    _follow_arms(source, body, rotations, scale, model.joint_order)
    positions = _positions(body, rotations, model.joint_order)
    positions += (scale * source.hips - body.middle(positions, "hip"))[:, None]
    # The body moves so that standing feet are where they were recorded, in every stride.
    feet = [body.joints[f"{side}_ankle"] for side in SIDES]
    recorded = scale * source.positions[:, [source.joints[f"{side}_ankle"] for side in SIDES]]
    positions += _shared(source, recorded - positions[:, feet])[:, None]
    soles = [_sole(model, body, model(betas), rotations, side) for side in SIDES]
    lows, balls = (np.stack(parts, axis=1) for parts in zip(*soles, strict=True))
    targets = _place_feet(source, positions[:, feet], lows, balls)
    positions += _shared(source, targets - positions[:, feet])[:, None]
    _reach(body, rotations, positions, targets)
    root = model.joint_order[0]
    final = _positions(body, rotations, model.joint_order)
    final += (positions[:, root] - final[:, root])[:, None]
    below = -np.min(final[:, feet, 1] + lows, axis=1)
    final[..., 1] += np.maximum(0.0, below - _TOUCHING)[:, None]
    local = rotations.copy()
    limbs = np.flatnonzero(body.parents >= 0)
    local[:, limbs] = np.swapaxes(rotations[:, body.parents[limbs]], -1, -2) @ rotations[:, limbs]
    vectors = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_rotvec().reshape(local.shape[:-1])
    return vectors, final[:, root] - body.rest[root], _errors(source, body, final, scale)


def _rotations(source: RecordedSkeleton, body: Skeleton, order: Sequence[int]) -> ndarray:
    """Return the rotations in space of the model's joints, shape (n_frames, J, 3, 3)."""
    rotations = np.empty((len(source.positions), len(body.rest), 3, 3))
    own: dict[int, ndarray] = {}
    between = source.frame @ body.frame.T
    ends = [source.rotations[:, source.joints[name]] @ between for name in ("pelvis", "chest")]
    trunk = joints_between(body.parents, body.joints["pelvis"], body.joints["chest"])
    own |= dict(zip(trunk, _interpolated(*ends, len(trunk)), strict=True))
    if "head" in body.joints:
        head = ends[1]
        if "head" in source.joints:
            head = source.rotations[:, source.joints["head"]] @ between
        own[body.joints["head"]] = head
        if "neck" in body.joints:
            neck = _interpolated(ends[1], head, 3)[1]
            if "neck" in source.joints and "head" in source.joints:
                neck = pointed(neck, body.bone("neck", "head"), source.direction("neck", "head"))
            own[body.joints["neck"]] = neck
    for side in SIDES:
        _add_collar(source, body, side, between, own)
        for limb in LIMBS:
            if limb[0].startswith(side):
                _add_limb(source, body, limb, between, own)
        _add_foot(source, body, side, between, own)
    for joint in order:
        rotations[:, joint] = own.get(joint, rotations[:, body.parents[joint]])
    return rotations


def _add_collar(
    source: RecordedSkeleton, body: Skeleton, side: str, between: ndarray, own: dict[int, ndarray]
) -> None:
    bone = f"{side}_collar", f"{side}_shoulder"
    if any(bone[0] not in skeleton.joints for skeleton in (source, body)):
        return
    recorded, modelled = unit(source.bone(*bone)), between @ unit(body.bone(*bone))
    # Where the rest pose is no posture of a body, the direction of the bone itself counts.
    if recorded @ modelled < _LIKE:
        between = shortest(modelled, recorded) @ between
    own[body.joints[bone[0]]] = source.rotations[:, source.joints[bone[0]]] @ between


def _add_limb(
    source: RecordedSkeleton,
    body: Skeleton,
    limb: tuple[str, str, str],
    between: ndarray,
    own: dict[int, ndarray],
) -> None:
    bones = limb[:2], limb[1:]
    axis = _model_hinge(body, limb)
    first, first_recorded = body.bone(*bones[0]), source.bone(*bones[0])
    recorded_axis = source.hinge(*limb)
    if recorded_axis is None:
        swing = shortest(between @ unit(first), unit(first_recorded))
        recorded_axis = swing @ between @ axis
    for bone in bones:
        start = frame(source.bone(*bone), recorded_axis) @ frame(body.bone(*bone), axis).T
        turned = source.rotations[:, source.joints[bone[0]]] @ start
        own[body.joints[bone[0]]] = pointed(turned, body.bone(*bone), source.direction(*bone))
    own[body.joints[limb[2]]] = source.rotations[:, source.joints[limb[2]]] @ start


def _model_hinge(body: Skeleton, limb: tuple[str, str, str]) -> ndarray:
    """Return the axis in which a knee or elbow of the model bends, in the rest pose."""
    upper, lower = unit(body.bone(*limb[:2])), unit(body.bone(*limb[1:]))
    axis = np.cross(upper, lower)
    if np.linalg.norm(axis) > np.sin(np.radians(BENT)):
        return unit(axis)
    up, left, _ = body.frame.T
    if limb[0].endswith("hip"):
        return left
    # With arms straight to the sides, elbows bend forward.
    outward = left if limb[0].startswith("left") else -left
    return shortest(outward, upper) @ np.cross(outward, np.cross(left, up))


def _add_foot(
    source: RecordedSkeleton, body: Skeleton, side: str, between: ndarray, own: dict[int, ndarray]
) -> None:
    """Add the rotations of a foot and its toes, which are level in the mean while still."""
    bone = f"{side}_ankle", f"{side}_toes"
    if bone[1] not in body.joints or bone[1] not in source.joints:
        own[body.joints[bone[0]]] = source.rotations[:, source.joints[bone[0]]] @ between
        return
    up = body.frame[:, 0]
    level = frame(up, body.bone(*bone))
    _, flat = source.still[SIDES.index(side)]
    if flat.any():
        forward = source.direction(*bone)[flat]
        standing = frame(np.array([0.0, 1.0, 0.0]), forward)
        for part in bone:
            turned = np.swapaxes(source.rotations[flat, source.joints[part]], -1, -2) @ standing
            start = Rotation.from_matrix(turned).mean().as_matrix() @ level.T
            own[body.joints[part]] = source.rotations[:, source.joints[part]] @ start
    else:
        recorded = unit(source.bone(*bone))
        start = shortest(between @ unit(body.bone(*bone)), recorded) @ between
        for part in bone:
            own[body.joints[part]] = source.rotations[:, source.joints[part]] @ start


def _straighten_trunk(
    source: RecordedSkeleton, body: Skeleton, rotations: ndarray, order: Sequence[int]
) -> None:
    """Turn the spine between pelvis and chest until shoulders are above hips as recorded."""
    spine = joints_between(body.parents, body.joints["pelvis"], body.joints["chest"])[1:-1]
    wanted = unit(source.trunk)
    for _ in range(_TRUNK_STEPS if spine else 0):
        positions = _positions(body, rotations, order)
        hips, shoulders = (body.middle(positions, part) for part in ("hip", "shoulder"))
        start = positions[:, spine[0]]
        length = np.linalg.norm(shoulders - hips, axis=1, keepdims=True)
        towards = unit(hips + length * wanted - start)
        turn = shortest(unit(shoulders - start), towards)
        rotations[:, spine] = turn[:, None] @ rotations[:, spine]


def _follow_arms(
    source: RecordedSkeleton, body: Skeleton, rotations: ndarray, scale: float, order: Sequence[int]
) -> None:
    """Bring shoulders and wrists nearer to where they were recorded, within a few degrees."""
    positions = _positions(body, rotations, order)
    hips = body.middle(positions, "hip")
    for side, arm in zip(SIDES, LIMBS[2:], strict=True):
        shoulder, _, wrist = (
            hips + scale * (source.positions[:, source.joints[name]] - source.hips) for name in arm
        )
        start = positions[:, body.joints[arm[0]]]
        if f"{side}_collar" in body.joints:
            collar = body.joints[f"{side}_collar"]
            bone = start - positions[:, collar]
            turn = shortest_within(unit(bone), unit(shoulder - positions[:, collar]), _COLLAR)
            rotations[:, collar] = turn @ rotations[:, collar]
            start = positions[:, collar] + (turn @ bone[..., None])[..., 0]
        limb = _Limb(body, rotations, arm)
        limb.apply(rotations, *limb.towards(wrist - start))


def _shared(source: RecordedSkeleton, shifts: ndarray) -> ndarray:
    """Return the mean shift of both feet, above all of those that stand still."""
    width = max(1, round(_SHIFTED * source.frames_per_second))
    still = np.stack([ball for ball, _ in source.still], axis=1).astype(np.float64)
    weights = _SWING + uniform_filter1d(still, width, axis=0, mode="nearest")
    return np.asarray(np.sum(weights[..., None] * shifts, axis=1) / weights.sum(axis=1)[:, None])


def _place_feet(
    source: RecordedSkeleton, ankles: ndarray, lows: ndarray, balls: ndarray
) -> ndarray:
    """Return positions of the ankles at which still feet stay in place, and none is below 0.

    `lows` are the heights of the lowest vertices, and `balls` positions, relative to the ankles.
    """
    heights = ankles[..., 1] + lows
    still = np.stack([ball for ball, _ in source.still], axis=1)
    standing = heights[still] if still.any() else heights.min(keepdims=True)
    floor = np.median(standing[standing <= np.percentile(standing, 10.0) + _NEAR_FLOOR])
    targets = ankles - [0.0, floor, 0.0]
    above = heights - floor
    for k in range(len(SIDES)):
        shift = np.zeros_like(balls[:, k])
        apart = np.sign(above[:, k]) * np.maximum(np.abs(above[:, k]) - _TOUCHING, 0.0)
        shift[:, 1] = np.where(np.abs(above[:, k]) < _NEAR_FLOOR, -apart, 0.0)
        for stand in _runs(still[:, k]):
            drift = (ankles[stand, k] + balls[stand, k])[:, [0, 2]]
            shift[stand, ::2] = drift.mean(axis=0) - drift
        size = np.linalg.norm(shift[:, ::2], axis=1, keepdims=True)
        shift[:, ::2] *= np.minimum(1.0, _MOST_SHIFT / np.maximum(size, _MOST_SHIFT))
        # In between, feet move from one place to the next.
        frames, known = np.arange(len(shift)), np.flatnonzero(still[:, k])
        for column in shift.T:
            column[:] = np.interp(frames, known, column[known]) if len(known) else 0.0
        shift[:, 1] += np.maximum(0.0, -(above[:, k] + shift[:, 1] + _TOUCHING))
        targets[:, k] += shift
    return targets


def _sole(
    model: BodyModel, body: Skeleton, surface: ndarray, rotations: ndarray, side: str
) -> tuple[ndarray, ndarray]:
    """Return the height of a foot's lowest vertex, and its ball, relative to its ankle."""
    names = [f"{side}_{part}" for part in ("ankle", "toes")]
    foot = [body.joints[name] for name in names if name in body.joints]
    weights = model.weights[:, foot]
    vertices = np.flatnonzero(weights.sum(axis=1) > 0.5)
    vertices = vertices[np.argsort(surface[vertices] @ body.frame[:, 0])[:_SOLE_VERTICES]]
    ball = rotations[:, foot[0]] @ (body.rest[foot[-1]] - body.rest[foot[0]])
    heights = np.zeros((len(rotations), len(vertices)))
    for k, joint in enumerate(foot):
        share = weights[vertices, k] / weights[vertices].sum(axis=1)
        moved = (surface[vertices] - body.rest[joint]) @ rotations[:, joint, 1].T
        heights += share * (moved.T + (ball[:, 1:2] if k else 0.0))
    return heights.min(axis=1), ball


def _runs(mask: ndarray) -> list[slice]:
    """Return the runs of true entries."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def _reach(body: Skeleton, rotations: ndarray, positions: ndarray, targets: ndarray) -> None:
    """Bend hips and knees until ankles are at their targets; move the body so that they bend least.

    The shift of the body in each frame minimises the squared changes of directions of thighs and
    shanks, by Levenberg and Marquardt's method.
    """
    legs = [_Limb(body, rotations, leg) for leg in LIMBS[:2]]
    hips = [positions[:, body.joints[leg[0]]] for leg in LIMBS[:2]]

    def residuals(shift: ndarray) -> ndarray:
        parts = [_SHIFT_WEIGHT * shift]
        for leg, hip, target in zip(legs, hips, np.moveaxis(targets, 1, 0), strict=True):
            thigh, shank, missed = leg.directions(target - hip - shift)
            parts += [thigh - leg.thigh, shank - leg.shank, _MISS_WEIGHT * missed]
        return np.concatenate(parts, axis=1)

    shift = np.zeros((len(targets), 3))
    damping = np.full(len(targets), 1e-2)
    left = residuals(shift)
    for _ in range(_REACH_STEPS):
        slopes = [(residuals(shift + step) - left) / _STEP for step in _STEP * np.eye(3)]
        jacobian = np.stack(slopes, axis=-1)
        normal = np.swapaxes(jacobian, -1, -2) @ jacobian + damping[:, None, None] * np.eye(3)
        gradient = np.swapaxes(jacobian, -1, -2) @ left[..., None]
        tried = shift - np.linalg.solve(normal, gradient)[..., 0]
        rest = residuals(tried)
        better = np.sum(rest**2, axis=1) < np.sum(left**2, axis=1)
        shift[better], left[better] = tried[better], rest[better]
        damping *= np.where(better, 0.2, 5.0)
    positions += shift[:, None]
    for leg, hip, target in zip(legs, hips, np.moveaxis(targets, 1, 0), strict=True):
        leg.apply(rotations, *leg.towards(target - hip - shift))


class _Limb:
    """An arm or a leg in all frames, and its bones where the wrist or ankle is elsewhere."""

    def __init__(self, body: Skeleton, rotations: ndarray, names: tuple[str, ...]) -> None:
        self.hip, self.knee, _ = (body.joints[name] for name in names)
        bones = body.bone(*names[:2]), body.bone(*names[1:])
        self._lengths = [float(np.linalg.norm(bone)) for bone in bones]
        self.thigh = rotations[:, self.hip] @ unit(bones[0])
        self.shank = rotations[:, self.knee] @ unit(bones[1])
        # A straight knee bends about its hinge, a bent one in its plane.
        hinge = rotations[:, self.hip] @ _model_hinge(body, names)
        self._axis = np.cross(self.thigh, self.shank) + _HINGE_SHARE * hinge

    def directions(self, to_ankle: ndarray) -> tuple[ndarray, ndarray, ndarray]:
        """Return the directions of thigh and shank, and how much the ankle is beyond reach."""
        a, b = self._lengths
        length = np.linalg.norm(to_ankle, axis=1, keepdims=True)
        reached = np.clip(length, abs(a - b) + 1e-6, _STRETCHED * (a + b))
        towards = unit(to_ankle)
        forward = unit(np.cross(towards, self._axis))
        along = (reached**2 + a**2 - b**2) / (2.0 * reached)
        knee = along * towards + np.sqrt(np.maximum(a**2 - along**2, 0.0)) * forward
        return knee / a, (reached * towards - knee) / b, length - reached

    def towards(self, to_ankle: ndarray) -> tuple[ndarray, ndarray]:
        """Return the directions with the ankle as near as they may go, by bisection."""
        a, b = self._lengths
        recorded = a * self.thigh + b * self.shank
        low, high = np.zeros((len(to_ankle), 1)), np.ones((len(to_ankle), 1))
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            thigh, shank, _ = self.directions(recorded + middle * (to_ankle - recorded))
            cosines = [
                np.sum(new * old, axis=1) for new, old in ((thigh, self.thigh), (shank, self.shank))
            ]
            near = np.minimum(*cosines)[:, None] > _LEAST_COSINE
            low, high = np.where(near, middle, low), np.where(near, high, middle)
        thigh, shank, _ = self.directions(recorded + low * (to_ankle - recorded))
        return thigh, shank

    def apply(self, rotations: ndarray, thigh: ndarray, shank: ndarray) -> None:
        """Turn the bones to directions."""
        for joint, old, new in ((self.hip, self.thigh, thigh), (self.knee, self.shank, shank)):
            rotations[:, joint] = shortest(old, new) @ rotations[:, joint]


def _positions(body: Skeleton, rotations: ndarray, order: Sequence[int]) -> ndarray:
    """Return the positions of the joints with the root at its place in the rest pose."""
    positions = np.empty(rotations.shape[:-1])
    for joint in order:
        parent = body.parents[joint]
        if parent < 0:
            positions[:, joint] = body.rest[joint]
        else:
            bone = body.rest[joint] - body.rest[parent]
            positions[:, joint] = positions[:, parent] + rotations[:, parent] @ bone
    return positions


def _errors(
    source: RecordedSkeleton, body: Skeleton, positions: ndarray, scale: float
) -> RetargetingErrors:
    angles = []
    for first, second in BONES:
        bone = unit(positions[:, body.joints[second]] - positions[:, body.joints[first]])
        angles.append(angles_between(bone, source.direction(first, second)))
    hips, shoulders = (body.middle(positions, part) for part in ("hip", "shoulder"))
    angles.append(angles_between(unit(shoulders - hips), unit(source.trunk)))
    names = [name for limb in LIMBS for name in limb]
    apart = [
        positions[:, body.joints[name]]
        - hips
        - scale * (source.positions[:, source.joints[name]] - source.hips)
        for name in names
    ]
    return RetargetingErrors(
        (*BONES, ("hips", "shoulders")),
        np.degrees(np.stack(angles, axis=1)),
        tuple(names),
        np.linalg.norm(np.stack(apart, axis=1), axis=-1),
    )


def _similar_person(source: RecordedSkeleton, model: BodyModel, joints: dict[str, int]) -> ndarray:
    """Return the shape coefficients of a person with the recorded proportions."""
    lengths = []
    for first, second in (*BONES, ("left_shoulder", "right_shoulder")):
        ends = [source.positions[:, source.joints[name]] for name in (first, second)]
        lengths.append(np.median(np.linalg.norm(ends[1] - ends[0], axis=1)))
    recorded = np.array([*lengths, np.median(np.linalg.norm(source.trunk, axis=1))])
    mean = model.joints()
    changes = np.tensordot(model.joint_regressor, model.shapedirs, axes=1)

    def residuals(unknown: ndarray) -> ndarray:
        scale, betas = unknown[0], unknown[1:]
        body = Skeleton(model.parents, mean + changes @ betas, joints)
        bones = [body.bone(*bone) for bone in (*BONES, ("left_shoulder", "right_shoulder"))]
        bones.append(body.middle(body.rest, "shoulder") - body.middle(body.rest, "hip"))
        apart = np.linalg.norm(bones, axis=1) - scale * recorded
        return np.concatenate([apart / _LENGTH_DEVIATION, betas])

    leg = Skeleton(model.parents, mean, joints).leg / source.leg
    start = np.concatenate([[leg], np.zeros(model.n_betas)])
    bounds = (
        np.concatenate([[0.5 * leg], np.full(model.n_betas, -_MOST_BETA)]),
        np.concatenate([[2.0 * leg], np.full(model.n_betas, _MOST_BETA)]),
    )
    return np.asarray(
        least_squares(
            residuals, start, bounds=bounds, x_scale=np.abs(start) + 1.0 * (start == 0)
        ).x[1:]
    )


def _interpolated(start: ndarray, end: ndarray, n: int) -> list[ndarray]:
    """Return n rotations from a rotation to another, in each frame."""
    vectors = Rotation.from_matrix(np.swapaxes(start, -1, -2) @ end).as_rotvec()
    shares = np.linspace(0.0, 1.0, n) if n > 1 else [0.0]
    return [start @ Rotation.from_rotvec(share * vectors).as_matrix() for share in shares]
