"""Files of motions of a body model: BVH, AMASS's layout, and skeletons with a skin in GLB."""

from __future__ import annotations

import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Integers
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import SMPL_JOINTS, SMPL_PARENTS, usual_joint_names
from riemhuman.errors import ArgumentError
from riemhuman.io.arrays import save_arrays
from riemhuman.io.files import write_bytes, write_text
from riemhuman.io.skinned_gltf import SkinnedAnimation, skinned_glb
from riemhuman.kernels.rotations import shortest_rotations, transpose
from riemhuman.kernels.surface import unit_vectors
from riemhuman.mocap._joint_names import BONES, OTHER_BONES
from riemhuman.mocap._smpl_layout import N_HANDS, is_smpl, smpl_offsets
from riemhuman.surfaces.procrustes import make_upright

# Most programs read the numbers of a BVH file as centimetres.
_CENTIMETRES = 100.0
_EULER = "ZXY"
# Number of a person's shape coefficients in AMASS files.
_N_BETAS = 16
SAVED_FIELDS = (
    *("riemhuman_joints", "riemhuman_betas", "riemhuman_rest_joints"),
    *("riemhuman_poses", "riemhuman_frames"),
)
"""What AMASS's fields cannot say of a person of another model than SMPL's.

Names of the model's joints, shape coefficients, joints in the rest pose (the person may be larger
than the model's), and poses of the model, beside digests of the frames whose poses they are: other
programs cut and reorder the frames of AMASS's fields alone.
"""
# The bone that says how SMPL's rest pose differs from another at a joint: to the joint named here.
_NEXT_JOINTS = dict((*BONES, *OTHER_BONES))
# Joints without a child differ as the bone above them does.
_LAST_JOINTS = ("left_toes", "right_toes", "left_wrist", "right_wrist")


@dataclass(frozen=True)
class PosedPerson:
    """The content of a motion file: a person of a model in the poses of all frames."""

    model: BodyModel
    betas: Array
    poses: Array  # (n_frames, J, 3)
    translations: Array
    frames_per_second: float
    name: str

    @property
    def joints(self) -> Array:
        """Joints of the person in the rest pose, shape (J, 3)."""
        return np.asarray(self.model.joints(self.betas))

    @property
    def rotations(self) -> Array:
        """Rotations of the joints relative to their parents, shape (n_frames, J, 3, 3)."""
        matrices = Rotation.from_rotvec(self.poses.reshape(-1, 3)).as_matrix()
        return np.asarray(matrices.reshape(*self.poses.shape, 3))


def write_bvh(file: Path, person: PosedPerson) -> None:
    """Write the skeleton of a person and its rotations, in centimetres, y up."""
    joints = _CENTIMETRES * person.joints
    text = io.StringIO()
    text.write("HIERARCHY\n")
    order: list[int] = []
    for root in np.flatnonzero(person.model.parents < 0).tolist():
        order += _write_hierarchy(text, person.model, joints, root, 0)
    n_frames = len(person.poses)
    with warnings.catch_warnings():
        # Two of the three angles may be interchangeable; the rotation is right all the same.
        warnings.filterwarnings("ignore", message="Gimbal lock")
        turned = Rotation.from_rotvec(person.poses[:, order].reshape(-1, 3))
        angles = turned.as_euler(_EULER, degrees=True).reshape(n_frames, -1)
    places = joints[order[0]] + _CENTIMETRES * person.translations
    text.write(f"MOTION\nFrames: {n_frames}\nFrame Time: {1.0 / person.frames_per_second:.9g}\n")
    for row in np.concatenate([places, angles], axis=1):
        text.write(_numbers(row) + "\n")
    write_text(file, text.getvalue())


def _write_hierarchy(
    text: io.StringIO, model: BodyModel, joints: Array, joint: int, depth: int
) -> list[int]:
    """Write a joint and all below it, and return their numbers in this order."""
    indent = "\t" * depth
    parent = model.parents[joint]
    rotations = " ".join(f"{axis}rotation" for axis in _EULER)
    if parent < 0:
        keyword, start = "ROOT", np.zeros(3)
        channels = f"6 Xposition Yposition Zposition {rotations}"
    else:
        keyword, start = "JOINT", joints[joint] - joints[parent]
        channels = f"3 {rotations}"
    text.write(f"{indent}{keyword} {model.joint_names[joint]}\n{indent}{{\n")
    text.write(f"{indent}\tOFFSET {_numbers(start)}\n")
    text.write(f"{indent}\tCHANNELS {channels}\n")
    order = [joint]
    children = np.flatnonzero(model.parents == joint).tolist()
    for child in children:
        order += _write_hierarchy(text, model, joints, child, depth + 1)
    if not children:
        end = _CENTIMETRES * _tip(model, joint)
        text.write(f"{indent}\tEnd Site\n{indent}\t{{\n")
        text.write(f"{indent}\t\tOFFSET {_numbers(end)}\n{indent}\t}}\n")
    text.write(f"{indent}}}\n")
    return order


