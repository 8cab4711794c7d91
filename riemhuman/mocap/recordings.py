"""Recordings in any format that the library reads: one function for all.

Video methods write poses in SMPL's joint order, each under different names. Here, a field is
recognised by its name, wherever it is in a file; rates and axes are those of the method.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np

from riemhuman.arrays import Array, ArrayLike, JSONRecord, JSONValue
from riemhuman.bodies import BodyModel
from riemhuman.errors import ArgumentError, FileFormatError, RiemhumanError, shown, warn
from riemhuman.io.arrays import array_names, load_arrays
from riemhuman.io.files import file_path, format_errors, read_bytes, suffix_of
from riemhuman.io.gltf_animation import read_animation
from riemhuman.io.kinds_of_files import YES, FileKind, reads
from riemhuman.io.mesh_arrays import face_difference
from riemhuman.io.pickles import Unpickled, load_pickled_tree, load_torch_tree
from riemhuman.mocap._smpl_files import FIELDS_USED, SMPL_ENDING, fields_of_smpl
from riemhuman.mocap.amass import FIELDS_READ, RATES, load_amass
from riemhuman.mocap.amc import load_amc
from riemhuman.mocap.bvh import load_bvh
from riemhuman.mocap.joint_positions import ENDINGS as POSITION_ENDINGS
from riemhuman.mocap.joint_positions import has_joints, load_positions
from riemhuman.mocap.markers import load_c3d, load_trc
from riemhuman.mocap.motion_arrays import motion_from_arrays, one_person, warn_of_varying_betas
from riemhuman.mocap.motions import WRITTEN_MOTIONS, ArrayMotion, ModelMotion
from riemhuman.mocap.photographed_bodies import load_photographed_bodies
from riemhuman.mocap.retargeting import retarget
from riemhuman.mocap.skeleton_motion import SkeletonMotion, nearest_frames
from riemhuman.representation import join_names

RECORDING_ENDINGS = (
    *(".bvh", ".amc", ".trc", ".c3d"),
    *(".npz", ".smpl", ".pkl", ".pickle", ".joblib", ".pt", ".pth"),
)
"""Endings of recordings; `load_recording` also reads the tables and arrays of `ENDINGS`."""

# Names of whole poses, those in space before those before a camera, and of parts that make one.
_WHOLE_POSES = (
    *("pose_world", "poses_world", "poses", "pose", "smpl_poses", "smpl_thetas", "thetas"),
    *("pred_rotmat", "full_pose", "fullpose"),
)
_ROOT_POSES = ("global_orient", "root_orient", "smpl_orient", "pred_global_orient")
_BODY_POSES = ("body_pose", "pose_body", "smpl_body_pose", "pred_body_pose")
POSE_FIELDS = frozenset((*_WHOLE_POSES, *_ROOT_POSES))
"""Names of fields of which a file with a recording of poses has at least one."""
_TRANSLATIONS = (
    *("trans_world", "trans", "transl", "smpl_trans", "pred_trans", "translation", "root_trans"),
    *("cam_trans", "pred_cam_t", "camera"),
)
_BETAS = ("betas", "smpl_betas", "pred_shape", "shape", "pred_betas")
_RATES = ("fps", "frame_rate", "framerate", *RATES)
# AIST++ has its own unit of translations; this many of them are a metre.
_SCALE = "smpl_scaling"
# Of a person in space and before the camera, use the former.
_IN_SPACE, _BEFORE_CAMERA = ("global", "world"), ("incam", "cam")
# AIST++ records 60 frames a second; most videos have 30.
_RATE_OF_AIST, _RATE_OF_VIDEOS = 60.0, 30.0
_MOST_FIELDS = 24
# Fields without counterpart in the open model, which has neither a face nor single fingers.
_MEANINGS = {
    **dict.fromkeys(("dmpls", "dmpl"), "soft tissue"),
    **dict.fromkeys(("expression", "expressionParameters", "exp"), "expression of the face"),
    **dict.fromkeys(("pose_jaw", "jaw_pose", "headPose"), "jaw and eyes, of SMPL-X"),
    **dict.fromkeys(("pose_eye", "leye_pose", "reye_pose"), "eyes, of SMPL-X"),
    **dict.fromkeys(("pose_hand", "left_hand_pose", "right_hand_pose"), "fingers"),
    **dict.fromkeys(("leftHandPose", "rightHandPose"), "fingers, of models that have them"),
    "vertexOffsets": "details of the surface",
    "gender": "model to choose",
}
_SKELETONS = "skeletons and markers, in .bvh, .amc, .trc and .c3d"
# What to do with files of programs whose formats are closed, or need their models.
_EXPORTS = {
    ".fbx": "in Blender or MotionBuilder, export the animation as BVH",
    ".mvnx": "in Xsens MVN, export BVH, or C3D with joint centres",
    ".mvn": "in Xsens MVN, export BVH, or C3D with joint centres",
    ".mot": "it holds angles of an OpenSim model: load the TRC file from which they were computed",
    ".sto": "it holds angles of an OpenSim model: load the TRC file from which they were computed",
    ".vsk": "it holds a skeleton without a motion: in Vicon Nexus, export C3D",
    ".tak": "in OptiTrack Motive, export BVH or C3D",
}


@dataclass(frozen=True)
class _Person:
    """One person in a file: arrays over the frames."""

    name: str
    poses: Array
    translations: Array
    betas: Array | None
    rate: float | None
    fields: tuple[str, ...]


@dataclass(frozen=True)
class RecordingContents:
    """The fields of a file with a recording.

    Attributes
    ----------
    used, left_out : tuple of str
        Names of fields that `load_recording` uses and ignores, in alphabetical order. If the open
        model has no corresponding part, such as a face or single fingers, the meaning is given in
        parentheses.

    Examples
    --------
    >>> rh.datasets.load_open_motions("coarse")[0].save("dance.npz")
    >>> rh.datasets.recording_contents("dance.npz").left_out
    ()
    """

    used: tuple[str, ...]
    left_out: tuple[str, ...]


def recording_contents(
    path: str | os.PathLike[str], *, person: str | None = None
) -> RecordingContents:
    """Return which fields of a file `load_recording` uses, and which it ignores.

    Parameters
    ----------
    path : path_like
        A file of AMASS, a ``.smpl`` file, or one from a method that tracks people in videos.
    person : str, optional
        Which person, as for `load_recording`.

    Raises
    ------
    FileFormatError
        If the file holds no motion.

    Examples
    --------
    >>> rh.datasets.load_open_motions("coarse")[0].save("dance.npz")
    >>> rh.datasets.recording_contents("dance.npz").used[:2]
    ('betas', 'gender (model to choose)')
    """
    file = file_path(path)
    suffix = suffix_of(file, (".npz", SMPL_ENDING, ".pkl", ".pickle", ".joblib", ".pt", ".pth"))
    if suffix in (".npz", SMPL_ENDING):
        names = set(array_names(file))
        if suffix == SMPL_ENDING or names & set(RATES):
            used = names & set(FIELDS_USED if suffix == SMPL_ENDING else FIELDS_READ)
            return _contents(used, names)
    content = _read(file, suffix)
    chosen_person = _choose(_known_people(file, content), person, file)
    return _contents(set(chosen_person.fields), _leaves(content))


def _contents(used: set[str], names: set[str]) -> RecordingContents:
    """Return names with their meanings, as far as these are known."""
    return RecordingContents(
        used=tuple(_with_meaning(name) for name in sorted(used)),
        left_out=tuple(_with_meaning(name) for name in sorted(names - used)),
    )


def _with_meaning(name: str) -> str:
    return f"{name} ({_MEANINGS[name]})" if name in _MEANINGS else name


def _leaves(content: object) -> set[str]:
    """Return the names of all fields that are no dictionaries, of people in frames and lists."""
    if isinstance(content, list):
        leaves = [_leaves(item) for item in content if isinstance(item, dict)]
        return set().union(*leaves)
    if not isinstance(content, dict):
        return set()
    names = set()
    for key, value in content.items():
        is_nested = isinstance(value, dict) or (
            isinstance(value, list) and any(isinstance(item, dict) for item in value)
        )
        names |= _leaves(value) if is_nested else {str(key)}
    return names


# More than eight arguments: each keyword states a fact that some kinds of files omit.
@reads(
    FileKind(
        "skeletons, markers, joints, and people in videos",
        "datasets.load_recording",
        (*RECORDING_ENDINGS, *POSITION_ENDINGS, ".glb"),
        registered=YES,
        measured=YES,
        is_motion=True,
        written=WRITTEN_MOTIONS,
    )
)
def load_recording(
    path: str | os.PathLike[str],
    model: BodyModel | None = None,
    *,
    frames_per_second: float | None = None,
    up: str | None = None,
    betas: ArrayLike | None = None,
    joints: Mapping[str, str | Sequence[str]] | None = None,
    person: str | None = None,
    unit: str | float | None = None,
    faces: ArrayLike | os.PathLike[str] | None = None,
    layout: str | None = None,
    progress: bool = False,
) -> ModelMotion:
    """Read a recording of a person's motion, in any format that the library knows.

    - ``.bvh`` and ``.amc`` (Acclaim, with its ``.asf`` next to it), see `load_bvh`, `load_amc`;
    - ``.trc`` and ``.c3d``, markers from which the centres of joints are found, see `load_trc`,
      `load_c3d`;
    - ``.glb`` with an animated skeleton, as Blender and `Motion.save` write it;
    - ``.npz`` in AMASS's layout, see `load_amass`;
    - ``.smpl``, avatars of Meshcapade's codec, with frames or in the rest pose;
    - ``.npz``, ``.pkl`` and ``.pt`` of methods that track people in videos, see
      `motion_from_arrays`: those of AIST++, WHAM, GVHMR, 4D-Humans, TRAM and ROMP, and others whose
      fields have the same names. No code in a file is run; a file that holds other objects is
      refused;
    - ``.npy``, ``.npz`` and ``.csv`` with the positions of joints, as HumanML3D, Human3.6M,
      MediaPipe, OpenPose, COCO and FreeMoCap have them, see `skeleton_from_positions`;
    - ``.npz`` of SAM 3D Body, with `faces`: its bodies are treated as frames of one person's
      motion, see `load_photographed_bodies`.

    Parameters
    ----------
    path : path_like
    model : BodyModel, optional
        By default the open model, "coarse".
    frames_per_second : float, optional
        Frame rate of the motion, at most that of the recording: the frames nearest in time are
        used. If a file states no rate, or one that cannot be right, this is the rate of the
        recording; files of video methods have 30 by default, with a warning.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis of the recording that points up; by default the one along which people stand.
    betas : array_like, shape (B,), or "recorded", optional
        Shape coefficients of the person, for `model`; by default those of the file if they are for
        this model, otherwise as for `retarget`, which finds a person with the recorded bones for
        "recorded".
    joints : mapping of str to str, optional
        Names of joints of a skeleton, see `retarget`, or of markers, see `load_trc`.
    person : str, optional
        Which person, in files with several people; by default the one seen in the most frames, with
        a warning.
    unit : str or number, optional
        Unit of the lengths of a skeleton, which are then kept, see `retarget`; .amc files are read
        in metres, and .trc and .c3d files name their unit. Or unit of the translations beside poses
        of SMPL, by default metres.
    faces : array_like of int, shape (F, 3), or path_like, optional
        Triangles of bodies of SAM 3D Body. `model` must have the same triangles; `transfer_model`
        creates such a model. It is fitted to every frame, and the person has the mean of the betas;
        a warning says by how much they differ.
    layout : str, optional
        Order of joints whose positions the file holds, see `skeleton_from_positions`.
    progress : bool
        As for `retarget`.

    Raises
    ------
    FileFormatError
        If the file holds no motion; the error lists its fields.

    Examples
    --------
    >>> walk = rh.datasets.load_recording("walk.bvh")  # doctest: +SKIP
    >>> dance = rh.datasets.load_recording("gBR_sBM_cAll_d04.pkl")  # doctest: +SKIP
    """
    motion: ModelMotion
    file = file_path(path)
    suffix = _ending(file)
    if faces is not None:
        if suffix != ".npz" or joints is not None or unit is not None or person is not None:
            raise ArgumentError(
                "faces is for .npz files of SAM 3D Body, without joints, unit and person; found "
                f"{file.name}"
            )
        rate = frames_per_second or _RATE_OF_VIDEOS
        motion = _photographed_motion(file, faces, model, rate, up)
        return motion if betas is None else motion.performed_by(betas)
    perform = partial(
        retarget, model=model, betas=betas, frames_per_second=frames_per_second, progress=progress
    )
    if suffix in (".bvh", ".amc", ".glb"):
        if suffix == ".bvh":
            recording = load_bvh(file, frames_per_second=frames_per_second)
        else:
            recording = load_amc(file) if suffix == ".amc" else _animation(file)
        if suffix == ".glb":
            up = up or "y"
        return perform(recording, joints=cast("Mapping[str, str] | None", joints), up=up, unit=unit)
    if suffix in (".trc", ".c3d"):
        load = load_trc if suffix == ".trc" else load_c3d
        recording = load(file, unit=unit, joints=joints, frames_per_second=frames_per_second)
        return perform(recording, up=up)
    if joints is not None:
        raise ArgumentError(f"joints is for {_SKELETONS}; found {file.name}")
    if suffix in POSITION_ENDINGS or (suffix == ".npz" and _holds_positions(file)):
        return perform(load_positions(file, frames_per_second, layout, unit), up=up)
    if layout is not None:
        raise ArgumentError(f"layout is for positions of joints; found {file.name}")
    if suffix == ".npz" and set(RATES) & set(array_names(file)):
        (motion,) = load_amass(file, model, frames_per_second=frames_per_second, up=up, unit=unit)
    else:
        motion = _video_motion(file, suffix, model, frames_per_second, up, person, unit)
    return motion if betas is None else motion.performed_by(betas)


def _animation(file: Path) -> SkeletonMotion:
    """Return the skeleton of a GLB file and its first animation, metres, y up."""
    with format_errors(file, "an animated skeleton"):
        motion = read_animation(read_bytes(file))
        return SkeletonMotion(
            *(motion.names, motion.parents, motion.rest, motion.rotations, motion.translations),
            *(motion.frames_per_second, file.stem, "metres"),
            has_rest_pose=motion.is_rest,
        )


def _ending(file: Path) -> str:
    """Return the ending of a recording, or say how to export one of other programs."""
    other = _EXPORTS.get(file.suffix.lower())
    if other is not None:
        raise FileFormatError(f"{file}: {file.suffix} files are not read; {other}")
    return suffix_of(file, (*RECORDING_ENDINGS, *POSITION_ENDINGS, ".glb"))


def _holds_positions(file: Path) -> bool:
    """Return whether an archive holds positions of joints, and no poses under known names."""
    names = array_names(file)
    if POSE_FIELDS & set(names) or "pred_vertices" in names:
        return False
    return any(has_joints(array) for array in load_arrays(file, ()).values())


def _photographed_motion(
    path: Path,
    faces: ArrayLike | os.PathLike[str],
    model: BodyModel | None,
    frames_per_second: float,
    up: str | None,
) -> ArrayMotion:
    """Return the bodies in a file, moments of a person's motion, as a motion with one shape."""
    photographed = load_photographed_bodies(path, faces, up=up)
    difference = face_difference(photographed.faces, model.faces) if model else "no model is given"
    if model is None or difference:
        raise FileFormatError(
            f"{path} holds surfaces without poses, for which a body model with their triangles "
            f"is needed: {difference}. topologies.transfer_model(load_open_model(), "
            "Template(body, faces)) creates one"
        )
    points = photographed.places
    fit = model.fit(points, betas_prior=1e-7, sequence=True)
    person, spread = one_person(fit.betas, len(points))
    name = path.stem
    warn_of_varying_betas(spread, name)
    return ArrayMotion(("", name), frames_per_second, model, person, fit.pose, fit.trans)


