"""Body models: surfaces driven by shape coefficients and joint rotations."""

from riemhuman.bodies.body_model import BodyModel
from riemhuman.bodies.rotations import rotation_matrix

__all__ = ["BodyModel", "rotation_matrix"]