def _numbers(values: Array) -> str:
    # A hundred-thousandth of a degree moves a hand by less than a thousandth of a millimetre.
    return " ".join(f"{value:.5f}" for value in values.tolist())


def _tip(model: BodyModel, joint: int) -> Array:
    """Return the farthest vertex that moves with a joint, relative to it, in the mean body."""
    of_joint = model.weights.argmax(axis=1) == joint
    if not of_joint.any():
        return np.zeros(3)
    vertices = model.template.vertices
    steps = vertices[of_joint] - (model.joint_regressor @ vertices)[joint]
    return np.asarray(steps[np.linalg.norm(steps, axis=1).argmax()])


def write_amass(file: Path, person: PosedPerson) -> None:
    """Write a motion in AMASS's layout, z up.

    Models without SMPL's joints have poses of SMPL-H, in which every bone points the same way, and
    `SAVED_FIELDS` for what these omit.
    """
    smpl = is_smpl(person.model)
    if smpl:
        poses, betas = person.poses, person.betas
        places, root = person.translations, person.joints[0]
    else:
        poses, places = _smpl_poses(person), person.translations + person.joints[0]
        betas, root = np.zeros(_N_BETAS), np.zeros(3)
    upright = Rotation.from_matrix(make_upright(np.eye(3), up="z"))
    turned = poses.copy()
    turned[:, 0] = (upright * Rotation.from_rotvec(poses[:, 0])).as_rotvec()
    fields = {
        "poses": turned.reshape(len(turned), -1),
        "trans": upright.apply(places + root) - root,
        "betas": betas,
        "gender": np.array("neutral"),
        "mocap_framerate": np.array(person.frames_per_second),
    }
    if not smpl:
        names, digests = np.array(person.model.joint_names), frame_digests(fields["poses"])
        values = (names, person.betas, person.joints, person.poses, digests)
        fields |= dict(zip(SAVED_FIELDS, values, strict=True))
    save_arrays(file, fields)


def frame_digests(poses: Array) -> Integers:
    """Return a number for each frame of poses (n_frames, N), which other poses do not have."""
    rows = np.ascontiguousarray(poses, dtype="<f4")  # in which other programs may store them
    digests = [blake2b(row.tobytes(), digest_size=8).digest() for row in rows]
    return np.frombuffer(b"".join(digests), dtype="<u8")


def _smpl_starts(names: Sequence[str], joints: Array) -> Array:
    """Return rotations, one a joint of SMPL, from its rest pose to one with these joints."""
    offsets = smpl_offsets()
    starts: list[Array] = []
    for name, parent in zip(SMPL_JOINTS, SMPL_PARENTS, strict=True):
        start = np.eye(3)
        if name in _NEXT_JOINTS:
            following = _NEXT_JOINTS[name]
            bone = joints[names.index(following)] - joints[names.index(name)]
            smpl_bone = offsets[SMPL_JOINTS.index(following)]
            start = shortest_rotations(unit_vectors(smpl_bone), unit_vectors(bone))
        elif name in _LAST_JOINTS:
            start = starts[parent]
        starts.append(start)
    return np.stack(starts)


def _smpl_poses(person: PosedPerson) -> Array:
    """Return poses of SMPL-H's joints in which all bones have the directions of the model's."""
    names = list(usual_joint_names(person.model))
    missing = [name for name in SMPL_JOINTS if name not in names]
    if missing:
        raise ArgumentError(
            f"a model needs the joints of SMPL for AMASS's layout; {missing[0]} is missing"
        )
    in_space = person.rotations
    for joint in person.model.joint_order:
        parent = person.model.parents[joint]
        if parent >= 0:
            in_space[:, joint] = in_space[:, parent] @ in_space[:, joint]
    joints = [names.index(name) for name in SMPL_JOINTS]
    placed = in_space[:, joints] @ _smpl_starts(names, person.joints)
    local = placed.copy()
    for joint, parent in enumerate(SMPL_PARENTS):
        if parent >= 0:
            local[:, joint] = transpose(placed[:, parent]) @ placed[:, joint]
    vectors = Rotation.from_matrix(local.reshape(-1, 3, 3)).as_rotvec()
    hands = np.zeros((len(local), N_HANDS, 3))
    return np.concatenate([vectors.reshape(len(local), -1, 3), hands], axis=1)


def write_skinned_glb(file: Path, person: PosedPerson) -> None:
    """Write the body, its skeleton and the motion; pose correctives of a model are left out."""
    quaternions = Rotation.from_rotvec(person.poses.reshape(-1, 3)).as_quat()
    animation = SkinnedAnimation(
        vertices=np.asarray(person.model(person.betas)),
        faces=person.model.faces,
        joints=person.joints,
        parents=person.model.parents,
        joint_names=person.model.joint_names,
        weights=person.model.weights,
        rotations=quaternions.reshape(*person.poses.shape[:2], 4),
        root_places=person.joints[0] + person.translations,
        frames_per_second=person.frames_per_second,
        name=person.name or "motion",
    )
    write_bytes(file, skinned_glb(animation))
