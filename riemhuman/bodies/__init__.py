"""Body models: surfaces driven by shape coefficients and joint rotations."""

from riemhuman.bodies.body_model import BodyModel
from riemhuman.bodies.conversion import convert_model
from riemhuman.bodies.fitting import ModelFit, fit_model
from riemhuman.kernels.rotations import rotation_derivative, rotation_matrix

__all__ = [
    "BodyModel",
    "ModelFit",
    "convert_model",
    "fit_model",
    "rotation_derivative",
    "rotation_matrix",
]


def __dir__() -> list[str]:
    return sorted(__all__)