def _video_motion(
    file: Path,
    suffix: str,
    model: BodyModel | None,
    frames_per_second: float | None,
    up: str | None,
    person: str | None,
    unit: str | float | None,
) -> ModelMotion:
    """Return the motion of one person in a file of a method that watches videos."""
    content = _read(file, suffix)
    chosen_person = _choose(_known_people(file, content), person, file)
    rate = chosen_person.rate or frames_per_second
    if rate is None:
        if suffix == ".npz":
            raise FileFormatError(f"{file} does not state its frame rate: pass frames_per_second=")
        rate = _RATE_OF_VIDEOS
        warn(
            f"{file.name} does not state its frame rate; {rate:g} a second are taken, as in most "
            "videos: pass frames_per_second=",
            UserWarning,
        )
    frames = np.arange(len(chosen_person.poses))
    if frames_per_second is not None:
        frames = nearest_frames(len(frames), rate, frames_per_second)
        rate = frames_per_second
    betas = chosen_person.betas
    if betas is not None and betas.ndim == 2:
        betas = betas[frames]
    try:
        return motion_from_arrays(
            chosen_person.poses[frames],
            chosen_person.translations[frames],
            rate,
            up=up,
            betas=betas,
            model=model,
            name=file.stem,
            unit=unit,
        )
    except RiemhumanError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _known_people(file: Path, content: object) -> list[_Person]:
    """Return the people in a file, of whom there must be one."""
    people = list(_people(content, ""))
    if not people and isinstance(content, dict) and "pred_vertices" in content:
        raise FileFormatError(
            f"{file} holds bodies of SAM 3D Body, without poses of SMPL: read them with "
            "load_photographed_bodies(path, faces), or pass faces= to get a motion"
        )
    if not people:
        raise FileFormatError(
            f"{file} holds no motion in a known layout, which has poses in SMPL's joint order, "
            "such as poses, or global_orient and body_pose, and a translation, such as trans; "
            f"it holds {join_names(sorted(_leaves(content)), _MOST_FIELDS) or 'no fields'}"
        )
    return people


