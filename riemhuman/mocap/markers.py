"""Recordings of markers: TRC files of OpenSim and of video methods, and C3D files of laboratories.

Such files hold points that move, and no skeleton. Joints are where names of markers tell the
centres of joints (`_marker_names`); their rotations follow from these positions
(`_marker_skeletons`).
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
from array import array
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from riemhuman.arrays import Array
from riemhuman.checks import real_number
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.arrays import load_arrays
from riemhuman.io.files import (
    file_path,
    read_bytes,
    short_message,
    suffix_of,
)
from riemhuman.mocap._marker_skeletons import Markers, skeleton_of
from riemhuman.mocap._units import metres_in
from riemhuman.mocap.skeleton_motion import SkeletonMotion
from riemhuman.optional import import_optional

# Larger numbers, and higher rates, are damage.
_LARGEST, _HIGHEST_RATE = 1e9, 1e5
# Columns before those of markers: the number of the frame, and its time.
_COLUMNS_BEFORE = 2
# The second byte of every C3D file, the size of its header in bytes, and the number of processors
# that store the highest byte first.
_C3D_SIGN = 0x50
_C3D_BLOCK = 512
_C3D_BIG_ENDIAN = 86
# ezc3d never finishes reading some damaged files. It gets this time, and a second more for so many
# bytes, which is enough on the slowest machine.
_C3D_SECONDS = 20.0
_C3D_BYTES_A_SECOND = 1e6


def load_trc(
    path: str | os.PathLike[str],
    *,
    unit: str | float | None = None,
    joints: Mapping[str, str | Sequence[str]] | None = None,
) -> SkeletonMotion:
    """Read a recording of markers in a TRC file, as OpenSim, OpenCap and others write it.

    The names of the markers determine the joint centres. For each joint, the first of these that
    exists is used: a centre (RHJC, RKJC, V_R.Knee_JC), the middle of two markers on the skin
    (r_knee and r_mknee, RKNE and RKNEM, RWRA and RWRB), a joint of a video method (RKnee), or one
    marker on the skin (RSHO), with a warning. Hips may also be estimated from the corners of the
    pelvis (RASI, LASI, RPSI, LPSI), as in Bell, Pedersen and Brand (1990). Gaps of up to 0.2
    seconds are interpolated, and frames at the beginning and the end are left out if a required
    joint is missing, both with a warning.

    Parameters
    ----------
    path : path_like
        The recording, ``.trc``.
    unit : str or number, optional
        Unit of the file's lengths, as for `load_bvh`; by default the one that the file names.
        Lengths are returned in metres, or unchanged if neither names one.
    joints : mapping of str to str or to sequence of str, optional
        Names of markers, by the names of joints in the open model, for joints that are not
        recognised, such as ``{"left_hip": "LHJC", "left_knee": ("LK1", "LK2")}``; several markers
        are averaged.

    Raises
    ------
    FileFormatError
        If the file is damaged, or if a required joint has no marker or a long gap; the error lists
        the markers of the file. Hips, knees, ankles, shoulders, elbows and wrists are required.

    Examples
    --------
    >>> recording = rh.datasets.load_trc("walk.trc")  # doctest: +SKIP
    >>> walk = rh.datasets.retarget(recording)  # doctest: +SKIP
    """
    metres = None if unit is None else metres_in(unit)
    file = file_path(path)
    suffix_of(file, (".trc",))
    names, positions, rate, written_unit = _TextReader(file).read()
    markers = _in_metres(file, names, positions, rate, written_unit, metres)
    return skeleton_of(markers, joints)


def load_c3d(
    path: str | os.PathLike[str],
    *,
    unit: str | float | None = None,
    joints: Mapping[str, str | Sequence[str]] | None = None,
    timeout: float | None = None,
) -> SkeletonMotion:
    """Read a recording of markers in a C3D file, as motion capture laboratories write it.

    This needs ezc3d: ``pip install '.[recordings]'``. It runs in a separate process, because a
    damaged file may crash it. Joints are found and gaps are treated as in `load_trc`.

    Parameters
    ----------
    path : path_like
        The recording, ``.c3d``.
    unit : str or number, optional
        See `load_trc`.
    joints : mapping of str to str or to sequence of str, optional
        See `load_trc`.
    timeout : float, optional
        Seconds after which the file counts as damaged; by default 20, and one for each megabyte.

    Raises
    ------
    FileFormatError
        See `load_trc`.
    MissingDependencyError
        If ezc3d is not installed.

    Examples
    --------
    >>> recording = rh.datasets.load_c3d("walk.c3d")  # doctest: +SKIP
    """
    metres = None if unit is None else metres_in(unit)
    if timeout is not None:
        timeout = real_number(timeout, "timeout", minimum=0.0, strict=True)
    file = file_path(path)
    suffix_of(file, (".c3d",))
    content = read_bytes(file)
    if len(content) < _C3D_BLOCK or content[1] != _C3D_SIGN:
        raise FileFormatError(f"{file}: damaged, or not a C3D file")
    n_frames = _declared_frames(content)
    points = _copied_points(file, timeout)
    positions, names = points["positions"], points["names"].tolist()
    if len(positions) < n_frames:
        raise FileFormatError(
            f"{file}: cut off, its header says {n_frames} frames, but {len(positions)} follow"
        )
    if not positions.size or len(names) < positions.shape[1]:
        raise FileFormatError(
            f"{file}: {positions.shape[1]} markers in {len(positions)} frames, and {len(names)} "
            "names of markers"
        )
    rate, written_unit = float(points["rate"]), str(points["unit"])
    markers = _in_metres(file, names, positions, rate, written_unit, metres)
    return skeleton_of(markers, joints)


def _copied_points(file: Path, timeout: float | None) -> dict[str, Array]:
    """Return what `_c3d_points` copies from a file, in a process that damaged files may kill."""
    import_optional("ezc3d", "recordings")
    script = Path(__file__).with_name("_c3d_points.py")
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "points.npz"
        # -P: do not import modules from the script's folder.
        command = [sys.executable, "-P", str(script), str(file.absolute()), str(target)]
        seconds = timeout or _C3D_SECONDS + file.stat().st_size / _C3D_BYTES_A_SECOND
        try:
            process = subprocess.run(command, capture_output=True, check=False, timeout=seconds)
        except subprocess.TimeoutExpired:
            raise FileFormatError(
                f"{file}: damaged, or not a C3D file: it was not read within {seconds:g} s"
            ) from None
        if process.returncode or not target.exists():
            lines = process.stderr.decode(errors="replace").strip().splitlines()
            # A process that crashed (a negative code) gives no reason.
            has_reason = process.returncode > 0 and lines
            reason = lines[-1] if has_reason else "it cannot be read by ezc3d"
            raise FileFormatError(
                f"{file}: damaged, or not a C3D file: {short_message(ValueError(reason))}"
            )
        return load_arrays(target, ())


def _declared_frames(content: bytes) -> int:
    """Return the least number of frames by the header of a C3D file, which counts to 65535."""
    # The first byte counts blocks up to the parameters, whose fourth byte names the processor.
    processor = _C3D_BLOCK * (content[0] - 1) + 3
    is_big = len(content) > processor > 0 and content[processor] == _C3D_BIG_ENDIAN
    # At byte 6: the first and the last frame (uint16 each).
    first, last = struct.unpack_from(">HH" if is_big else "<HH", content, 6)
    return int(last - first + 1) if last >= first else 0


def _in_metres(
    file: Path,
    names: Sequence[str],
    positions: Array,
    rate: float,
    written_unit: str,
    metres: float | None,
) -> Markers:
    """Return markers in metres where their unit is known, without those that were not seen."""
    if not 0.0 < rate < _HIGHEST_RATE:
        raise FileFormatError(
            f"{file}: the frame rate must be positive, and below {_HIGHEST_RATE:g}; found {rate:g}"
        )
    if (np.abs(positions) > _LARGEST).any():
        raise FileFormatError(f"{file}: coordinates must be below {_LARGEST:g}")
    if metres is None:
        try:
            metres = metres_in(str(written_unit))
        except ArgumentError:  # a word that names no unit
            metres = None
    # Programs write zeros or nothing if they did not see a marker.
    unseen = ~np.isfinite(positions).all(axis=-1) | (positions == 0.0).all(axis=-1)
    positions = np.where(unseen[..., None], np.nan, positions)
    if metres is None:
        return Markers(str(file), tuple(names), positions, rate, file.stem, None)
    return Markers(str(file), tuple(names), metres * positions, rate, file.stem, "metres")


class _TextReader:
    """Reads the header and the rows of a TRC file."""

    def __init__(self, file: Path) -> None:
        self._file = file
        text = read_bytes(file).decode("utf-8-sig", errors="replace")
        self._lines: Iterator[tuple[int, str]] = enumerate(text.splitlines(), 1)
        self._line = 0
        self._names: list[str] = []

    def read(self) -> tuple[list[str], Array, float, str]:
        """Return names of markers, positions, frame rate and unit."""
        values = self._header()
        names = self._names
        rows, times = array("d"), array("d")
        for line in self._next_lines():
            cells = _cells(line)
            # The row X1 Y1 Z1, and empty ones.
            if not any(cells) or (not times and _is_row_of_axes(cells)):
                continue
            numbers = self._row(cells, len(names))
            times.append(numbers[1])
            rows.extend(numbers[_COLUMNS_BEFORE:])
        n_frames = self._number(values, "numframes")
        if not times or (n_frames is not None and n_frames != len(times)):
            says = "" if n_frames is None else f"NumFrames says {n_frames:g}, but "
            raise self._error(f"{says}{len(times)} frames follow")
        rate = self._number(values, "datarate") or self._number(values, "camerarate")
        if not rate:
            duration = times[-1] - times[0]
            if not duration > 0.0:
                raise self._error("the frame rate follows neither from DataRate nor from the times")
            rate = (len(times) - 1) / duration
        positions = np.array(rows).reshape(len(times), len(names), 3)
        return names, positions, rate, values.get("units", "")

    def _next_lines(self) -> Iterator[str]:
        for number, line in self._lines:
            self._line = number
            yield line

    def _error(self, problem: str) -> FileFormatError:
        return FileFormatError(f"{self._file}, line {self._line}: {problem}")

    def _header(self) -> dict[str, str]:
        """Return the values that the file gives before its rows, and keep the names of markers."""
        keys: list[str] = []
        values: dict[str, str] = {}
        for line in self._next_lines():
            words = line.split()
            first = words[0].lower() if words else ""
            if first in ("frame#", "frame"):
                cells = _cells(line.strip())[_COLUMNS_BEFORE:]
                self._names = [name for name in cells if name]
                if not self._names:
                    raise self._error("names of markers expected after Frame# and Time")
                return values
            if first == "datarate":
                keys = [word.lower() for word in words]
            elif keys and not values:
                values = dict(zip(keys, words, strict=False))
        raise self._error(
            "no row begins with Frame#, as the row with marker names does in TRC files"
        )

    def _row(self, cells: list[str], n_markers: int) -> list[float]:
        """Return the numbers of a frame; empty cells are NaN."""
        width = _COLUMNS_BEFORE + 3 * n_markers
        while len(cells) > width and not cells[-1]:
            cells.pop()
        # Empty cells at the end of a row may have been left out, a whole marker at a time.
        if len(cells) > width or len(cells) < _COLUMNS_BEFORE or (width - len(cells)) % 3:
            raise self._error(
                f"{width} columns expected for {n_markers} markers; found {len(cells)}"
            )
        try:
            numbers = [float(cell) if cell else np.nan for cell in cells]
        except ValueError as error:
            raise self._error(short_message(error)) from None
        return numbers + [np.nan] * (width - len(cells))

    def _number(self, values: Mapping[str, str], key: str) -> float | None:
        """Return a number of the header, or None if it is not there."""
        if key not in values:
            return None
        try:
            return float(values[key])
        except ValueError as error:
            raise self._error(f"{key}: {short_message(error)}") from None


def _cells(line: str) -> list[str]:
    """Return the cells of a row, between tabs if it has some, else between spaces."""
    if "\t" not in line:
        return line.split()
    return [cell.strip() for cell in line.rstrip("\r\n").split("\t")]


def _is_row_of_axes(cells: Sequence[str]) -> bool:
    """Return whether this is the row X1 Y1 Z1 below the names of markers."""
    first = next(cell for cell in cells if cell)
    return first[0] in "Xx"
