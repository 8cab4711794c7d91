"""C3D files of motion capture laboratories: the points, their names, rate and unit.

The format is that of www.c3d.org: a header, parameters in groups, then frames of points and of
analog signals, in blocks of 512 bytes. A file is read as a whole, and nothing is trusted that it
says of its size. We do not read with ezc3d, which crashes or never ends on damaged files and
refuses those that keep a number in another type than usual; tests compare with it.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array
from riemhuman.errors import FileFormatError
from riemhuman.io.files import read_bytes

_BLOCK = 512
# The second byte of every file, and the processors whose numbers it may hold.
_SIGN = 0x50
_INTEL, _DEC, _BIG_ENDIAN = 84, 85, 86
_MOST_AXES = 7
# Types of parameters: their NumPy types without the order of bytes.
_TYPES = {-1: "S1", 1: "u1", 2: "i2", 4: "f4"}
# A header counts frames up to this.
_MOST_IN_HEADER = 65535
# Groups of points that are no markers: other quantities of a model, by their names in the file.
_OTHER_QUANTITIES = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")


class Points(NamedTuple):
    """Points over time: positions (n_frames, M, 3) in `unit`, NaN where one was not seen."""

    names: tuple[str, ...]
    positions: Array
    rate: float
    unit: str


def read_points(file: Path) -> Points:
    """Return the points of a C3D file that are markers."""
    return _C3DFile(file).points()


class _C3DFile:
    """The header and the parameters of a file; parameters are arrays by "GROUP:NAME"."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._content = read_bytes(file)
        if len(self._content) < _BLOCK or self._content[1] != _SIGN:
            raise self._error("damaged, or not a C3D file")
        start = _BLOCK * (self._content[0] - 1)
        # A few writers leave the processor out; it is Intel's.
        processor = self._content[start + 3] if 0 < start < len(self._content) - 4 else 0
        self._is_dec = processor == _DEC
        self._order = ">" if processor == _BIG_ENDIAN else "<"
        self._parameters = dict(self._read_parameters(start + 4))

    def points(self) -> Points:
        """Return the points that are markers."""
        # Numbers of points and of analog values in a frame; numbers of the first and last frame.
        n_points, n_analog, first, last = self._header("HHHH", 2)
        n_points = self._number("POINT:USED", n_points, n_points or _MOST_IN_HEADER)
        if not n_points:
            raise self._error(self._without_points())
        scale = self._real("POINT:SCALE", self._floats(self._content[12:16])[0])
        start = _BLOCK * (self._number("POINT:DATA_START", *self._header("H", 16)) - 1)
        is_real = scale < 0.0
        width = 4 if is_real else 2
        frame_bytes = width * (4 * n_points + n_analog)
        there = max(0, (len(self._content) - start)) // frame_bytes if start > 0 else 0
        n_frames = self._count_frames(first, last, there)
        stored = np.frombuffer(self._content, np.uint8, n_frames * frame_bytes, start)
        values = stored.reshape(n_frames, frame_bytes)[:, : 4 * width * n_points]
        if is_real:
            numbers = self._floats(np.ascontiguousarray(values).tobytes())
        else:
            numbers = np.frombuffer(values.tobytes(), f"{self._order}i2").astype(np.float64)
        quadruples = numbers.reshape(n_frames, n_points, 4)
        positions = quadruples[..., :3] * (1.0 if is_real else scale)
        # The fourth number is negative where a point was not seen.
        unseen = ~(quadruples[..., 3] >= 0.0)
        if not unseen.all():
            positions = np.where(unseen[..., None], np.nan, positions)
        rate = self._real("POINT:RATE", self._floats(self._content[20:24])[0])
        names, others = self._names(n_points)
        markers = [number for number, name in enumerate(names) if name not in others]
        units = self._texts("POINT:UNITS")
        return Points(
            tuple(names[number] for number in markers),
            positions[:, markers],
            rate,
            units[0] if units else "",
        )

    def _error(self, problem: str) -> FileFormatError:
        return FileFormatError(f"{self._file}: {problem}")

    def _header(self, form: str, place: int) -> tuple[int, ...]:
        return struct.unpack_from(self._order + form, self._content, place)

    def _floats(self, stored: bytes) -> Array:
        """Return numbers in single precision; those of DEC have their halves exchanged."""
        if not self._is_dec:
            return np.frombuffer(stored, f"{self._order}f4").astype(np.float64)
        halves = np.frombuffer(stored, "<u2").reshape(-1, 2)[:, ::-1]
        return np.ascontiguousarray(halves).view("<f4")[:, 0].astype(np.float64) / 4.0

    def _read_parameters(self, place: int) -> Iterator[tuple[str, Array]]:
        """Yield the parameters, whose groups may come before or behind them."""
        groups: dict[int, str] = {}
        found: list[tuple[int, str, Array]] = []
        content = self._content
        while 0 < place < len(content) - 4:
            length, group = struct.unpack_from("bb", content, place)
            end_of_name = place + 2 + abs(length)
            if not length or not group or end_of_name + 2 > len(content):
                break
            name = content[place + 2 : end_of_name].decode("latin-1").strip().upper()
            (step,) = struct.unpack_from(f"{self._order}H", content, end_of_name)
            if group < 0:
                groups[-group] = name
            else:
                values = self._read_values(end_of_name + 2)
                if values is not None:
                    found.append((group, name, values))
            if not step:
                break
            place = end_of_name + step
        for group, name, values in found:
            yield f"{groups.get(group, group)}:{name}", values

    def _read_values(self, place: int) -> Array | None:
        """Return the values of a parameter, the first axis the fastest; None if it is damaged."""
        if place + 2 > len(self._content):
            return None
        kind, n_axes = struct.unpack_from("bB", self._content, place)
        sizes = tuple(self._content[place + 2 : place + 2 + n_axes])
        start = place + 2 + n_axes
        if kind not in _TYPES or len(sizes) < n_axes or n_axes > _MOST_AXES:
            return None
        n_bytes = abs(kind) * int(np.prod(sizes, dtype=np.int64))
        stored = self._content[start : start + n_bytes]
        if len(stored) < n_bytes:
            return None
        if kind == 4:
            return self._floats(stored).reshape(sizes[::-1])
        return np.frombuffer(stored, self._order + _TYPES[kind]).reshape(sizes[::-1])

    def _texts(self, name: str) -> list[str]:
        """Return the texts of a parameter, and of those that continue it after the 255th."""
        texts: list[str] = []
        key, number = name, 2
        while key in self._parameters:
            letters = self._parameters[key]
            if letters.dtype.kind == "S" and letters.ndim and letters.size:
                rows = np.frombuffer(letters.tobytes(), np.uint8).reshape(-1, letters.shape[-1])
                texts += [_text(row.tobytes()) for row in rows]
            key, number = f"{name}{number}", number + 1
        return texts

    def _real(self, name: str, default: float) -> float:
        values = self._parameters.get(name)
        if values is None or values.dtype.kind == "S" or not values.size:
            return float(default)
        return float(values.ravel()[0])

    def _number(self, name: str, default: int, maximum: int = _MOST_IN_HEADER) -> int:
        """Return a count; the 16 bits of one above 32767 look negative."""
        value = int(self._real(name, default)) % (_MOST_IN_HEADER + 1)
        return value if value <= maximum else default

    def _count_frames(self, first: int, last: int, there: int) -> int:
        """Return the number of frames; header and parameters may have too few bits for it."""
        counts = [last - first + 1 if last >= first else 0]
        counts += [int(self._real(f"POINT:{name}", 0)) for name in ("FRAMES", "LONG_FRAMES")]
        ends = [
            self._parameters.get(f"TRIAL:ACTUAL_{name}_FIELD", np.zeros(0)).ravel().astype(np.int64)
            for name in ("START", "END")
        ]
        if all(len(end) == 2 for end in ends):
            low, high = (int(end[0] % 65536 + 65536 * (end[1] % 65536)) for end in ends)
            counts.append(high - low + 1)
        declared = [count for count in counts if count > 0]
        fitting = [count for count in declared if count <= there]
        if there and max(declared, default=0) >= _MOST_IN_HEADER and not fitting:
            return there
        if not fitting:
            says = max(counts[0], min(declared, default=0))
            raise self._error(
                f"cut off, its header says {says} frames, but {there} follow"
                if says
                else "holds no frames"
            )
        return max(fitting)

    def _names(self, n_points: int) -> tuple[list[str], set[str]]:
        """Return the names of the points, and those of points that are no markers.

        There may be more names than points, or fewer.
        """
        names = self._texts("POINT:LABELS")[:n_points]
        names += [f"*{number}" for number in range(len(names), n_points)]
        others = {text for kind in _OTHER_QUANTITIES for text in self._texts(f"POINT:{kind}")}
        return names, others - {""}

    def _without_points(self) -> str:
        rotations = self._number("ROTATION:USED", 0)
        if rotations:
            return (
                f"holds rotations of {rotations} segments and no points; export the centres of "
                "joints, or a BVH file"
            )
        analog = self._number("ANALOG:USED", 0)
        return f"holds {analog or 'no'} analog signals and no points"


def _text(stored: bytes) -> str:
    """Return a text, which may be in one of two encodings."""
    try:
        return stored.decode("utf-8").strip(" \0")
    except UnicodeDecodeError:
        return stored.decode("latin-1").strip(" \0")