def _read(file: Path, suffix: str) -> Unpickled:
    if suffix == SMPL_ENDING:
        arrays = load_arrays(file, ())
        with format_errors(file, "an avatar of SMPL's codec"):
            return fields_of_smpl(arrays)
    if suffix == ".npz":
        return load_arrays(file, ())
    if suffix in (".pt", ".pth"):
        return load_torch_tree(file)
    return load_pickled_tree(file)


def _people(content: object, name: str) -> Iterator[_Person]:
    """Yield the people in a dictionary, in those that it holds, and in frames of lists."""
    if not isinstance(content, dict):
        return
    person = _person(content, name)
    if person is not None:
        yield person
        return
    by_frame = _people_by_frame(content)
    if by_frame:
        for label, frames in by_frame.items():
            person = _person(_stacked(frames), label)
            if person is not None:
                yield person
        return
    inner = {key: value for key, value in content.items() if isinstance(value, dict)}
    in_space = [key for key in inner if any(word in key for word in _IN_SPACE)]
    before_camera = [key for key in inner if any(word in key for word in _BEFORE_CAMERA)]
    for key, value in inner.items():
        if not (in_space and key in before_camera):
            label = f"{name}/{key}" if name else key
            yield from _people(value, label)


def _people_by_frame(content: Mapping[str, JSONValue]) -> dict[str, list[JSONRecord]]:
    """Return the fields of each person in each frame, where the keys are frames of a video."""
    people: dict[str, list[JSONRecord]] = {}
    for frame in content.values():
        if not isinstance(frame, dict):
            return {}
        # As 4D-Humans has it: lists over the people in the frame, who have numbers.
        bodies = frame.get("smpl", frame)
        bodies = bodies if isinstance(bodies, list) else [bodies]
        labels = frame.get("tid", range(len(bodies)))
        cameras = frame.get("camera", [None] * len(bodies))
        if len(bodies) > min(len(labels), len(cameras)):
            return {}
        for body, label, camera in zip(bodies, labels, cameras, strict=False):
            if not isinstance(body, dict) or not _is_one_frame(body):
                return {}
            moved = body if camera is None else body | {"camera": camera}
            people.setdefault(str(label), []).append(moved)
    return people


