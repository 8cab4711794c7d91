"""Motion capture in BVH files: a skeleton, and the rotations of its joints over time."""

from __future__ import annotations

import os
import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array
from riemhuman.checks import checked, checked_rate
from riemhuman.errors import FileFormatError
from riemhuman.io.files import file_path, format_errors
from riemhuman.mocap._text_lines import TextLines
from riemhuman.mocap._units import metres_in
from riemhuman.mocap.skeleton_motion import SkeletonMotion

# A joint's channels are numbers of these: positions are 0 to 2, rotations 3 to 5.
_CHANNELS = ("XPOSITION", "YPOSITION", "ZPOSITION", "XROTATION", "YROTATION", "ZROTATION")
# Shorter times from frame to frame, seconds, are damage. A longer one is no time, but the number of
# frames in a second, for instance.
_SHORTEST, _LONGEST = 1e-5, 1.0


@checked(frames_per_second=checked_rate)
def load_bvh(
    path: str | os.PathLike[str],
    *,
    unit: str | float | None = None,
    frames_per_second: float | None = None,
) -> SkeletonMotion:
    """Read a motion capture recording in a BVH file.

    Channels may be in any order, with any number of rotations about any axes; position channels
    replace the coordinates of offsets, as in most programs.

    Parameters
    ----------
    path : path_like
    unit : str or number, optional
        Unit of the file's lengths, which the format does not specify: "m", "cm", "mm", "inch",
        "foot", "yard", in words or abbreviated, or the number of metres in a unit. Lengths are then
        returned in metres; by default they are in the unit of the file.
    frames_per_second : float, optional
        Frame rate, for files whose Frame Time cannot be right: above one second.

    Examples
    --------
    >>> rh.datasets.load_bvh("walk.bvh").joint_names[0]  # doctest: +SKIP
    'Hips'
    """
    metres = 1.0 if unit is None else metres_in(unit)
    file = file_path(path)
    lines = TextLines(file)
    joints, values, frame_time = _Reader(lines).read()
    if frame_time > _LONGEST:
        if frames_per_second is None:
            raise FileFormatError(
                f"{file} states a Frame Time of {frame_time:g} seconds, which no recording has; "
                "pass frames_per_second="
            )
        frame_time = 1.0 / frames_per_second
    with format_errors(file, "a BVH recording"):
        offsets = np.array([joint.offset for joint in joints])
        rotations = np.empty((len(values), len(joints), 3, 3))
        translations = np.tile(offsets, (len(values), 1, 1))
        columns = iter(values.T)
        for number, joint in enumerate(joints):
            angles: list[Array] = []
            axes = ""
            for channel in joint.channels:
                axis, numbers = channel % 3, next(columns)
                if channel < 3:
                    translations[:, number, axis] = numbers
                else:
                    axes += "XYZ"[axis]
                    angles.append(numbers)
            rotations[:, number] = _matrices(axes, angles)
        return SkeletonMotion(
            tuple(joint.name for joint in joints),
            np.array([joint.parent for joint in joints]),
            metres * offsets,
            rotations,
            metres * translations,
            1.0 / frame_time,
            file.stem,
            None if unit is None else "metres",
        )


def _matrices(axes: str, angles: list[Array]) -> Array:
    """Return rotations by angles, degrees, about moving axes: any number, in any order."""
    if len(axes) == 3 and axes[0] != axes[1] != axes[2]:
        turned = Rotation.from_euler(axes, np.stack(angles, axis=-1), degrees=True)
        return np.asarray(turned.as_matrix())
    rotation = np.eye(3)
    for axis, numbers in zip(axes, angles, strict=True):
        turned = Rotation.from_euler(axis.lower(), numbers[:, None], degrees=True)
        rotation = rotation @ turned.as_matrix()
    return rotation


@dataclass
class _Joint:
    """A joint of the hierarchy; its channels are numbers of `_CHANNELS`."""

    name: str
    parent: int
    offset: list[float] = field(default_factory=list)
    channels: list[int] = field(default_factory=list)


