"""A recorded skeleton, and the rotations of its joints over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.bodies.skinning import check_parents
from riemhuman.checks import check_shape, checked, checked_rate, flag, instance, real_array
from riemhuman.checks.labels import texts_of
from riemhuman.errors import ArgumentError, warn
from riemhuman.mocap._units import metres_in
from riemhuman.representation import Record

# Largest and smallest skeletons of people, from newborns to giants with raised arms and props,
# metres, and number of frames in which they are measured.
_SMALLEST, _LARGEST = 0.3, 5.0
_FRAMES_MEASURED = 20


@checked(
    joint_names=texts_of,
    parents=lambda parents, _: check_parents(parents),
    frames_per_second=checked_rate,
    name=instance(str, "a text"),
    has_rest_pose=flag,
)
@dataclass(frozen=True, eq=False, repr=False)
class SkeletonMotion(Record):
    """A skeleton, and the rotations and translations of its joints over time.

    Parents come before their children, and lengths are in the unit of the file. End sites, such as
    tips of the toes, are joints that do not rotate, named after their parents: "LeftToeBase end".

    Attributes
    ----------
    joint_names : tuple of str, length J
    parents : array of int, shape (J,)
        Number of each joint's parent; -1 for a root.
    offsets : array, shape (J, 3)
        Positions of the joints relative to their parents, in the rest pose.
    rotations : array, shape (n_frames, J, 3, 3)
        Rotation matrices relative to the parents; identities in the rest pose.
    translations : array, shape (n_frames, J, 3)
        Positions relative to the parents: the offsets, unless the file has others.
    frames_per_second : float
    name : str
        Name of the file without its ending.
    unit : str, number or None
        Unit of lengths, as for `load_bvh`, or None if it is unknown.
    has_rest_pose : bool
        Whether the offsets are a pose at rest; those between markers are means over the frames.

    Examples
    --------
    >>> rh.datasets.load_bvh("walk.bvh").positions.shape  # doctest: +SKIP
    (240, 38, 3)
    """

    joint_names: tuple[str, ...]
    parents: Integers
    offsets: Array
    rotations: Array
    translations: Array
    frames_per_second: float
    name: str = ""
    unit: str | float | None = None
    has_rest_pose: bool = True

    def __post_init__(self) -> None:
        n_joints, parents = len(self.joint_names), self.parents
        check_shape(parents, "parents", (n_joints,), batched=False)
        forward = np.flatnonzero(parents >= np.arange(n_joints))
        if len(forward):
            raise ArgumentError(
                f"parents must come before their children; found {parents[forward[0]]} as the "
                f"parent of joint {forward[0]}"
            )
        offsets = real_array(self.offsets, "offsets", (n_joints, 3), batched=False)
        turns = real_array(
            self.rotations, "rotations", ("n_frames", n_joints, 3, 3), batched=False, maximum=2.0
        )
        places = (len(turns), n_joints, 3)
        steps = real_array(self.translations, "translations", places, batched=False)
        if not len(turns):
            raise ArgumentError("rotations must hold at least one frame; found none")
        # As the class is frozen; what was checked takes the place of what was given.
        vars(self).update(offsets=offsets, rotations=turns, translations=steps)
        if self.unit is not None:
            self._check_size(metres_in(self.unit))

    def _check_size(self, metres: float) -> None:
        """Warn if no person is as large as the skeleton in its unit."""
        frames = np.unique(np.linspace(0, len(self) - 1, _FRAMES_MEASURED).astype(np.int64))
        _, positions = in_space(self.rotations[frames], self.translations[frames], self.parents)
        sizes = np.linalg.norm(np.ptp(positions, axis=1), axis=-1)
        size = metres * float(np.median(sizes))
        if not _SMALLEST < size < _LARGEST:
            warn(
                f"{self.name or 'recording'}: the skeleton is {size:.3g} m large in its unit, as "
                "no person is; pass unit= if that is wrong",
                UserWarning,
            )

    def __len__(self) -> int:
        return len(self.rotations)

    @cached_property
    def global_rotations(self) -> Array:
        """Rotation matrices of the joints in space, shape (n_frames, J, 3, 3)."""
        return self._places[0]

    @cached_property
    def positions(self) -> Array:
        """Positions of the joints in space, shape (n_frames, J, 3)."""
        return self._places[1]

    @cached_property
    def _places(self) -> tuple[Array, Array]:
        return in_space(self.rotations, self.translations, self.parents)


def in_space(rotations: Array, translations: Array, parents: Integers) -> tuple[Array, Array]:
    """Return rotations and positions in space from those relative to the parents."""
    turned, positions = rotations.copy(), translations.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            turned[:, joint] = turned[:, parent] @ rotations[:, joint]
            steps = np.einsum("tij,tj->ti", turned[:, parent], translations[:, joint])
            positions[:, joint] = positions[:, parent] + steps
    return turned, positions


def nearest_frames(n_frames: int, recorded_rate: float, frames_per_second: float) -> Integers:
    """Return the frames nearest in time to those at a lower frame rate."""
    rate = checked_rate(frames_per_second)
    if rate > recorded_rate * (1.0 + 1e-6):
        raise ArgumentError(
            "frames_per_second must be at most that of the recording, "
            f"{recorded_rate:g}; found {rate:g}"
        )
    count = int((n_frames - 1) * rate / recorded_rate + 1e-9) + 1
    numbers = np.rint(np.arange(count) * (recorded_rate / rate)).astype(np.int64)
    nearest: Integers = np.minimum(numbers, n_frames - 1)
    return nearest