def _is_one_frame(body: Mapping[str, JSONValue]) -> bool:
    """Return whether these fields are of a single frame."""
    root = _first(body, _ROOT_POSES)
    whole = _first(body, _WHOLE_POSES)
    if root is not None:
        return root.size in (3, 9)
    return whole is not None and (whole.ndim == 1 or len(whole) == 1 or whole.shape[1:] == (3, 3))


def _stacked(frames: list[JSONRecord]) -> JSONRecord:
    """Return the fields of all frames, each an array over the frames."""
    shared = set(frames[0]).intersection(*frames[1:])
    stacked = {}
    for key in shared:
        arrays = [np.asarray(frame[key]) for frame in frames]
        if arrays[0].dtype.kind in "fiu" and len({array.shape for array in arrays}) == 1:
            stacked[key] = np.stack(arrays)
    return stacked


def _person(content: Mapping[str, JSONValue], name: str) -> _Person | None:
    """Return the person whose poses and translations are among these fields."""
    poses, pose_fields = _poses(content)
    translations = _first(content, _TRANSLATIONS)
    if poses is None or translations is None or not len(poses):
        return None
    n_frames = len(poses)
    if translations.size != 3 * n_frames:
        return None
    translations = translations.reshape(n_frames, 3)
    scale, rate = _first(content, (_SCALE,)), _first(content, _RATES)
    if scale is not None and scale.size == 1 and scale.item() > 0.0:
        translations = translations / scale.item()
    betas = _first(content, _BETAS)
    if betas is not None:
        if betas.ndim > 1 and len(betas) == n_frames:
            betas = betas.reshape(n_frames, -1)
        elif betas.ndim == 1 or len(betas) == 1:
            betas = betas.reshape(-1)
    frame_rate: float | None = None
    if rate is not None and rate.size == 1 and rate.item() > 0:
        frame_rate = float(rate.item())
    elif scale is not None:
        frame_rate = _RATE_OF_AIST
    fields = [
        _first_name(content, names)
        for names in (*pose_fields, _TRANSLATIONS, _BETAS, _RATES, (_SCALE,))
    ]
    used_fields = tuple(field for field in fields if field is not None)
    return _Person(name, poses, translations, betas, frame_rate, used_fields)