class _Reader:
    """Reads the hierarchy of a file word by word, and its frames line by line."""

    def __init__(self, lines: TextLines) -> None:
        self._lines = lines
        # A brace is a word of its own, whatever is beside it.
        self._words = (word for line in lines for word in re.findall(r"[{}]|[^{}\s]+", line))

    def _next(self, *expected: str) -> str:
        """Return the next word in capitals, which must be one of the given words."""
        word = next(self._words, "the end of the file")
        if word.upper() not in expected:
            raise self._lines.error(f"{' or '.join(expected)} expected; found {word[:60]!r}")
        return word.upper()

    def read(self) -> tuple[list[_Joint], Array, float]:
        """Return the joints, the numbers of all frames and the time from frame to frame."""
        joints: list[_Joint] = []
        self._next("HIERARCHY")
        self._next("ROOT")
        self._read_joints(joints)
        while self._next("ROOT", "MOTION") == "ROOT":
            self._read_joints(joints)
        values, frame_time = self._read_frames(sum(len(joint.channels) for joint in joints))
        return joints, values, frame_time

    def _read_joints(self, joints: list[_Joint]) -> None:
        """Read a root and all joints below it."""
        branch = [self._begin_joint(joints, -1)]
        while branch:
            joint = joints[branch[-1]]
            keyword = self._next("OFFSET", "CHANNELS", "JOINT", "END", "}")
            if keyword == "OFFSET":
                joint.offset = self._numbers(3)
            elif keyword == "CHANNELS":
                joint.channels = self._read_channels()
            elif keyword == "JOINT":
                branch.append(self._begin_joint(joints, branch[-1]))
            elif keyword == "END":
                self._read_name()
                self._next("OFFSET")
                joints.append(_Joint(f"{joint.name} end", branch[-1], self._numbers(3)))
                self._next("}")
            elif not joint.offset:
                raise self._lines.error(f"joint {joint.name} has no OFFSET")
            else:
                branch.pop()

    def _begin_joint(self, joints: list[_Joint], parent: int) -> int:
        joints.append(_Joint(self._read_name(), parent))
        return len(joints) - 1

    def _read_name(self) -> str:
        """Return the words before an opening brace."""
        words: list[str] = []
        for word in self._words:
            if word == "{":
                break
            words.append(word)
        if not words:
            raise self._lines.error("the joint has no name")
        return " ".join(words)

    def _numbers(self, count: int) -> list[float]:
        words = [next(self._words, "the end of the file") for _ in range(count)]
        return self._lines.finite(words)

    def _read_channels(self) -> list[int]:
        (count,) = self._numbers(1)
        channels: list[int] = []
        while len(channels) < count:
            channels.append(_CHANNELS.index(self._next(*_CHANNELS)))
        positions = [channel for channel in channels if channel < 3]
        if len(set(positions)) < len(positions):
            raise self._lines.error("a position channel is repeated")
        return channels

    def _read_frames(self, n_channels: int) -> tuple[Array, float]:
        # Numbers belong to their lines: a missing one must not shift all that follow.
        lines = (line for line in self._lines if line.strip())
        n_frames = self._read_value(lines, "Frames")
        frame_time = self._read_value(lines, "Frame Time")
        # Grows with the numbers that are read, whatever the file declares.
        values, count = array("d"), 0
        for line in lines:
            words = line.split()
            if len(words) != n_channels:
                raise self._lines.error(f"{n_channels} numbers expected; found {len(words)}")
            values.extend(self._lines.floats(words))
            count += 1
        table = np.array(values).reshape(count, n_channels)
        if not count or count != n_frames:
            raise self._lines.error(f"Frames says {n_frames:g}, but {count} follow")
        return table, frame_time

    def _read_value(self, lines: Iterator[str], name: str) -> float:
        line = next(lines, "the end of the file")
        key, _, value = line.partition(":")
        if " ".join(key.lower().split()) != name.lower():
            raise self._lines.error(f"{name}: expected; found {line[:60]!r}")
        (number,) = self._lines.finite([value])
        if not number > _SHORTEST:
            raise self._lines.error(f"{name} must be above {_SHORTEST:g}; found {number:g}")
        return number
