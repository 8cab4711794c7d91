"""Body models: surfaces as functions of shape coefficients and joint rotations."""

from riemhuman.bodies.body_model import BodyModel
from riemhuman.bodies.conversion import convert_model
from riemhuman.bodies.fitting import fit_model
from riemhuman.bodies.model_conversion import ConvertedFit, convert
from riemhuman.bodies.model_families import ModelContents
from riemhuman.bodies.model_files import model_contents
from riemhuman.bodies.model_fit import ModelFit
from riemhuman.bodies.skinned_model import SkinnedModel
from riemhuman.kernels.rotations import rotation_derivative, rotation_matrix

__all__ = [
    "BodyModel",
    "ConvertedFit",
    "ModelContents",
    "ModelFit",
    "SkinnedModel",
    "convert",
    "convert_model",
    "fit_model",
    "model_contents",
    "rotation_derivative",
    "rotation_matrix",
]


def __dir__() -> list[str]:
    return sorted(__all__)
