"""Recordings of markers: TRC files of OpenSim and of video methods, and C3D files of laboratories.

Such files hold points that move, and no skeleton. Joints are where names of markers tell the
centres of joints (`_marker_sets`, `_joint_centres`); their rotations follow from these positions
(`_marker_skeletons`).
"""

from __future__ import annotations

import os
import re
from array import array
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from riemhuman.checks import checked, checked_rate
from riemhuman.errors import ArgumentError, FileFormatError, warn
from riemhuman.io.files import file_path, suffix_of
from riemhuman.mocap._c3d_files import Points, read_points
from riemhuman.mocap._joint_centres import Markers, without_unseen
from riemhuman.mocap._marker_skeletons import skeleton_of
from riemhuman.mocap._text_lines import TextLines
from riemhuman.mocap._units import metres_in
from riemhuman.mocap.skeleton_motion import SkeletonMotion

# Columns before those of markers: the number of the frame, and its time.
_COLUMNS_BEFORE = 2


@checked(frames_per_second=checked_rate)
def load_trc(
    path: str | os.PathLike[str],
    *,
    unit: str | float | None = None,
    joints: Mapping[str, str | Sequence[str]] | None = None,
    frames_per_second: float | None = None,
) -> SkeletonMotion:
    """Read a recording of markers in a TRC file, as OpenSim, OpenCap and others write it.

    The names of the markers determine the joint centres. For each joint, the first of these that
    exists is used: a centre (RHJC, RKJC, V_R.Knee_JC), the middle of two markers on the skin
    (r_knee and r_mknee, RKNE and RKNEM, RWRA and RWRB), a joint of a video method (RKnee), or one
    marker on the skin (RSHO), from which the centre is at half the usual breadth of the joint, with
    a warning. Hips may also be estimated from the corners of the pelvis (RASI, LASI, RPSI, LPSI, or
    CMU's RFWT, LFWT, RBWT, LBWT, or one marker at the sacrum instead of those behind), as in
    Harrington et al. (2007). If legs alone are marked, the upper body stands still, with a warning.
    Gaps of up to 0.2 seconds are interpolated; of the parts between longer ones, the longest is
    used, both with a warning.

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
        are averaged. Corners of the pelvis are named so too: "left_asis", "right_asis",
        "left_psis", "right_psis" or "sacrum".
    frames_per_second : float, optional
        Frame rate, if the file does not state it.

    Raises
    ------
    FileFormatError
        If the file is damaged, or if a hip, knee or ankle has no marker; the error lists the
        markers of the file.

    Examples
    --------
    >>> recording = rh.datasets.load_trc("walk.trc")  # doctest: +SKIP
    >>> walk = rh.datasets.retarget(recording)  # doctest: +SKIP
    """
    file = file_path(path)
    suffix_of(file, (".trc",))
    return skeleton_of(read_markers(file, unit, frames_per_second), joints)


@checked(frames_per_second=checked_rate)
def load_c3d(
    path: str | os.PathLike[str],
    *,
    unit: str | float | None = None,
    joints: Mapping[str, str | Sequence[str]] | None = None,
    frames_per_second: float | None = None,
) -> SkeletonMotion:
    """Read a recording of markers in a C3D file, as motion capture laboratories write it.

    Joints are found and gaps are treated as in `load_trc`. Points that are angles, forces, moments
    or powers, and analog signals, are left out.

    Parameters
    ----------
    path : path_like
        The recording, ``.c3d``.
    unit : str or number, optional
        See `load_trc`.
    joints : mapping of str to str or to sequence of str, optional
        See `load_trc`.
    frames_per_second : float, optional
        See `load_trc`.

    Raises
    ------
    FileFormatError
        See `load_trc`.

    Examples
    --------
    >>> recording = rh.datasets.load_c3d("walk.c3d")  # doctest: +SKIP
    """
    file = file_path(path)
    suffix_of(file, (".c3d",))
    return skeleton_of(read_markers(file, unit, frames_per_second), joints)


def read_markers(
    file: Path, unit: str | float | None = None, frames_per_second: float | None = None
) -> Markers:
    """Return the markers in a TRC or C3D file, whatever their names."""
    read = read_points(file) if file.suffix.lower() == ".c3d" else _TextReader(file).read()
    rate = read.rate or frames_per_second or 0.0
    if not rate > 0.0:
        raise FileFormatError(f"{file} does not state its frame rate: pass frames_per_second=")
    positions = without_unseen(read.positions)
    try:
        metres = metres_in(read.unit if unit is None else unit)
    except ArgumentError:
        if unit is not None:
            raise
        return Markers(str(file), read.names, positions, rate, file.stem, None)
    return Markers(str(file), read.names, metres * positions, rate, file.stem, "metres")


