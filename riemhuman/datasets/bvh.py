"""Motion capture in BVH files: a skeleton, and the rotations of its joints over time."""

from __future__ import annotations

import math
import os
import re
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from riemhuman.checks import real_number
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.arrays import memory_limit
from riemhuman.io.files import file_path, read_bytes
from riemhuman.representation import Record

_CHANNELS = tuple(f"{axis}{kind}" for kind in ("position", "rotation") for axis in "XYZ")
# Bytes of the rotation and the translation of a joint in a frame.
_BYTES_OF_JOINT = 96
# Messages quote at most so many characters of a file.
_LONGEST_QUOTE = 60


@dataclass(frozen=True, eq=False, repr=False)
class SkeletonMotion(Record):
    """A skeleton, and the rotations and translations of its joints over time.

    Parents come before their children. Lengths are in the unit of the file.

    Attributes
    ----------
    joint_names : tuple of str
        Names of the J joints.
    parents : array of int, shape (J,)
        Number of each joint's parent; -1 for a root.
    offsets : array, shape (J, 3)
        Positions of the joints relative to their parents, in the rest pose.
    end_joints : array of int, shape (E,)
        Numbers of the joints that bear end sites, such as tips of the toes.
    end_offsets : array, shape (E, 3)
        Positions of the end sites relative to these joints.
    rotations : array, shape (n_frames, J, 3, 3)
        Rotation matrices relative to the parents; identities in the rest pose.
    translations : array, shape (n_frames, J, 3)
        Positions relative to the parents: the offsets, where the file has no others.
    frames_per_second : float
        Frame rate.
    name : str
        Name of the recording: that of the file without its ending.

    Examples
    --------
    >>> import riemhuman as rh
    >>> motion = rh.datasets.load_bvh("walk.bvh")  # doctest: +SKIP
    >>> motion.positions.shape  # doctest: +SKIP
    (240, 31, 3)
    """

    joint_names: tuple[str, ...]
    parents: np.ndarray
    offsets: np.ndarray
    end_joints: np.ndarray
    end_offsets: np.ndarray
    rotations: np.ndarray
    translations: np.ndarray
    frames_per_second: float
    name: str = ""

    def __len__(self) -> int:
        return len(self.rotations)

    def at_rate(self, frames_per_second: float) -> SkeletonMotion:
        """Return the motion at a lower frame rate: the frames nearest in time.

        Parameters
        ----------
        frames_per_second : float
            Frame rate, at most that of the recording.

        Returns
        -------
        SkeletonMotion
        """
        frames = nearest_frames(len(self), self.frames_per_second, frames_per_second)
        rotations, translations = self.rotations[frames], self.translations[frames]
        rate = float(frames_per_second)
        return replace(self, rotations=rotations, translations=translations, frames_per_second=rate)

    @cached_property
    def global_rotations(self) -> np.ndarray:
        """Rotation matrices of the joints in space, shape (n_frames, J, 3, 3)."""
        rotations = self.rotations.copy()
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                rotations[:, joint] = rotations[:, parent] @ self.rotations[:, joint]
        return rotations

    @cached_property
    def positions(self) -> np.ndarray:
        """Positions of the joints in space, shape (n_frames, J, 3)."""
        positions = self.translations.copy()
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                steps = self.global_rotations[:, parent] @ self.translations[:, joint, :, None]
                positions[:, joint] = positions[:, parent] + steps[..., 0]
        return positions

    @cached_property
    def end_positions(self) -> np.ndarray:
        """Positions of the end sites in space, shape (n_frames, E, 3)."""
        steps = self.global_rotations[:, self.end_joints] @ self.end_offsets[..., None]
        return self.positions[:, self.end_joints] + steps[..., 0]


def load_bvh(path: str | os.PathLike[str]) -> SkeletonMotion:
    """Read a motion capture recording in a BVH file.

    Channels may be in any order, with any number of rotations about any axes; position channels
    replace the coordinates of offsets, as in most programs.

    Parameters
    ----------
    path : path_like
        The file.

    Returns
    -------
    SkeletonMotion

    Raises
    ------
    FileFormatError
        If the file is damaged; the message gives the line.

    Examples
    --------
    >>> import riemhuman as rh
    >>> motion = rh.datasets.load_bvh("walk.bvh")  # doctest: +SKIP
    >>> motion.joint_names[0]  # doctest: +SKIP
    'Hips'
    """
    file = file_path(path)
    content = read_bytes(file)
    reader = _Reader(file, content.decode("utf-8-sig", errors="replace").splitlines())
    skeleton = reader.read_hierarchy()
    values, frames_per_second = reader.read_frames(sum(map(len, skeleton.channels)))
    offsets = np.array(skeleton.offsets)
    if _BYTES_OF_JOINT * len(values) * len(offsets) > memory_limit(len(content)):
        raise FileFormatError(
            f"{file}: {len(offsets)} joints in {len(values)} frames take far more memory than a "
            "file of its size may"
        )
    rotations = np.empty((len(values), len(offsets), 3, 3))
    translations = np.tile(offsets, (len(values), 1, 1))
    column = 0
    for joint, channels in enumerate(skeleton.channels):
        own = values[:, column : column + len(channels)]
        column += len(channels)
        rotation = np.eye(3)
        for channel, numbers in zip(channels, own.T, strict=True):
            axis = channel % 3
            if channel < 3:
                translations[:, joint, axis] = numbers
            else:
                rotation = rotation @ _about_axis(axis, np.radians(numbers))
        rotations[:, joint] = rotation
    return SkeletonMotion(
        tuple(skeleton.names),
        np.array(skeleton.parents),
        offsets,
        np.array(skeleton.end_joints, dtype=np.int64),
        np.array(skeleton.end_offsets).reshape(-1, 3),
        rotations,
        translations,
        frames_per_second,
        file.stem,
    )


