"""Motions of AMASS, whose frames a body model computes on access."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array, Integers, Values
from riemhuman.bodies import BodyModel
from riemhuman.bodies.open_model import load_open_model
from riemhuman.checks import check_shape, checked, checked_rate, choice, instance, real_array
from riemhuman.errors import ArgumentError, FileError, FileFormatError, warn
from riemhuman.io.arrays import array_headers, array_names, check_fields, load_arrays
from riemhuman.io.files import file_path, format_errors, visible_files
from riemhuman.io.kinds_of_files import YES, FileKind, reads
from riemhuman.mocap._body_size import model_of_size
from riemhuman.mocap._joint_names import model_joints
from riemhuman.mocap._motion_files import SAVED_FIELDS, frame_digests
from riemhuman.mocap._smpl_layout import (
    LAYOUTS,
    check_units,
    is_smpl,
    model_betas,
    model_parameters,
    smpl_skeleton,
    smpl_upward_axes,
)
from riemhuman.mocap._text_lines import LARGEST
from riemhuman.mocap._upward import AMASS, chosen_axis
from riemhuman.mocap.motions import WRITTEN_MOTIONS, ArrayMotion, ModelMotion, Motions
from riemhuman.mocap.retargeting import RetargetedMotion
from riemhuman.mocap.skeleton_motion import SkeletonMotion, nearest_frames
from riemhuman.surfaces.procrustes import AXES, make_upright

RATES = ("mocap_framerate", "mocap_frame_rate")
"""Fields of which a file of AMASS has one."""

_POSES = {"root_orient": 3, "pose_body": 63, "pose_jaw": 3, "pose_eye": 6, "pose_hand": 90}
_NEEDED_POSES = ("root_orient", "pose_body")
FIELDS_READ = frozenset(("trans", "betas", "gender", "poses", *_POSES, *RATES, *SAVED_FIELDS))
"""Fields of a file that `load_amass` reads; betas and gender are those of SMPL's models."""
_SKIPPED = ("shape.npz", "_stagei.npz")
_ENDINGS = ("_poses", "_stageii")
_FILES_KEPT = 4


class _Recording(NamedTuple):
    """The arrays of a file."""

    betas: Array
    poses: Array  # (T, joints, 3)
    translations: Array  # metres


class _Source(NamedTuple):
    """A file whose arrays are read when frames are asked for, and then kept for a while."""

    path: Path
    modified: int  # when, so that another content is read
    gender: str
    rate: float
    n_frames: int
    unit: str | float | None  # of translations, as the user says

    @property
    def names(self) -> tuple[str, str]:
        """Names of the person and of the motion."""
        sequence = self.path.stem
        for ending in _ENDINGS:
            sequence = sequence.removesuffix(ending)
        return self.path.absolute().parent.name, sequence

    def upward_axis(self) -> str:
        """Return the axis that points up; warn if in doubt."""
        recording = _read(self)
        axes = smpl_upward_axes(recording.poses, recording.translations, AMASS)
        return chosen_axis(self.path.name, axes)


class AmassMotion(ModelMotion):
    """One motion of AMASS; frame i is ``model(betas, pose_vectors[i], translations[i])``."""

    def __init__(
        self,
        source: _Source,
        model: BodyModel,
        rate: float,
        frames: Integers,
        up: str | None = None,
    ) -> None:
        super().__init__(*source.names, rate, len(frames), model)
        self.path = source.path
        self.gender = source.gender
        self._source = source
        self._numbers = frames
        self._up = up

    @property
    def betas(self) -> Array:
        """Shape coefficients of the model, shape (B,); those missing in the file are zero."""
        return model_betas(_read(self._source).betas, self.model)

    @cached_property
    def up(self) -> str:
        """Axis of the file that points up."""
        return self._up or self._source.upward_axis()

    def _parameters(self, numbers: Integers) -> tuple[Array, Array]:
        recording = _read(self._source)
        frames = self._numbers[numbers]
        poses, translations = recording.poses[frames], recording.translations[frames]
        return model_parameters(self.model, self.betas, poses, translations, self.up)


