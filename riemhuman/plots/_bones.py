"""Motions of body models in pages: a surface at rest, and the motion of each bone per frame.

The page poses the surface by linear blend skinning, as `riemhuman.bodies.skin_surface` does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Integers
from riemhuman.bodies import BodyModel, joint_motions, skin_surface
from riemhuman.kernels.rotations import with_continuous_signs
from riemhuman.kernels.threads import slices
from riemhuman.mocap.motions import ModelMotion
from riemhuman.plots._packing import LEVELS, deflated, packed
from riemhuman.plots.standing import ground_height

_STEP = 1e-4  # metres: of places in the page
_UNIT = 2**15 - 1  # of quaternions
# Pose correctives that the page leaves out are smaller than this in the mean over all vertices.
_CORRECTIVE_ERROR = 2e-4
_N_IN_EXTENT = 1200  # number of vertices used to measure the room that a motion takes
_SOLES = 0.03  # height of the part of the body at rest that may carry it, of its own height
_FRAMES_AT_A_TIME = 64


@dataclass(frozen=True)
class Extent:
    """The box around all frames of a motion, its radius from above, and the height of its ground.

    Some vertices stand for all of them, and pose correctives are left out: a few millimetres.
    """

    low: Array
    high: Array
    radius: float
    ground: float


def bone_record(motion: ModelMotion, translations: Array, extent: Extent) -> dict[str, object]:
    """Return what the page needs to pose a body: at most 0.1 mm and 1e-4 radians are rounded.

    The motion is shown at the translations, shape (n_times, 3); its extent is that of `extent_of`.
    """
    surface = np.asarray(motion.model(motion.betas), dtype=np.float64)
    starts, joints, weights = _influences(motion.model.weights)
    poses = motion.pose_vectors
    quaternions = Rotation.from_rotvec(poses.reshape(-1, 3)).as_quat().reshape(len(poses), -1, 4)
    rotations = _UNIT * with_continuous_signs(quaternions)
    low = surface.min(axis=0)
    first = translations[0]
    record: dict[str, object] = {
        "low": low.tolist(),
        "rest": packed(np.round((surface - low) / _STEP).astype("<u2")),
        "joints": np.round(np.asarray(motion.model.joints(motion.betas)), 6).tolist(),
        "parents": motion.model.parents.tolist(),
        "order": list(motion.model.joint_order),
        "starts": packed(starts.astype("<u4")),
        "influences": deflated(joints.astype("<u2")),
        "weights": deflated(np.round(weights * LEVELS).astype("<u2")),
        "rotations": _packed_signed(np.round(rotations), "<i2", "<u2"),
        "first": first.tolist(),
        "places": _packed_signed(np.round((translations - first) / _STEP), "<i4", "<u4"),
        "step": _STEP,
        "extent": {
            "low": extent.low.tolist(),
            "high": extent.high.tolist(),
            "radius": extent.radius,
        },
    }
    if motion.model.posedirs is not None:
        record["correctives"] = _correctives(motion.model, poses)
    return record


def _packed_signed(values: Array, signed: str, unsigned: str) -> str:
    """Return signed whole numbers with a row for each frame."""
    integers = np.ascontiguousarray(values.reshape(len(values), -1)).astype(signed)
    return packed(integers.view(unsigned))


def _influences(weights: Array) -> tuple[Integers, Integers, Array]:
    """Return where the joints of each vertex start, shape (V + 1,), the joints, and the weights."""
    vertices, joints = np.nonzero(weights)
    starts = np.searchsorted(vertices, np.arange(len(weights) + 1))
    return starts, joints, weights[vertices, joints]


def extent_of(motion: ModelMotion, translations: Array) -> Extent:
    """Return the extent of a motion with these translations, shape (n_times, 3)."""
    model = motion.model
    surface = np.asarray(model(motion.betas), dtype=np.float64)
    poses = motion.pose_vectors
    heights = surface[:, 1] - surface[:, 1].min()
    is_measured = heights < _SOLES * heights.max()
    is_measured[:: max(1, model.n_vertices // _N_IN_EXTENT)] = True
    some = np.flatnonzero(is_measured)
    joints = np.asarray(model.joints(motion.betas))
    low = np.full(3, np.inf)
    high = np.full(3, -np.inf)
    seen_from_above = []
    lowest = []
    for part in slices(len(poses), _FRAMES_AT_A_TIME):
        matrices = Rotation.from_rotvec(poses[part].reshape(-1, 3)).as_matrix()
        rotations = matrices.reshape(*poses[part].shape, 3)
        moved = joint_motions(joints, rotations, model.parents)
        frames = skin_surface(surface[some], model.weights[some], joints, *moved)
        frames = frames + translations[part, None]
        low = np.minimum(low, frames.min(axis=(0, 1)))
        high = np.maximum(high, frames.max(axis=(0, 1)))
        lowest.append(frames[..., 1].min(axis=1))
        every_other = frames[:, ::2]
        seen_from_above.append(every_other[..., [0, 2]])
    middle = (low + high)[[0, 2]] / 2
    radius = max(
        float(np.linalg.norm(places - middle, axis=-1).max()) for places in seen_from_above
    )
    return Extent(low, high, radius, ground_height(np.concatenate(lowest)))


def _correctives(model: BodyModel, poses: Array) -> dict[str, object]:
    """Return the directions of pose correctives that this motion needs, and their weights.

    The displacements of all frames are a product of rank 9 (J - 1); few of its singular values
    matter within one motion.
    """
    limbs = np.flatnonzero(model.parents >= 0)
    matrices = Rotation.from_rotvec(poses[:, limbs].reshape(-1, 3)).as_matrix()
    features = (matrices - np.eye(3)).reshape(len(poses), -1)
    displacements = np.asarray(model.posedirs).reshape(3 * model.n_vertices, -1).T
    frames, mixed = np.linalg.qr(features)
    rows = mixed @ displacements
    squares, axes = np.linalg.eigh(rows @ rows.T)
    squares = np.maximum(squares, 0.0)
    # The squared error if all but the first 0, 1, ... directions are left out, the largest first.
    left_out = np.append(np.cumsum(squares)[::-1], 0.0)
    axes = axes[:, ::-1]
    allowed = _CORRECTIVE_ERROR**2 * len(poses) * model.n_vertices
    rank = int(np.argmax(left_out <= allowed))
    directions = axes[:, :rank].T @ rows
    step = max(float(np.abs(directions).max(initial=0.0)), 1e-9) / _UNIT
    integers = np.round(directions / step).astype("<i2").reshape(-1, 3)
    return {
        "step": step,
        "rank": rank,
        "directions": packed(integers.view("<u2")) if rank else "",
        "amounts": deflated((frames @ axes[:, :rank]).astype("<f4")),
    }
