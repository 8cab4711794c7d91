"""Data sets of registered bodies: the open bodies and motions, and readers of other data sets."""

from riemhuman.bodies.open_model import load_open_model
from riemhuman.datasets.anny_bodies import (
    AnnyParameters,
    anny_bodies,
    anny_parameters,
    bodies_from_anny,
)
from riemhuman.datasets.bodies import Bodies
from riemhuman.datasets.dfaust import load_dfaust
from riemhuman.datasets.mesh_motions import load_mesh_motions
from riemhuman.datasets.open_bodies import load_open_bodies
from riemhuman.datasets.open_motions import load_open_motions
from riemhuman.datasets.open_poses import joint_rotations, pose_vectors
from riemhuman.datasets.registered_meshes import (
    RegisteredMeshes,
    find_meshes,
    load_bodies,
    load_faust,
    read_labels,
)
from riemhuman.datasets.shrec import LabelledMeshes, load_shrec14
from riemhuman.datasets.shrec19 import MatchedMesh, MatchedMeshes, load_shrec19
from riemhuman.mocap.amass import load_amass
from riemhuman.mocap.amc import load_amc
from riemhuman.mocap.bvh import load_bvh
from riemhuman.mocap.joint_positions import skeleton_from_positions
from riemhuman.mocap.markers import load_c3d, load_trc
from riemhuman.mocap.motion_arrays import motion_from_arrays
from riemhuman.mocap.motions import ArrayMotion, Motion, Motions
from riemhuman.mocap.performances import RetargetingErrors
from riemhuman.mocap.photographed_bodies import PhotographedBodies, load_photographed_bodies
from riemhuman.mocap.recordings import (
    RecordingContents,
    load_recording,
    recording_contents,
)
from riemhuman.mocap.retargeting import RetargetedMotion, retarget
from riemhuman.mocap.skeleton_motion import SkeletonMotion

__all__ = [
    "AnnyParameters",
    "ArrayMotion",
    "Bodies",
    "LabelledMeshes",
    "MatchedMesh",
    "MatchedMeshes",
    "Motion",
    "Motions",
    "PhotographedBodies",
    "RecordingContents",
    "RegisteredMeshes",
    "RetargetedMotion",
    "RetargetingErrors",
    "SkeletonMotion",
    "anny_bodies",
    "anny_parameters",
    "bodies_from_anny",
    "find_meshes",
    "joint_rotations",
    "load_amass",
    "load_amc",
    "load_bodies",
    "load_bvh",
    "load_c3d",
    "load_dfaust",
    "load_faust",
    "load_mesh_motions",
    "load_open_bodies",
    "load_open_model",
    "load_open_motions",
    "load_photographed_bodies",
    "load_recording",
    "load_shrec14",
    "load_shrec19",
    "load_trc",
    "motion_from_arrays",
    "pose_vectors",
    "read_labels",
    "recording_contents",
    "retarget",
    "skeleton_from_positions",
]


def __dir__() -> list[str]:
    return sorted(__all__)
