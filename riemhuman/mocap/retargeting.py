"""Recordings performed by a person of a body model, see `riemhuman.mocap`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import replace
from functools import cached_property

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Integers
from riemhuman.bodies import BodyModel
from riemhuman.bodies.open_model import load_open_model
from riemhuman.checks import (
    checked,
    checked_rate,
    choice,
    flag,
    instance,
    one_of,
    real_array,
)
from riemhuman.mocap._body_size import own_person, recorded_person, scaled_model
from riemhuman.mocap._joint_axes import make_figure
from riemhuman.mocap._joint_names import find_joints, model_joints
from riemhuman.mocap._skeletons import check_bones, leg_length
from riemhuman.mocap._units import metres_in
from riemhuman.mocap.motions import ModelMotion
from riemhuman.mocap.performances import Performed, RetargetingErrors, perform
from riemhuman.mocap.skeleton_motion import SkeletonMotion, nearest_frames
from riemhuman.surfaces.procrustes import AXES

# Distances from recorded joints that the message says, metres.
_UNLIKE = 0.10
_RECORDED = "recorded"


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
        Indices of joints in the recording, by their names in the open model.
    up : str, or function that returns it, optional
        As for `retarget`.
    size : float
        Factor by which bodies of the model are enlarged.
    progress : bool
        As for `retarget`.

    Attributes
    ----------
    message : str
        Assumptions about lengths: the person, and the unit of the recording.

    Examples
    --------
    >>> jump = rh.datasets.retarget(rh.datasets.load_bvh("jump.bvh"))  # doctest: +SKIP
    >>> other = jump.performed_by(-jump.betas)  # doctest: +SKIP
    """

    # More than eight arguments: the recording, and what readers know about its file.
    def __init__(
        self,
        recording: SkeletonMotion | Callable[[], SkeletonMotion],
        model: BodyModel,
        names: tuple[str, str],
        frames_per_second: float,
        n_frames: int,
        *,
        betas: Array | None = None,
        joints: Mapping[str, int] | None = None,
        up: str | Callable[[], str] | None = None,
        size: float = 1.0,
        progress: bool = False,
    ) -> None:
        performer = model if size == 1.0 else scaled_model(model, size)
        super().__init__(*names, frames_per_second, n_frames, performer)
        self._recording = recording
        self._joints = joints
        self._up = up
        self._betas = np.zeros(model.n_betas) if betas is None else betas
        self._unscaled = model
        self._size = size
        self._progress = progress

    @property
    def recording(self) -> SkeletonMotion:
        """The recorded skeleton."""
        recording = self._recording
        return recording if isinstance(recording, SkeletonMotion) else recording()

    @property
    def betas(self) -> Array:
        return self._betas

    @property
    def errors(self) -> RetargetingErrors:
        """How far the motion is from the recording."""
        return self._played.errors

    @property
    def message(self) -> str:
        """How the lengths of the recording were treated."""
        scale = self.errors.scale
        apart = self.errors.positions.mean(axis=0)
        worst = self.errors.joints[int(apart.argmax())]
        proportions = ""
        if apart.max() > _UNLIKE:
            proportions = (
                f". The proportions differ: {worst} is {100.0 * apart.max():.0f} cm off on average"
            )
        person = "a person" if self.betas.any() else "an average adult"
        if self._size == 1.0:
            return (
                f"The recording was scaled to the legs of {person} of the model: one unit of the "
                f"recording is {scale:.4g} m. Pass unit= to keep the recorded lengths{proportions}"
            )
        return (
            f"The recorded lengths were kept: one unit of the recording is {scale:.4g} m. Bodies "
            f"of the model were scaled by {self._size:.3f}, so that {person} has the recorded "
            f"legs{proportions}"
        )

    def performed_by(self, betas: ArrayLike) -> RetargetedMotion:
        """Return the same motion performed by another person, with that person's proportions.

        Parameters
        ----------
        betas : array_like, shape (B,)
        """
        performance = copy(self)
        performance.__dict__.pop("_played", None)  # kept of the person before
        performance._betas = real_array(betas, "betas", (self.model.n_betas,), batched=False)
        performance.model = self._unscaled
        performance._size = 1.0
        return performance

    def _parameters(self, numbers: Integers) -> tuple[Array, Array]:
        return self._played.poses[numbers], self._played.translations[numbers]

    @cached_property
    def _played(self) -> Performed:
        up = self._up() if callable(self._up) else self._up
        return perform(self.recording, self.model, self._betas, self._joints, up, self._progress)


