"""Motion capture in Acclaim files: a skeleton (.asf), and its rotations over time (.amc).

A bone starts where its parent ends, and carries its own rotation. A joint of `SkeletonMotion` is
the start of a bone and has its name; where nothing follows a bone, its end is a joint as well. The
rest pose of a skeleton is the one of its file, in which no joint is rotated.
"""

from __future__ import annotations

import os
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array
from riemhuman.checks import checked, checked_rate
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.files import file_path, format_errors, suffix_of, visible_files
from riemhuman.mocap._text_lines import TextLines
from riemhuman.mocap.skeleton_motion import SkeletonMotion

_INCH = 0.0254
_TRANSLATIONS = ("tx", "ty", "tz")
_ROTATIONS = ("rx", "ry", "rz")
_FREEDOMS = (*_TRANSLATIONS, *_ROTATIONS)
_ROOT = "root"
_DEGREE = float(np.pi / 180.0)
_ANGLES = {"deg": _DEGREE, "degrees": _DEGREE, "rad": 1.0, "radians": 1.0}


@dataclass
class _Bone:
    """A bone of the skeleton file, lengths in metres."""

    name: str
    parent: int = -1
    # From its start to its end, in the axes of space, in the rest pose.
    direction: Array = field(default_factory=lambda: np.zeros(3))
    length: float = 0.0
    # The axes in which it rotates, columns of a matrix.
    axes: Array = field(default_factory=lambda: np.eye(3))
    # What a recording states for it, in this order, which is also that of the rotations.
    freedoms: tuple[str, ...] = ()
    position: Array = field(default_factory=lambda: np.zeros(3))
    is_placed: bool = False

    @property
    def vector(self) -> Array:
        """The vector from its start to its end in the rest pose."""
        return self.length * self.direction


@dataclass
class _Skeleton:
    """The bones of a skeleton file, parents before children, and the length of its unit."""

    file: Path
    bones: list[_Bone]
    metres: float


@checked(frames_per_second=checked_rate)
def load_amc(
    path: str | os.PathLike[str],
    skeleton: str | os.PathLike[str] | None = None,
    *,
    frames_per_second: float = 120.0,
) -> SkeletonMotion:
    """Read a motion capture recording in an Acclaim file (.amc), such as those of CMU and HDM05.

    Lengths are in metres, whatever the unit of the skeleton. A joint has the name of the bone that
    starts there: "lfemur" is the left hip.

    Parameters
    ----------
    path : path_like
        The recording, ``.amc``.
    skeleton : path_like, optional
        The skeleton, ``.asf``. By default the one in the same folder whose name is the beginning of
        the recording's name (``01.asf`` for ``01_01.amc``), or the only one there.
    frames_per_second : float
        Frame rate, which the files do not contain; it is 120 for CMU and HDM05.

    Raises
    ------
    FileError
        If there is no skeleton, or more than one candidate.
    FileFormatError
        If a file is damaged, or the two do not belong together.

    Examples
    --------
    >>> recording = rh.datasets.load_amc("01_01.amc")  # doctest: +SKIP
    >>> jump = rh.datasets.retarget(recording)  # doctest: +SKIP
    """
    file = file_path(path)
    suffix_of(file, (".amc",))
    lines = _Lines(file)
    skeleton_file = _skeleton_beside(file) if skeleton is None else file_path(skeleton, "skeleton")
    with format_errors(skeleton_file, "an Acclaim skeleton"):
        bones = _SkeletonReader(skeleton_file).read()
    with format_errors(file, "an Acclaim recording"):
        values = _read_frames(lines, bones)
        return _skeleton_motion(bones, values, frames_per_second, file.stem)


def _skeleton_beside(file: Path) -> Path:
    """Return the skeleton in a recording's folder that its name points to."""
    candidates = visible_files(file.parent, ".asf")
    named = [
        candidate
        for candidate in candidates
        if file.stem.lower().startswith(candidate.stem.lower())
    ]
    if named:
        return max(named, key=lambda candidate: len(candidate.stem))
    if len(candidates) == 1:
        return candidates[0]
    listed = ", ".join(candidate.name for candidate in candidates[:8]) or "no .asf file"
    raise FileError(
        f"{file} needs a skeleton, an .asf file whose name is the beginning of this name; the "
        f"folder has {listed}. Name the right file: skeleton="
    )


