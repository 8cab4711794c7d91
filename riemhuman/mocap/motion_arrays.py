"""Motions from arrays of poses in SMPL's joint order, as video methods write them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, ArrayLike
from riemhuman.bodies import BodyModel
from riemhuman.bodies.open_model import load_open_model
from riemhuman.checks import (
    checked,
    checked_rate,
    choice,
    instance,
    real_array,
    values_of,
)
from riemhuman.errors import ArgumentError, warn
from riemhuman.mocap._joint_names import model_joints
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
from riemhuman.mocap._upward import VIDEO, chosen_axis
from riemhuman.mocap.motions import ArrayMotion
from riemhuman.mocap.retargeting import RetargetedMotion
from riemhuman.surfaces.procrustes import AXES

# Rotation matrices in files are rounded to single precision, or come from networks.
_NOT_ORTHOGONAL = 0.05
# Coefficients of frames that differ by less than this are those of one person, rounded.
_SAME_PERSON = 1e-4


@checked(
    frames_per_second=checked_rate,
    up=choice(*AXES),
    model=instance(BodyModel),
    name=instance(str, "a text"),
)
def motion_from_arrays(
    poses: ArrayLike,
    translations: ArrayLike,
    frames_per_second: float,
    *,
    up: str | None = None,
    betas: ArrayLike | None = None,
    model: BodyModel | None = None,
    name: str = "",
    unit: str | float | None = None,
) -> ArrayMotion | RetargetedMotion:
    """Return a motion from poses in SMPL's joint order, such as those of video methods.

    A model of SMPL's family uses the poses directly. Another model, such as the open model,
    performs them as with `retarget`, with its own person: betas of SMPL have no meaning for it, and
    are ignored with a warning. A video shows one person, so betas that differ between frames are
    replaced by their mean, and a warning says by how much they differ.

    Parameters
    ----------
    poses : array_like, shape (n_frames, 3 J), (n_frames, J, 3) or (n_frames, J, 3, 3)
        Rotations of the joints relative to their parents: axis-angle vectors, radians, or matrices.
        J is 22 (body), 24 (with SMPL's two hand joints), 52 (SMPL-H) or 55 (SMPL-X).
    translations : array_like, shape (n_frames, 3)
        Translation of the body, ``trans`` or ``transl``.
    frames_per_second : float
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up; "-y" in the axes of most cameras. By default it is found from the
        position of the person and the floor, with a warning if it is ambiguous.
    betas : array_like, shape (B,) or (n_frames, B), optional
        Shape coefficients of the person; by default zeros.
    model : BodyModel, optional
        By default the open model, "coarse".
    name : str
        Name of the motion.
    unit : str or number, optional
        Unit of the translations, as for `load_bvh`; by default metres, in which nobody may move
        faster than people run.

    Returns
    -------
    ModelMotion
        Metres, y up.

    Raises
    ------
    ArgumentError
        If shapes do not match, or a matrix is not a rotation.

    Examples
    --------
    >>> poses, translations = np.zeros((10, 24, 3)), np.zeros((10, 3))
    >>> rh.datasets.motion_from_arrays(poses, translations, 30.0, up="y")
    <RetargetedMotion '' of '', 10 frames at 30 a second>
    """
    vectors = _pose_vectors(poses)
    rate = frames_per_second
    places = real_array(
        translations, "translations", (len(vectors), 3), batched=False, maximum=LARGEST
    )
    places = check_units(vectors, places, rate, unit)
    if up is None:
        up = chosen_axis(name, smpl_upward_axes(vectors, places, VIDEO))
    person, spread = one_person(betas, len(vectors))
    model = load_open_model("coarse") if model is None else model
    if is_smpl(model):
        warn_of_varying_betas(spread, name)
        shape = model_betas(person, model)
        parameters = model_parameters(model, shape, vectors, places, up)
        return ArrayMotion(("", name), rate, model, shape, *parameters)
    model_joints(model)
    if betas is not None:
        _say(
            "betas belong to SMPL's models and are ignored: the motion is performed by a person of "
            "another model",
            name,
        )
    recording = smpl_skeleton(vectors, places, rate, name, up)
    return RetargetedMotion(recording, model, ("", name), rate, len(vectors), up=up)


def _pose_vectors(poses: ArrayLike) -> Array:
    """Return poses as axis-angle vectors, shape (n_frames, J, 3), after checking their shape."""
    array = real_array(values_of(poses, "poses"), "poses", maximum=LARGEST)
    are_matrices = array.ndim == 4 and array.shape[2:] == (3, 3)
    if not are_matrices and array.ndim == 2 and array.shape[1] % 3 == 0:
        array = array.reshape(len(array), array.shape[1] // 3, 3)
    if not are_matrices and not (array.ndim == 3 and array.shape[2] == 3):
        raise ArgumentError(
            "poses must have shape (n_frames, 3 J), (n_frames, J, 3) or (n_frames, J, 3, 3); found "
            f"{array.shape}"
        )
    n_frames, n_joints = array.shape[:2]
    if n_joints not in LAYOUTS:
        counts = ", ".join(map(str, LAYOUTS))
        hint = ": put the rotation of the root first" if n_joints + 1 in LAYOUTS else ""
        raise ArgumentError(f"poses must be of {counts} joints; found {n_joints}{hint}")
    if not n_frames:
        raise ArgumentError("poses must have at least one frame; found none")
    if not are_matrices:
        return np.asarray(array)
    products = array @ np.swapaxes(array, -1, -2)
    wrong = np.abs(products - np.eye(3)).max(axis=(-2, -1)) > _NOT_ORTHOGONAL
    wrong |= np.linalg.det(array) < 0.0
    if wrong.any():
        frame, joint = (int(index) for index in np.argwhere(wrong)[0])
        raise ArgumentError(
            f"poses must hold rotation matrices; poses[{frame}, {joint}] is not one, the first "
            f"of {int(wrong.sum())}"
        )
    vectors: Array = Rotation.from_matrix(array.reshape(-1, 3, 3)).as_rotvec()
    return vectors.reshape(n_frames, n_joints, 3)


def one_person(betas: ArrayLike | None, n_frames: int) -> tuple[Array, Array]:
    """Return the mean over the frames of coefficients, and their standard deviations."""
    if betas is None:
        return np.zeros(0), np.zeros(0)
    array = real_array(values_of(betas, "betas"), "betas", maximum=LARGEST)
    if array.ndim == 2 and len(array) == 1:
        array = array[0]
    if array.ndim == 1:
        return array, np.zeros(len(array))
    if array.ndim != 2 or len(array) != n_frames:
        raise ArgumentError(
            f"betas must have shape (B,) or ({n_frames}, B), one row per frame; found {array.shape}"
        )
    return array.mean(axis=0), array.std(axis=0)


def warn_of_varying_betas(spread: Array, name: str) -> None:
    """Warn where the coefficients of one person differ from frame to frame."""
    if spread.max(initial=0.0) > _SAME_PERSON:
        number = int(spread.argmax())
        _say(
            "betas differ between frames, with a standard deviation of up to "
            f"{spread[number]:.2g} (coefficient {number}); the person has their mean",
            name,
        )


def _say(message: str, name: str) -> None:
    """Issue a warning, which begins with the name of the motion if it has one."""
    warn(f"{name}: {message}" if name else message, UserWarning)