def _poses(
    content: Mapping[str, JSONValue],
) -> tuple[Array | None, tuple[tuple[str, ...], ...]]:
    """Return the rotations of all joints, and what their fields may be."""
    whole = _rotations(_first(content, _WHOLE_POSES))
    if whole is not None:
        return whole, (_WHOLE_POSES,)
    parts = (_ROOT_POSES, _BODY_POSES)
    root, body = (_rotations(_first(content, names)) for names in parts)
    if root is None or body is None or len(root) != len(body) or root.ndim != body.ndim:
        return None, parts
    return np.concatenate([root, body], axis=1), parts


def _rotations(array: Array | None) -> Array | None:
    """Return rotations of any layout by joints: vectors (n_frames, J, 3), or their matrices."""
    if array is None or array.ndim < 2:
        return None
    shape = (3, 3) if array.shape[-2:] == (3, 3) and array.ndim > 2 else (3,)
    if array.size % (math.prod(shape) * max(len(array), 1)):
        return None
    return array.reshape(len(array), -1, *shape).astype(float)


def _first(content: Mapping[str, JSONValue], names: tuple[str, ...]) -> Array | None:
    """Return the first of some fields that holds numbers."""
    name = _first_name(content, names)
    return None if name is None else np.asarray(content[name])


def _first_name(content: Mapping[str, JSONValue], names: tuple[str, ...]) -> str | None:
    """Return the name of the first of some fields that holds numbers."""
    for name in names:
        value = content.get(name)
        if isinstance(value, (int, float, np.ndarray, list)):
            try:
                array = np.asarray(value)
            except ValueError:  # parts of different lengths
                continue
            if array.dtype.kind in "fiu":
                return name
    return None


def _choose(people: list[_Person], person: str | None, file: Path) -> _Person:
    """Return the requested person, or the one seen most."""
    names = [candidate.name for candidate in people]
    if person is not None:
        if person not in names:
            raise ArgumentError(f"person must be one of {', '.join(names)}; found {shown(person)}")
        return people[names.index(person)]
    longest = max(people, key=lambda candidate: len(candidate.poses))
    if len(people) > 1:
        warn(
            f"{file.name} holds {len(people)} people ({', '.join(names[:8])}); person "
            f"{longest.name}, seen in {len(longest.poses)} frames, was taken. To choose another "
            "person, pass person=",
            UserWarning,
        )
    return longest