class _TextReader:
    """Reads the header and the rows of a TRC file."""

    def __init__(self, file: Path) -> None:
        self._lines = TextLines(file)
        self._names: list[str] = []
        self._separator: str | None = None

    def read(self) -> Points:
        """Return the markers; the frame rate is 0 if it is unknown."""
        values = self._header()
        names = self._names
        rows, times = array("d"), array("d")
        for line in self._lines:
            cells = self._cells(line)
            # The row X1 Y1 Z1, and empty ones.
            if not any(cells) or (not times and _is_row_of_axes(cells)):
                continue
            numbers = self._row(cells, len(names))
            times.append(numbers[1])
            rows.extend(numbers[_COLUMNS_BEFORE:])
        n_frames = self._number(values, "numframes")
        says = "" if n_frames is None else f"NumFrames says {n_frames:g}, but "
        if not times:
            raise self._lines.error(f"{says}0 frames follow")
        if n_frames is not None and n_frames > len(times):
            warn(f"{self._lines.file.name}: {says}{len(times)} frames follow", UserWarning)
        rate = self._number(values, "datarate") or self._number(values, "camerarate") or 0.0
        duration = times[-1] - times[0]
        if not rate and duration > 0.0:
            rate = (len(times) - 1) / duration
        positions = np.array(rows).reshape(len(times), len(names), 3)
        return Points(tuple(names), positions, rate, values.get("units", ""))

    def _header(self) -> dict[str, str]:
        """Return the values that the file gives before its rows, and keep the names of markers."""
        keys: list[str] = []
        values: dict[str, str] = {}
        for line in self._lines:
            # Between tabs, values may hold spaces and commas: "30 Hz", "29,97".
            separators = r" *\t *" if "\t" in line else r"[\s,;]+"
            words = re.split(separators, line.strip())
            first = words[0].lower().replace(" ", "")
            if first in ("frame#", "frame"):
                # Names of markers may hold spaces, where tabs or commas are between them.
                self._separator = next((mark for mark in "\t,;" if mark in line), None)
                cells = self._cells(line.strip())
                self._names = _one_name_each([name for name in cells[_COLUMNS_BEFORE:] if name])
                if not self._names:
                    raise self._lines.error("names of markers expected after Frame# and Time")
                return values
            if first == "datarate":
                keys = [word.lower() for word in words]
                # Some programs write each value behind its key.
                if len(keys) > 1 and keys[1][:1].isdigit():
                    values = dict(zip(keys[::2], keys[1::2], strict=False))
            elif keys and not values and any(words):
                values = dict(zip(keys, words, strict=False))
        raise self._lines.error(
            "no row begins with Frame#, as the row with marker names does in TRC files"
        )

    def _cells(self, line: str) -> list[str]:
        """Return the cells of a row."""
        if self._separator is None or self._separator not in line:
            return line.split()
        return [cell.strip() for cell in line.rstrip("\r\n").split(self._separator)]

    def _row(self, cells: list[str], n_markers: int) -> list[float]:
        """Return the numbers of a frame; empty cells are NaN."""
        width = _COLUMNS_BEFORE + 3 * n_markers
        while len(cells) > width and not cells[-1]:
            cells.pop()
        # Empty cells at the end of a row may have been left out, a whole marker at a time.
        if len(cells) > width or len(cells) < _COLUMNS_BEFORE or (width - len(cells)) % 3:
            raise self._lines.error(
                f"{width} columns expected for {n_markers} markers; found {len(cells)}"
            )
        # Commas that do not separate cells are the decimal points of some countries.
        numbers = self._lines.floats((cell or "nan").replace(",", ".") for cell in cells)
        return numbers + [np.nan] * (width - len(cells))

    def _number(self, values: Mapping[str, str], key: str) -> float | None:
        """Return a number of the header, or None if it is not there."""
        text = values.get(key, "").partition(" ")[0].replace(",", ".")
        return self._lines.floats([text], f"{key}:")[0] if text else None


def _one_name_each(names: list[str]) -> list[str]:
    """Return the names of markers, of which some programs write one for each of three columns."""
    stems = [re.sub(r"[_.: ]?[xyz]$", "", name, flags=re.IGNORECASE) for name in names]
    for triples in (names, stems):
        if triples[::3] == triples[1::3] == triples[2::3]:
            return triples[::3]
    return names


def _is_row_of_axes(cells: Sequence[str]) -> bool:
    """Return whether this is the row X1 Y1 Z1 below the names of markers."""
    first = next(cell for cell in cells if cell)
    return first[0] in "Xx"
