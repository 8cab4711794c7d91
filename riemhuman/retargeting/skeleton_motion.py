"""A recorded skeleton, and the rotations of its joints over time."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from riemhuman.arrays import Array, Integers
from riemhuman.checks import real_number
from riemhuman.errors import ArgumentError
from riemhuman.representation import Record


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

    def __len__(self) -> int:
        return len(self.rotations)

    @cached_property
    def global_rotations(self) -> Array:
        """Rotation matrices of the joints in space, shape (n_frames, J, 3, 3)."""
        rotations = self.rotations.copy()
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                rotations[:, joint] = rotations[:, parent] @ self.rotations[:, joint]
        return rotations

    @cached_property
    def positions(self) -> Array:
        """Positions of the joints in space, shape (n_frames, J, 3)."""
        positions = self.translations.copy()
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                steps = np.einsum(
                    "tij,tj->ti", self.global_rotations[:, parent], self.translations[:, joint]
                )
                positions[:, joint] = positions[:, parent] + steps
        return positions


def nearest_frames(n_frames: int, recorded_rate: float, frames_per_second: float) -> Integers:
    """Return the frames nearest in time to those at a lower frame rate."""
    rate = real_number(frames_per_second, "frames_per_second", minimum=0.0, strict=True)
    if rate > recorded_rate * (1.0 + 1e-6):
        raise ArgumentError(
            "frames_per_second must be at most that of the recording, "
            f"{recorded_rate:g}; found {rate:g}"
        )
    count = int((n_frames - 1) * rate / recorded_rate + 1e-9) + 1
    numbers = np.rint(np.arange(count) * (recorded_rate / rate)).astype(np.int64)
    nearest: Integers = np.minimum(numbers, n_frames - 1)
    return nearest
