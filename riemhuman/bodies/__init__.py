"""Body models: surfaces as functions of shape coefficients and joint rotations."""

from riemhuman.bodies.body_model import BodyModel, convert_model
from riemhuman.bodies.fitting import ModelFit, correspondence_matrix
from riemhuman.bodies.model_files import ModelContents, model_contents
from riemhuman.bodies.skinning import joint_motions, joints_between, skin_surface
from riemhuman.kernels.rotations import rotation_matrix

__all__ = [
    "BodyModel",
    "ModelContents",
    "ModelFit",
    "convert_model",
    "correspondence_matrix",
    "joint_motions",
    "joints_between",
    "model_contents",
    "rotation_matrix",
    "skin_surface",
]


def __dir__() -> list[str]:
    return sorted(__all__)