class _Lines(TextLines):
    """Lines as words, without comments."""

    def words(self) -> Iterator[list[str]]:
        """Yield the words of lines that have some."""
        for line in self:
            words = line.partition("#")[0].split()
            if words:
                yield words

    def numbers(self, words: list[str], count: int, what: str) -> list[float]:
        """Return words as so many finite numbers."""
        if len(words) != count:
            raise self.error(f"{what} must be {count} numbers; found {len(words)}")
        return self.finite(words, f"{what}:")


class _SkeletonReader:
    """Reads the sections of a skeleton file one after the other."""

    def __init__(self, file: Path) -> None:
        suffix_of(file, (".asf",))
        self._lines = _Lines(file)
        self._file = file
        self._unit, self._angle = 1.0, 1.0
        self._bones = {_ROOT: _Bone(_ROOT)}
        self._children: dict[str, list[str]] = {}

    def read(self) -> _Skeleton:
        section = ""
        bone = _Bone("")
        for words in self._lines.words():
            keyword = words[0].lower()
            if keyword.startswith(":"):
                section = keyword
            elif section == ":units":
                self._read_unit(keyword, words[1:])
            elif section == ":root":
                self._read_root(keyword, words[1:])
            elif section == ":bonedata":
                if keyword == "begin":
                    bone = _Bone("")
                elif keyword == "end":
                    self._bones[bone.name] = bone
                else:
                    self._read_bone(bone, keyword, words[1:])
            elif section == ":hierarchy" and keyword not in ("begin", "end"):
                self._children.setdefault(words[0], []).extend(words[1:])
        return _Skeleton(self._file, self._ordered_bones(), _INCH / self._unit)

    def _read_unit(self, keyword: str, words: list[str]) -> None:
        if keyword == "length":
            (self._unit,) = self._lines.numbers(words, 1, "the unit of length")
        elif keyword == "angle":
            self._angle = _ANGLES[words[0].lower()]

    def _read_root(self, keyword: str, words: list[str]) -> None:
        root = self._bones[_ROOT]
        if keyword == "order":
            root.freedoms = self._freedoms(words)
        elif keyword == "position":
            root.position = np.array(self._lines.numbers(words, 3, "the position of the root"))
        elif keyword == "orientation":
            # Its axes are turned by this: as `axis` of a bone, with the angles alone.
            root.axes = self._rotation(words, "xyz", "the orientation of the root")

    def _read_bone(self, bone: _Bone, keyword: str, words: list[str]) -> None:
        if keyword == "name":
            bone.name = words[0]
        elif keyword == "direction":
            direction = np.array(self._lines.numbers(words, 3, "the direction of a bone"))
            # Some files round directions; a bone of length 0 may have none.
            length = float(np.linalg.norm(direction))
            bone.direction = direction / length if length > 0.0 else direction
        elif keyword == "length":
            (bone.length,) = self._lines.numbers(words, 1, "the length of a bone")
        elif keyword == "axis":
            order = words[3].lower() if len(words) == 4 else "xyz"
            bone.axes = self._rotation(words[:3], order, "the axes of a bone")
        elif keyword == "dof":
            bone.freedoms = self._freedoms(words)

    def _freedoms(self, words: list[str]) -> tuple[str, ...]:
        freedoms = tuple(word.lower() for word in words)
        if not set(freedoms) <= set(_FREEDOMS) or len(set(freedoms)) < len(freedoms):
            raise self._lines.error(
                f"degrees of freedom must be different ones of {', '.join(_FREEDOMS)}; found "
                f"{' '.join(words)[:60]!r}"
            )
        return freedoms

    def _rotation(self, words: list[str], order: str, what: str) -> Array:
        """Return the rotation by angles about fixed axes, one after the other."""
        angles = self._lines.numbers(words, 3, what)
        # The first number is the angle about x, whatever the order in which they are applied.
        ordered = [self._angle * angles["xyz".index(axis)] for axis in order]
        matrix: Array = Rotation.from_euler(order, ordered).as_matrix()
        return matrix

    def _ordered_bones(self) -> list[_Bone]:
        """Return the bones below the root, parents first."""
        ordered: list[_Bone] = []
        waiting = [(_ROOT, -1)]
        while waiting:
            name, parent = waiting.pop()
            bone = self._bones.get(name)
            if bone is None:
                raise FileFormatError(
                    f"{self._file}: the hierarchy has an unknown bone {name[:60]!r}"
                )
            if bone.is_placed:
                raise FileFormatError(f"{self._file}: bone {name} has two parents")
            bone.parent = parent
            bone.is_placed = True
            number = len(ordered)
            ordered.append(bone)
            waiting += [(child, number) for child in reversed(self._children.get(name, []))]
        return ordered