@checked(
    recording=instance(SkeletonMotion),
    model=instance(BodyModel),
    up=choice(*AXES),
    frames_per_second=checked_rate,
    progress=flag,
)
def retarget(
    recording: SkeletonMotion,
    model: BodyModel | None = None,
    *,
    betas: ArrayLike | None = None,
    joints: Mapping[str, str] | None = None,
    up: str | None = None,
    unit: str | float | None = None,
    frames_per_second: float | None = None,
    progress: bool = False,
) -> RetargetedMotion:
    """Return the motion of a body that moves as a recorded skeleton does.

    The recording may have any rest pose, axes, units and proportions. The axes of joints are found
    from their positions over the frames; what positions do not determine, such as how far the head
    is lowered, is measured relative to its mean. Limbs follow the recorded directions within 3.8
    degrees, the trunk almost exactly. Feet that stand still are level and stay in place, and
    nothing sinks into the floor by more than 5 mm. A warning says if pelvis, chest, head, a bone or
    a line is off by more than 15 degrees on average, and if no person has the proportions.

    A recording of the model's own skeleton, as written by `Motion.save`, is played unchanged, by
    the person whose bones it has.

    Parameters
    ----------
    recording : SkeletonMotion
        Recorded skeleton, from `load_bvh`, with hips, knees, ankles, shoulders, elbows and wrists.
    model : BodyModel, optional
        Model with named joints, or with those of SMPL; by default the open model, "coarse".
    betas : array_like, shape (B,), or "recorded", optional
        Shape coefficients of the person; by default zeros, an average adult. "recorded" chooses a
        person whose bones have the recorded lengths. These do not determine the body shape, and
        joints may be placed differently in the recording, so girths and mass may not belong to any
        real person.
    joints : mapping of str to str, optional
        Names of joints in the recording by those of the open model, such as ``{"left_hip":
        "LeftUpLeg"}``, for joints that are not recognised. If names do not identify the joints,
        they are inferred from the shape of the skeleton, with a warning that lists them.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis of the recording that points up; by default it is found, with a warning if people might
        as well be lying on the floor as standing along another axis.
    unit : str or number, optional
        Unit of the recording's lengths: "m", "cm", "mm", "inch", "foot", in words or abbreviated,
        or the number of metres in a unit; by default that of the recording, if it is known. The
        person is then scaled to the recorded legs: a child, an adult and a giant keep their
        lengths. Without a unit, the recording is scaled to the legs of the person, as it is by
        ``performed_by(betas)``.
    frames_per_second : float, optional
        Frame rate, at most that of the recording: the frames nearest in time are used.
    progress : bool
        Whether to show a progress bar when frames are first asked for, which is when the whole
        recording is performed.

    Examples
    --------
    >>> jump = rh.datasets.retarget(rh.datasets.load_bvh("jump.bvh"))  # doctest: +SKIP
    """
    model = load_open_model("coarse") if model is None else model
    if not (betas is None or isinstance(betas, str)):
        betas = real_array(betas, "betas", (model.n_betas,), batched=False)
    elif betas is not None:
        one_of(betas, "betas", (_RECORDED,))
    if unit is not None:
        recording = replace(recording, unit=unit)
    metres = None if recording.unit is None else metres_in(recording.unit)
    model_joints(model)
    rate = recording.frames_per_second
    if frames_per_second is not None:
        rate = frames_per_second
        recording = _thinned(recording, rate)
    joint_numbers = find_joints(
        recording.joint_names, recording.parents, joints, recording.positions
    )
    check_bones(recording.positions, joint_numbers, recording.joint_names)
    size = 1.0
    performer = own_person(recording, model)
    if performer is not None and (betas is None or isinstance(betas, str)):
        betas = performer.betas
        size = performer.size
        metres = None
    elif isinstance(betas, str):
        betas = recorded_person(recording.positions, joint_numbers, model)
    if metres is not None:
        leg = leg_length(recording.positions, joint_numbers)
        person = np.zeros(model.n_betas) if betas is None else betas
        size = metres * leg / make_figure(model, person).leg
    return RetargetedMotion(
        recording,
        model,
        ("", recording.name),
        rate,
        len(recording),
        betas=betas,
        joints=joint_numbers,
        up=up,
        size=size,
        progress=progress,
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