@reads(
    FileKind(
        "AMASS",
        "datasets.load_amass",
        (".npz",),
        registered=YES,
        measured=YES,
        is_motion=True,
        written=WRITTEN_MOTIONS,
    )
)
@checked(model=instance(BodyModel), frames_per_second=checked_rate, up=choice(*AXES))
def load_amass(
    path: str | os.PathLike[str],
    model: BodyModel | None = None,
    *,
    frames_per_second: float | None = None,
    up: str | None = None,
    unit: str | float | None = None,
) -> Motions[AmassMotion | ArrayMotion | RetargetedMotion]:
    """Load motions of AMASS [1]_ for a body model; frames are computed on access.

    The data set is available from its authors. The subject of a motion is the name of its file's
    folder. In the result y points up, in the files of AMASS z does. In other files with AMASS's
    layouts, such as Motion-X, y may point up: the axis along which people stand on a floor is used.
    Files in the layouts of SMPL-H (``poses``) and SMPL-X (``root_orient``, ``pose_body``, …) are
    read: rotations of the 22 joints of SMPL's body, and of the 33 joints of hands and face if both
    model and file have them. Soft tissue (``dmpls``) is not used.

    Another model, such as the open model, performs the motions as with `retarget`. Betas in the
    files belong to SMPL's models, so they are then ignored, with a warning, and an average adult
    performs the motion; ``motion.performed_by(betas)`` gives the motion of another person. Files
    written by `Motion.save` restore the motion of the open model exactly, also if other programs
    cut or reorder its frames; if they change poses, the same person performs these as with
    `retarget`.

    Parameters
    ----------
    path : path_like
        A file, or a folder with .npz files at any depth, which are read in the order of their
        names; ``shape.npz`` and ``*_stagei.npz`` hold no motion and are skipped.
    model : BodyModel, optional
        SMPL, SMPL-H or SMPL-X model, of 22, 24, 52 or 55 joints, or another with named joints; by
        default the open model, "coarse". For models of men and women, load the files with each, and
        keep the motions of its ``gender``.
    frames_per_second : float, optional
        Frame rate, at most that of the files: the frames nearest in time are used. By default all
        frames are used. Files that do not state their rate have this one.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis of the files that points up; by default it is found in each file when its frames are
        first used, with a warning if it is ambiguous.
    unit : str or number, optional
        Unit of translations, as for `load_bvh`; by default metres, in which nobody may move faster
        than people run.

    References
    ----------
    .. [1] Mahmood, Ghorbani, Troje, Pons-Moll, Black, "AMASS: Archive of Motion Capture as
       Surface Shapes", ICCV 2019.

    Examples
    --------
    >>> rh.datasets.load_amass("AMASS/CMU")[0][:10].shape  # doctest: +SKIP
    (10, 1202, 3)
    """
    model = load_open_model("coarse") if model is None else model
    if not is_smpl(model):
        model_joints(model)
    root = file_path(path, kind="file or folder")
    files = [root]
    if root.is_dir():
        files = visible_files(root, ".npz", deep=True)
        files = [file for file in files if not file.name.endswith(_SKIPPED)]
    if not files:
        raise FileError(f"{root} holds no .npz file with a motion")
    motions: list[AmassMotion | ArrayMotion | RetargetedMotion] = []
    is_other_model = False
    for file in files:
        source = _read_header(file, frames_per_second, unit)
        rate = source.rate if frames_per_second is None else frames_per_second
        frames = nearest_frames(source.n_frames, source.rate, rate)
        saved = _saved_motion(source, model, frames, rate, up)
        if saved is not None:
            motions.append(saved)
        elif is_smpl(model):
            motions.append(AmassMotion(source, model, rate, frames, up))
        else:
            is_other_model = True
            axis = source.upward_axis if up is None else up
            recording = partial(_skeleton_motion, source, frames, rate, axis)
            motions.append(
                RetargetedMotion(recording, model, source.names, rate, len(frames), up=axis)
            )
    if is_other_model:
        warn(
            "betas in the files belong to SMPL's models and are ignored: motions are performed by "
            "a person of another model",
            UserWarning,
        )
    return Motions(motions)


def _saved_motion(
    source: _Source, model: BodyModel, frames: Integers, rate: float, up: str | None
) -> ArrayMotion | RetargetedMotion | None:
    """Return the motion of a person of this model that `Motion.save` wrote as poses of SMPL."""
    fields = load_arrays(source.path, (), SAVED_FIELDS)
    if not set(SAVED_FIELDS) <= fields.keys():
        return None
    joints, betas, rest, poses, digests = (fields[name] for name in SAVED_FIELDS)
    if tuple(joints.tolist()) != model.joint_names or betas.shape != (model.n_betas,):
        return None
    with format_errors(source.path, "a motion"):
        betas = real_array(betas, SAVED_FIELDS[1])
        rest = real_array(rest, SAVED_FIELDS[2], (model.n_joints, 3), batched=False)
        poses = real_array(poses, SAVED_FIELDS[3], ("n_frames", model.n_joints, 3), batched=False)
        check_shape(digests, SAVED_FIELDS[4], (len(poses),), batched=False)
    recording = _read(source)
    performer = model_of_size(model, betas, rest)
    rows = dict(zip(digests.tolist(), range(len(digests)), strict=True))
    keys = frame_digests(recording.poses[frames].reshape(len(frames), -1)).tolist()
    if up not in (None, "z") or not set(keys) <= rows.keys():
        # Other programs have changed what the frames show.
        axis = source.upward_axis() if up is None else up
        skeleton = _skeleton_motion(source, frames, rate, axis)
        return RetargetedMotion(
            skeleton, performer, source.names, rate, len(frames), betas=betas, up=axis
        )
    places = make_upright(recording.translations[frames], up="z") - rest[0]
    known_poses = poses[[rows[key] for key in keys]]
    return ArrayMotion(source.names, rate, performer, betas, known_poses, places)


