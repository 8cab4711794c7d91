"""Avatars in .smpl files, as Meshcapade's codec writes them: archives of plain arrays."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from riemhuman.arrays import Array
from riemhuman.checks import real_array, real_number, whole_number
from riemhuman.errors import FileFormatError

SMPL_ENDING = ".smpl"
# Numbers of the models in a file, and the parts of their poses: names, and numbers of joints.
_SMPLX = 2
_BODY = {"bodyPose": 24}
_BODY_AND_HANDS = {"bodyPose": 22, "leftHandPose": 15, "rightHandPose": 15}
_ALL = {"bodyPose": 22, "headPose": 3, "leftHandPose": 15, "rightHandPose": 15}
# SMPL, SMPL-H, SMPL-X, SUPR, SMIL and SMPL-XS.
_PARTS = {0: _BODY, 1: _BODY_AND_HANDS, _SMPLX: _ALL, 3: _ALL, 6: _BODY, 7: _ALL}
_BY_ANGLES = {4: "SMPL++", 5: "SKEL"}
_DEFAULT_RATE = 30.0
FIELDS_USED = (
    *("smplVersion", "shapeParameters", "frameCount", "frameRate", "bodyTranslation"),
    *("bodyPose", "headPose", "leftHandPose", "rightHandPose"),
)
"""Fields that are read; betas are used by models of SMPL's family."""


def fields_of_smpl(arrays: Mapping[str, Array]) -> dict[str, Array]:
    """Return poses, translations, betas and rate of an avatar, under names of recordings.

    An avatar without frames stands for one frame in the rest pose.
    """
    version = _number(arrays, "smplVersion", _SMPLX, minimum=0)
    if version in _BY_ANGLES:
        raise FileFormatError(
            f"holds poses of {_BY_ANGLES[version]}, 46 angles about anatomical axes, which are "
            "not rotations of SMPL's joints; export SMPL or SMPL-X"
        )
    if version not in _PARTS:
        raise FileFormatError(f"smplVersion must be from 0 to 7; found {version}")
    count = _number(arrays, "frameCount", 1)
    translations = _frames(arrays, "bodyTranslation", (count, 3))
    parts = [_frames(arrays, name, (count, size, 3)) for name, size in _PARTS[version].items()]
    stored_rate = arrays.get("frameRate", np.array(_DEFAULT_RATE))
    value = stored_rate.item() if stored_rate.size == 1 else stored_rate
    rate = real_number(value, "frameRate", minimum=0.0, strict=True)
    fields = {
        "poses": np.concatenate(parts, axis=1),
        "trans": translations,
        "fps": np.array(rate),
    }
    if "shapeParameters" in arrays:
        fields["betas"] = real_array(arrays["shapeParameters"], "shapeParameters")
    return fields


def _number(arrays: Mapping[str, Array], name: str, default: int, minimum: int = 1) -> int:
    value = arrays.get(name, np.array(default))
    return whole_number(value.item() if value.size == 1 else value, name, minimum=minimum)


def _frames(arrays: Mapping[str, Array], name: str, shape: tuple[int, ...]) -> Array:
    """Return a part of the poses or the translations, zeros where the file has none."""
    if name not in arrays:
        return np.zeros(shape)
    return real_array(arrays[name], name, shape, batched=False)
