"""The twelve joints of the limbs as a metric on bodies, for comparisons of motions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Unpack

import autograd.numpy as np
import numpy as onp

from riemhuman.arrays import Array, Points
from riemhuman.bodies.body_model import BodyModel
from riemhuman.bodies.skinning import LIMBS, usual_joint_names
from riemhuman.checks import checked, instance
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, PullbackMetric, VectorSpace

if TYPE_CHECKING:
    from riemhuman.geometry.strategies import Solvers

_JOINTS = tuple(joint for limb in LIMBS for joint in limb)
# Sides of the body across which it faces forward.
_ACROSS = (("right_hip", "left_hip"), ("right_shoulder", "left_shoulder"))
# A body that lies on its side faces nowhere: square metres.
_LEVEL = 1e-12


class JointMetric(PullbackMetric):
    r"""Distances of the joints of the limbs, relative to the hips and to where the body faces.

    With :math:`J f` the twelve joints of the limbs that `model` regresses from the vertices of a
    surface, m the middle of the hips and R the rotation about the vertical axis that turns the
    lines of hips and shoulders to the left,

    .. math:: d(f, h) = \| R_f (J f - m_f) - R_h (J h - m_h) \|

    For which movement it is, this says as much as the metrics on surfaces, and for who moves or how
    it says less: `MotionDescriptor` and `DynamicTimeWarping` take it as they take those. It sees
    neither the surface nor rotations of limbs about themselves, nor heads and feet.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces of the model's template.
    model : BodyModel
        Model with named joints, or with those of SMPL.
    **solvers : strategies, see `RiemannianMetric`

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> metric = rh.motions.JointMetric(rh.AlignedSurfaces(model.template), model)
    >>> body = model()
    >>> float(metric.dist(body, body + [1.0, 0.0, 0.0])) < 1e-12
    True
    """

    @checked(space=instance(AlignedSurfaces), model=instance(BodyModel))
    def __init__(
        self, space: AlignedSurfaces, model: BodyModel, **solvers: Unpack[Solvers]
    ) -> None:
        names = list(usual_joint_names(model))
        missing = [joint for joint in _JOINTS if joint not in names]
        if missing or model.n_vertices != space.template.n_vertices:
            problem = f"{missing[0]} is missing" if missing else "its vertices are others"
            raise ArgumentError(
                f"model must have the joints of limbs and the vertices of the space: {problem}"
            )
        regressor = model.joint_regressor[[names.index(joint) for joint in _JOINTS]]
        self._regressor = onp.asarray(regressor)
        target = VectorSpace((len(_JOINTS), 3))
        super().__init__(space, target.metric, self._limbs, **solvers)

    def _limbs(self, points: Array) -> Array:
        joints = np.matmul(self._regressor, points)
        places = {name: joints[..., k, :] for k, name in enumerate(_JOINTS)}
        middle = 0.5 * (places["left_hip"] + places["right_hip"])
        hips, shoulders = (places[left] - places[right] for right, left in _ACROSS)
        across = hips + shoulders
        length = np.sqrt(across[..., 0] ** 2 + across[..., 2] ** 2 + _LEVEL)
        cosine, sine = across[..., 0] / length, -across[..., 2] / length
        moved = joints - middle[..., None, :]
        x, y, z = moved[..., 0], moved[..., 1], moved[..., 2]
        # About the vertical axis, until the line across the body points along x.
        turned = (
            cosine[..., None] * x - sine[..., None] * z,
            y,
            sine[..., None] * x + cosine[..., None] * z,
        )
        return np.stack(turned, axis=-1)

    def lower_bound_coordinates(self, points: Points) -> Array:
        """Return the coordinates of the joints, whose Euclidean distances are those of `dist`."""
        joints = self._limbs(self.space.check_point(points, "points"))
        return onp.asarray(joints.reshape(*joints.shape[:-2], -1))