def nearest_frames(n_frames: int, recorded: float, wanted: Any) -> np.ndarray:
    """Return the frames nearest in time to those at a lower frame rate."""
    rate = real_number(wanted, "frames_per_second", minimum=0.0, strict=True)
    if rate > recorded * (1.0 + 1e-6):
        raise ArgumentError(
            f"frames_per_second must be at most that of the recording, {recorded:g}; found {rate:g}"
        )
    wanted_frames = int((n_frames - 1) * rate / recorded + 1e-9) + 1
    numbers = np.rint(np.arange(wanted_frames) * (recorded / rate)).astype(np.int64)
    return np.minimum(numbers, n_frames - 1)


def _about_axis(axis: int, angles: np.ndarray) -> np.ndarray:
    """Return rotation matrices about a coordinate axis, shape (n, 3, 3)."""
    second, third = (axis + 1) % 3, (axis + 2) % 3
    matrices = np.zeros((len(angles), 3, 3))
    matrices[:, axis, axis] = 1.0
    matrices[:, second, second] = matrices[:, third, third] = np.cos(angles)
    matrices[:, third, second] = np.sin(angles)
    matrices[:, second, third] = -matrices[:, third, second]
    return matrices


@dataclass
class _Skeleton:
    """The hierarchy; channels of each joint are numbers of `_CHANNELS`."""

    names: list[str] = field(default_factory=list)
    parents: list[int] = field(default_factory=list)
    offsets: list[list[float]] = field(default_factory=list)
    channels: list[list[int]] = field(default_factory=list)
    end_joints: list[int] = field(default_factory=list)
    end_offsets: list[list[float]] = field(default_factory=list)