def _skeleton_motion(
    source: _Source, frames: Integers, rate: float, up: str | Callable[[], str]
) -> SkeletonMotion:
    """Return the joints of SMPL's body in frames of a file."""
    recording = _read(source)
    poses, translations = recording.poses[frames], recording.translations[frames]
    axis = up() if callable(up) else up
    return smpl_skeleton(poses, translations, rate, source.names[1], axis)


def _read_header(file: Path, rate: float | None, unit: str | float | None) -> _Source:
    """Return what a file says of itself; its frame rate is the given one if it states none."""
    # Other arrays may hold Python objects, like the markers of SMPL-X.
    names = array_names(file)
    headers = array_headers(file, ("trans", "poses", *_POSES))
    shapes = {name: shape for name, (shape, _) in headers.items()}
    rate_name = next((name for name in RATES if name in names), None)
    are_parts = any(name in names for name in _NEEDED_POSES)
    required = ["trans", "betas", *(_NEEDED_POSES if are_parts else ["poses"])]
    with format_errors(file, "a motion"):
        check_fields(names, required)
    fields = load_arrays(file, (), ["gender", *RATES])
    n_frames = shapes["trans"][0] if shapes["trans"] else 0
    widths = {"trans": (3,), "poses": tuple(3 * number for number in LAYOUTS)}
    widths |= {name: (width,) for name, width in _POSES.items()}
    for name, accepted in widths.items():
        shape = shapes.get(name, (n_frames, accepted[0]))
        if n_frames == 0 or len(shape) != 2 or shape[0] != n_frames or shape[1] not in accepted:
            length = n_frames or "n_frames"
            width = " or ".join(map(str, accepted))
            raise FileFormatError(
                f"{file}: {name} must have shape ({length}, {width}); found {shape}"
            )
    gender = _gender(fields.get("gender", np.array("neutral")), file)
    if rate_name is not None:
        with format_errors(file, "a motion"):
            rates = fields[rate_name]
            rate = checked_rate(rates.item() if rates.size == 1 else rates, rate_name)
    elif rate is None:
        raise FileFormatError(
            f"{file} does not state its frame rate, in {' or '.join(RATES)}: pass "
            "frames_per_second="
        )
    return _Source(file, file.stat().st_mtime_ns, gender, rate, n_frames, unit)


def _gender(value: Values, file: Path) -> str:
    """Return the gender in a file, which may be text, bytes, or the text of bytes."""
    if value.size != 1 or value.dtype.kind not in "SU":
        raise FileFormatError(f"{file}: gender must be a word; found {value.dtype} {value.shape}")
    word: str | bytes = value.item()
    text = word.decode("latin-1") if isinstance(word, bytes) else word
    return text.removeprefix("b'").removesuffix("'").strip().lower()


@lru_cache(maxsize=_FILES_KEPT)
def _read(source: _Source) -> _Recording:
    """Return the arrays of a file, of which the latest few are kept."""
    file = source.path
    fields = load_arrays(file, ("trans", "betas"), ("poses", *_POSES))
    with format_errors(file, "a motion"):
        for name, array in fields.items():
            fields[name] = real_array(array, name, maximum=LARGEST)
        betas = np.atleast_2d(fields["betas"])
        if betas.ndim > 2 or not len(betas) or (betas != betas[:1]).any():
            raise ArgumentError(f"betas must describe one person; found shape {betas.shape}")
        n_frames = source.n_frames
        poses = fields.get("poses")
        if poses is None:
            parts = [
                fields.get(name, np.zeros((n_frames, width))) for name, width in _POSES.items()
            ]
            poses = np.concatenate(parts, axis=1)
        poses = poses.reshape(n_frames, -1, 3)
        translations = check_units(poses, fields["trans"], source.rate, source.unit)
        return _Recording(betas[0], poses, translations)
