"""Positions of joints over time, as networks and video methods write them: arrays and tables."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from riemhuman.arrays import Array, ArrayLike
from riemhuman.bodies.skinning import SMPL_JOINTS
from riemhuman.checks import checked, checked_rate, instance, real_array, values_of
from riemhuman.errors import ArgumentError, FileFormatError, shown, warn
from riemhuman.io.arrays import load_array, load_arrays
from riemhuman.io.files import format_errors, read_text
from riemhuman.mocap._joint_centres import Markers, without_unseen
from riemhuman.mocap._marker_skeletons import skeleton_of
from riemhuman.mocap._units import metres_in
from riemhuman.mocap.skeleton_motion import SkeletonMotion

ENDINGS = (".npy", ".csv")
"""Endings of files that hold nothing but positions; `.npz` files may hold them too."""

_FACE = ("Nose", "LEye", "REye", "LEar", "REar")
_ARMS = ("LShoulder", "RShoulder", "LElbow", "RElbow", "LWrist", "RWrist")
_LEGS = ("LHip", "RHip", "LKnee", "RKnee", "LAnkle", "RAnkle")
_COCO = (*_FACE, *_ARMS, *_LEGS)
_FEET = ("LBigToe", "LSmallToe", "LHeel", "RBigToe", "RSmallToe", "RHeel")
_RIGHT_ARM, _LEFT_ARM = (
    tuple(side + part for part in ("Shoulder", "Elbow", "Wrist")) for side in "RL"
)
_RIGHT_LEG, _LEFT_LEG = (tuple(side + part for part in ("Hip", "Knee", "Ankle")) for side in "RL")


def _smpl_name(joint: str) -> str:
    side, _, part = joint.partition("_")
    return {"left": "L", "right": "R"}[side] + part.title() if side in ("left", "right") else joint


LAYOUTS: dict[str, tuple[str, ...]] = {
    "smpl": tuple(_smpl_name(joint) for joint in SMPL_JOINTS),  # HumanML3D
    "smpl24": (*(_smpl_name(joint) for joint in SMPL_JOINTS), "LHand", "RHand"),
    "h36m": (
        *("Pelvis", *_RIGHT_LEG, *_LEFT_LEG, "Spine", "Thorax", "Throat", "Head"),
        *(*_LEFT_ARM, *_RIGHT_ARM),
    ),
    "coco": _COCO,
    "body25": (
        *("Nose", "Neck", *_RIGHT_ARM, *_LEFT_ARM, "MidHip", *_RIGHT_LEG, *_LEFT_LEG),
        *("REye", "LEye", "REar", "LEar", *_FEET),
    ),
    "ntu": (
        *("SpineBase", "SpineMid", "Neck", "Head", *_LEFT_ARM, "LHand", *_RIGHT_ARM, "RHand"),
        *(*_LEFT_LEG, "LToe", *_RIGHT_LEG, "RToe", "SpineTop"),
        *("LHandTip", "LThumb", "RHandTip", "RThumb"),
    ),
    "halpe26": (
        *(*_COCO, "Head", "Neck", "MidHip", "LBigToe", "RBigToe", "LSmallToe", "RSmallToe"),
        *("LHeel", "RHeel"),
    ),
    "mediapipe": (
        *("Nose", "LEyeIn", "LEye", "LEyeOut", "REyeIn", "REye", "REyeOut", "LEar", "REar"),
        *("LMouth", "RMouth", *_ARMS, "LPinky", "RPinky", "LIndex", "RIndex", "LThumb", "RThumb"),
        *(*_LEGS, "LHeel", "RHeel", "LFootIndex", "RFootIndex"),
    ),
    "wholebody": (*_COCO, *_FEET, *(f"Point{number}" for number in range(110))),
}
"""Names of the joints in each layout, in their order."""

# Bones whose lengths say which of several layouts with one count is right.
_BONES = tuple(
    (side + first, side + second)
    for side in "LR"
    for part in (("Hip", "Knee", "Ankle"), ("Shoulder", "Elbow", "Wrist"))
    for first, second in pairwise(part)
)
# Beside positions, arrays may hold how sure a method is.
_WIDTHS = (3, 4)
_FEATURES = 263  # of HumanML3D, in a frame


@checked(
    frames_per_second=checked_rate,
    layout=instance(str, "the name of a layout"),
    name=instance(str, "a text"),
)
def skeleton_from_positions(
    positions: ArrayLike,
    frames_per_second: float,
    *,
    layout: str | None = None,
    unit: str | float | None = None,
    name: str = "",
) -> SkeletonMotion:
    """Return a recorded skeleton from positions of joints over time.

    Rotations follow from the positions: hips and shoulders, and the bends of knees and elbows.

    Parameters
    ----------
    positions : array_like, shape (n_frames, J, 3) or (n_frames, J, 4)
        Positions of the joints, and how sure they are; NaN, or zeros, where a joint was not seen.
    frames_per_second : float
    layout : str, optional
        Order of the joints: "smpl" (22, as in HumanML3D), "smpl24", "h36m" or "coco" (17), "body25"
        (OpenPose) or "ntu" (25), "halpe26", "mediapipe" (33) or "wholebody" (133). By default that
        with J joints; of two, the one in which bones keep their lengths. A warning says which.
    unit : str or number, optional
        Unit of the positions, as for `load_bvh`.
    name : str
        Name of the motion.

    Examples
    --------
    >>> joints = np.load("new_joints/000021.npy")  # doctest: +SKIP
    >>> walk = rh.datasets.skeleton_from_positions(joints, 20.0, layout="smpl")  # doctest: +SKIP
    """
    array = real_array(values_of(positions, "positions"), "positions", finite=False)
    if array.ndim != 3 or array.shape[2] not in _WIDTHS:
        hint = ""
        if array.shape[-1:] == (2,):
            hint = ": these are places in a picture, not in space"
        elif array.ndim == 2 and array.shape[1] == _FEATURES:
            hint = ": these are HumanML3D's features; recover its joints, (n_frames, 22, 3)"
        elif array.ndim == 4:
            hint = ": give those of one person"
        raise ArgumentError(
            f"positions must have shape (n_frames, J, 3) or (n_frames, J, 4); found {array.shape}"
            + hint
        )
    if not len(array):
        raise ArgumentError("positions must hold at least one frame; found none")
    names = LAYOUTS[_layout(array[..., :3], layout, name)]
    return _skeleton(array[..., :3], names, frames_per_second, unit, name)


def load_positions(
    file: Path, frames_per_second: float | None, layout: str | None, unit: str | float | None
) -> SkeletonMotion:
    """Return the skeleton in a `.npy`, `.npz` or `.csv` file with positions of joints."""
    if file.suffix.lower() == ".csv" and read_text(file).startswith("Format Version"):
        raise FileFormatError(
            f"{file}: tables of OptiTrack's Motive are not read; in Motive, export C3D or BVH"
        )
    if frames_per_second is None:
        raise FileFormatError(f"{file} does not state its frame rate: pass frames_per_second=")
    with format_errors(file, "positions of joints"):
        if file.suffix.lower() == ".csv":
            names, positions = _read_table(file)
            if names and layout is None:
                return _skeleton(positions, names, frames_per_second, unit, file.stem)
        elif file.suffix.lower() == ".npy":
            positions = load_array(file)
        else:
            candidates = [array for array in load_arrays(file, ()).values() if has_joints(array)]
            if not candidates:
                raise ArgumentError("must hold an array of shape (n_frames, J, 3)")
            positions = max(candidates, key=lambda array: array.size)
        return skeleton_from_positions(
            positions, frames_per_second, layout=layout, unit=unit, name=file.stem
        )


def has_joints(array: Array) -> bool:
    """Return whether an array may hold the positions of joints in a known layout."""
    counts = {len(names) for names in LAYOUTS.values()}
    is_real = array.dtype.kind == "f" and array.ndim == 3
    return is_real and array.shape[1] in counts and array.shape[2] in _WIDTHS


def is_table_of_joints(file: Path) -> bool:
    """Return whether a table has columns for the coordinates of joints: left_hip_x, left_hip_y."""
    return bool(_coordinate_columns(read_text(file).partition("\n")[0].split(",")))


def _coordinate_columns(header: Sequence[str]) -> dict[str, list[int]]:
    """Return the columns of x, y and z of each joint by its name."""
    columns: dict[str, dict[str, int]] = {}
    for number, cell in enumerate(header):
        found = re.fullmatch(r"(.+?)[\s_.:-]+([xyz])", cell.strip().strip('"'), re.IGNORECASE)
        if found:
            joint = re.sub(r"^body[\s_.:-]+", "", found[1])
            columns.setdefault(joint, {})[found[2].lower()] = number
    return {
        joint: [places[axis] for axis in "xyz"]
        for joint, places in columns.items()
        if len(places) == 3
    }


def _read_table(file: Path) -> tuple[tuple[str, ...], Array]:
    """Return the names of joints, if the table has them, and positions (n_frames, J, 3)."""
    rows = [row for row in csv.reader(read_text(file).splitlines()) if any(row)]
    if not rows:
        raise ArgumentError("must hold a row for each frame; found none")
    columns = _coordinate_columns(rows[0])
    first = rows[0][0].strip()
    if not columns and (len(rows[0]) % 3 or (first[:1].isalpha() and first.lower() != "nan")):
        raise ArgumentError(
            "must have columns such as left_hip_x, left_hip_y and left_hip_z, or three numbers for "
            f"each joint, between commas; found {len(rows[0])} columns, from {first[:40]!r}"
        )
    numbers = np.array([[_number(cell) for cell in row] for row in rows[bool(columns) :]])
    if columns:
        places = np.array(list(columns.values()))
        return tuple(columns), numbers[:, places]
    return (), numbers.reshape(len(numbers), -1, 3)


def _number(cell: str) -> float:
    return float(cell) if cell.strip() else np.nan


def _layout(positions: Array, layout: str | None, name: str) -> str:
    """Return the layout with this number of joints, with a warning if it was not named."""
    n_joints = positions.shape[1]
    known = {key: len(names) for key, names in LAYOUTS.items()}
    if layout is not None:
        if known.get(layout) != n_joints:
            listed = ", ".join(f"{key!r} ({count})" for key, count in known.items())
            raise ArgumentError(
                f"layout must be that of {n_joints} joints among {listed}; found {shown(layout)}"
            )
        return layout
    candidates = [key for key, count in known.items() if count == n_joints]
    if not candidates:
        listed = ", ".join(f"{count} ({key})" for key, count in known.items())
        raise ArgumentError(f"positions must be of {listed} joints; found {n_joints}")
    chosen = min(candidates, key=lambda key: _variation(positions, LAYOUTS[key]))
    warn(
        f"{name or 'positions'}: {n_joints} joints were taken to be in the order of {chosen!r}; "
        "pass layout= if they are not",
        UserWarning,
    )
    return chosen


def _variation(positions: Array, names: Sequence[str]) -> float:
    """Return how much bones vary, over the frames and between the sides, as shares of them."""
    lengths = []
    for first, second in _BONES:
        bone = positions[:, names.index(second)] - positions[:, names.index(first)]
        lengths.append(np.linalg.norm(bone, axis=1))
    table = np.stack(lengths)
    table = table[:, np.isfinite(table).all(axis=0)]
    if not table.size:
        return np.inf
    usual = np.median(table, axis=1)
    over_time = np.mean(np.abs(table - usual[:, None]), axis=1) / np.maximum(usual, 1e-9)
    left, right = usual.reshape(2, -1)
    between = np.abs(left - right) / np.maximum(left + right, 1e-9)
    return float(over_time.mean() + between.mean())


def _skeleton(
    positions: Array, names: Sequence[str], rate: float, unit: str | float | None, name: str
) -> SkeletonMotion:
    # A root at the origin in all frames counts as unseen, too: no joint of a limb is there.
    places = (1.0 if unit is None else metres_in(unit)) * without_unseen(positions)
    label = name or "positions"
    known_unit = None if unit is None else "metres"
    return skeleton_of(Markers(label, tuple(names), places, rate, name, known_unit))