class _Reader:
    """Reads the statements of a file, and knows the line of each."""

    def __init__(self, file: Path, lines: Sequence[str]) -> None:
        self._file, self._lines = file, lines
        self._statements = self._split_lines()

    def _split_lines(self) -> Iterator[tuple[int, str]]:
        """Yield the statements of the hierarchy and braces, with the numbers of their lines."""
        for number, line in enumerate(self._lines, 1):
            for statement in re.findall(r"[{}]|[^{}]+", line):
                if statement.strip():
                    yield number, statement.strip()

    def _next(self, expected: str) -> tuple[int, str]:
        try:
            return next(self._statements)
        except StopIteration:
            raise self._error(len(self._lines), f"the file ends before {expected}") from None

    def _error(self, line: int, problem: str) -> FileFormatError:
        return FileFormatError(f"{self._file}, line {line}: {problem}")

    def _expect(self, expected: str) -> int:
        line, statement = self._next(expected)
        if statement.upper() != expected:
            raise self._error(line, f"{expected} expected; found {_shortened(statement)}")
        return line

    def read_hierarchy(self) -> _Skeleton:
        """Read the file up to the line MOTION, which comes after the last joint."""
        skeleton = _Skeleton()
        self._expect("HIERARCHY")
        while True:
            line, statement = self._next("MOTION")
            words = statement.split()
            if statement.upper() == "MOTION" and skeleton.names:
                self._motion = line
                return skeleton
            if words[0].upper() != "ROOT":
                raise self._error(line, f"ROOT or MOTION expected; found {_shortened(statement)}")
            self._read_joints(skeleton, line, words[1:])

    def _read_joints(self, skeleton: _Skeleton, line: int, words: list[str]) -> None:
        """Read a root and all joints below it."""
        self._begin_joint(skeleton, line, words, -1)
        branch = [len(skeleton.names) - 1]
        while branch:
            line, statement = self._next("the closing brace of a joint")
            words, joint = statement.split(), branch[-1]
            keyword = words[0].upper()
            if keyword == "OFFSET":
                skeleton.offsets[joint] = self._numbers(line, words[1:])
            elif keyword == "CHANNELS":
                skeleton.channels[joint] = self._channels(line, words[1:])
            elif keyword == "JOINT":
                self._begin_joint(skeleton, line, words[1:], joint)
                branch.append(len(skeleton.names) - 1)
            elif keyword == "END":
                self._expect("{")
                line, statement = self._next("OFFSET")
                if statement.split()[0].upper() != "OFFSET":
                    raise self._error(line, f"OFFSET expected; found {_shortened(statement)}")
                skeleton.end_joints.append(joint)
                skeleton.end_offsets.append(self._numbers(line, statement.split()[1:]))
                self._expect("}")
            elif keyword == "}":
                if not skeleton.offsets[joint]:
                    raise self._error(line, f"joint {skeleton.names[joint]} has no OFFSET")
                branch.pop()
            else:
                raise self._error(
                    line,
                    "OFFSET, CHANNELS, JOINT, End Site or a closing brace expected; found "
                    f"{_shortened(statement)}",
                )

    def _begin_joint(self, skeleton: _Skeleton, line: int, words: list[str], parent: int) -> None:
        if not words:
            raise self._error(line, "the joint has no name")
        self._expect("{")
        skeleton.names.append(" ".join(words))
        skeleton.parents.append(parent)
        skeleton.offsets.append([])
        skeleton.channels.append([])

    def _numbers(self, line: int, words: list[str]) -> list[float]:
        numbers = self._floats(line, words)
        if len(numbers) != 3:
            raise self._error(line, f"OFFSET must have 3 numbers; found {len(numbers)}")
        return numbers

    def _floats(self, line: int, words: list[str]) -> list[float]:
        try:
            numbers = [float(word) for word in words]
        except ValueError:
            wrong = next(word for word in words if not _is_number(word))
            raise self._error(line, f"{_shortened(wrong)} is not a number") from None
        if not all(map(math.isfinite, numbers)):
            raise self._error(line, "every number must be finite; found NaN or infinity")
        return numbers

    def _channels(self, line: int, words: list[str]) -> list[int]:
        known = {name.upper(): number for number, name in enumerate(_CHANNELS)}
        for word in words[1:]:
            if word.upper() not in known:
                raise self._error(
                    line, f"channels are {', '.join(_CHANNELS)}; found {_shortened(word)}"
                )
        channels = [known[word.upper()] for word in words[1:]]
        if not words or words[0] != str(len(channels)):
            count = _shortened(words[0]) if words else "none"
            raise self._error(
                line, f"the number of channels must be {len(channels)}; found {count}"
            )
        positions = [channel for channel in channels if channel < 3]
        if len(set(positions)) < len(positions):
            raise self._error(line, "a position channel is repeated")
        return channels

    def read_frames(self, n_channels: int) -> tuple[np.ndarray, float]:
        """Return the numbers of all frames, shape (n_frames, n_channels), and the frame rate."""
        lines = (
            (number, line.strip())
            for number, line in enumerate(self._lines[self._motion :], self._motion + 1)
            if line.strip()
        )
        line, n_frames = self._value(lines, "FRAMES")
        if n_frames < 1 or n_frames != int(n_frames):
            raise self._error(line, f"Frames must be a whole number above 0; found {n_frames:g}")
        line, frame_time = self._value(lines, "FRAME TIME")
        if not frame_time > 0.0 or math.isinf(1.0 / frame_time):
            raise self._error(line, f"Frame Time must be above 0; found {frame_time:g}")
        # Grows with the numbers that are read, whatever the file declares.
        values = array("d")
        count = 0
        for number, text in lines:
            words = text.split()
            if len(words) != n_channels:
                raise self._error(number, f"{n_channels} numbers expected; found {len(words)}")
            if count == n_frames:
                raise self._error(number, f"a frame after the last of {count}")
            values.extend(self._floats(number, words))
            count += 1
        if count < n_frames:
            raise self._error(
                len(self._lines), f"the file ends after {count} of {int(n_frames)} frames"
            )
        return np.array(values).reshape(count, n_channels), 1.0 / frame_time

    def _value(self, lines: Iterator[tuple[int, str]], name: str) -> tuple[int, float]:
        line, text = next(lines, (len(self._lines), "the end of the file"))
        key, _, value = text.partition(":")
        if " ".join(key.upper().split()) != name:
            raise self._error(line, f"{name.title()}: expected; found {_shortened(text)}")
        numbers = self._floats(line, value.split())
        if len(numbers) != 1:
            raise self._error(line, f"{name.title()}: must have one number; found {len(numbers)}")
        return line, numbers[0]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _shortened(text: str) -> str:
    return repr(text if len(text) <= _LONGEST_QUOTE else text[:_LONGEST_QUOTE] + "…")