def _read_frames(lines: _Lines, skeleton: _Skeleton) -> dict[str, Array]:
    """Return the numbers of each bone in all frames, shape (n_frames, its freedoms)."""
    widths = {bone.name: len(bone.freedoms) for bone in skeleton.bones if bone.freedoms}
    values = {name: array("d") for name in widths}
    missing: set[str] = set()
    n_frames = 0
    angle = _DEGREE
    for words in lines.words():
        keyword = words[0]
        if keyword.startswith(":"):
            if keyword.lower() == ":radians":
                angle = 1.0
        elif keyword.isdecimal() and len(words) == 1:
            _check_complete(lines, n_frames, missing)
            n_frames += 1
            missing = set(widths)
        elif keyword not in widths:
            raise lines.error(
                f"bone {keyword[:60]!r} does not move in {skeleton.file}: is it the right skeleton?"
            )
        else:
            numbers = lines.numbers(words[1:], widths[keyword], f"the values of {keyword}")
            values[keyword].extend(numbers)
            missing.discard(keyword)
    if not n_frames:
        raise FileFormatError(f"{lines.file}: the file holds no frames")
    _check_complete(lines, n_frames, missing)
    values_of_bones = {
        name: np.array(column).reshape(n_frames, widths[name]) for name, column in values.items()
    }
    for bone in skeleton.bones:
        for number, freedom in enumerate(bone.freedoms):
            values_of_bones[bone.name][:, number] *= (
                angle if freedom in _ROTATIONS else skeleton.metres
            )
    return values_of_bones


def _check_complete(lines: _Lines, n_frames: int, missing: set[str]) -> None:
    if missing:
        raise lines.error(f"frame {n_frames} has no values of {sorted(missing)[0]}")


def _skeleton_motion(
    skeleton: _Skeleton, values: dict[str, Array], rate: float, name: str
) -> SkeletonMotion:
    """Return the starts of all bones, and the ends of the last ones, as joints."""
    bones, metres = skeleton.bones, skeleton.metres
    n_frames = len(next(iter(values.values())))
    parents = [bone.parent for bone in bones]
    names = [bone.name for bone in bones]
    offsets = [metres * bones[max(bone.parent, 0)].vector for bone in bones]
    offsets[0] = metres * bones[0].position
    rotations, translations = [], []
    for number, bone in enumerate(bones):
        bone_values = values.get(bone.name, np.zeros((n_frames, 0)))
        rotations.append(_rotations(bone, bone_values))
        translations.append(offsets[number] + _moved(bone, bone_values))
    for number, bone in enumerate(bones):
        if number not in parents and bone.length:
            names.append(f"{bone.name} end")
            parents.append(number)
            offsets.append(metres * bone.vector)
            rotations.append(np.broadcast_to(np.eye(3), (n_frames, 3, 3)))
            translations.append(np.broadcast_to(offsets[-1], (n_frames, 3)))
    return SkeletonMotion(
        tuple(names),
        np.array(parents),
        np.array(offsets),
        np.stack(rotations, axis=1),
        np.stack(translations, axis=1),
        rate,
        name,
    )


def _column(bone: _Bone, values: Array, freedom: str) -> Array:
    """Return the values of one degree of freedom of a bone, zeros if there are none."""
    if freedom in bone.freedoms:
        return np.asarray(values[:, bone.freedoms.index(freedom)])
    return np.zeros(len(values))


def _rotations(bone: _Bone, values: Array) -> Array:
    """Return the rotations of a bone in the axes of space at rest, C M C⁻¹."""
    order = "".join(freedom[1] for freedom in bone.freedoms if freedom in _ROTATIONS)
    if not order:
        return np.tile(np.eye(3), (len(values), 1, 1))
    angles = np.stack([_column(bone, values, f"r{axis}") for axis in order], axis=1)
    turns: Array = Rotation.from_euler(order, angles).as_matrix()
    # The root rotates in space and then carries its rest orientation; bones rotate in their axes.
    return turns @ bone.axes if bone.parent < 0 else bone.axes @ turns @ bone.axes.T


def _moved(bone: _Bone, values: Array) -> Array:
    """Return how far the start of a bone is moved, in the axes of its parent."""
    steps = np.stack([_column(bone, values, freedom) for freedom in _TRANSLATIONS], axis=1)
    return steps if bone.parent < 0 else steps @ bone.axes.T
