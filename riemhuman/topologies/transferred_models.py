"""Body models on other meshes, from one body that has the mesh."""

from __future__ import annotations

import numpy as np
from scipy import sparse

from riemhuman.arrays import Array
from riemhuman.bodies import BodyModel, correspondence_matrix
from riemhuman.bodies.skinning import JointMotions, Skeleton
from riemhuman.checks import checked, instance
from riemhuman.errors import ArgumentError
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.registration import ScanRegistration
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template


@checked(model=instance(BodyModel), body=instance(Template))
def transfer_model(model: BodyModel, body: Template) -> BodyModel:
    r"""Transfer a body model to another mesh, from one body that has this mesh.

    The model is registered to the body. Each vertex of the body takes the skinning weights, shape
    directions and pose directions of its nearest point on the registered surface. Each joint is the
    combination of the points of the body nearest to the vertices that it combines in the model. The
    mean body in the rest pose is the body itself, with the fitted pose and the fitted shape undone:

    .. math:: \begin{split}
              v_i = & \Big(\sum_j w_{ij} R_j\Big)^{-1} \Big(f_i - \sum_j w_{ij} t_j\Big) \\
              & - \text{shapedirs}_i\, \beta - \text{posedirs}_i\,(R - I) \end{split}

    with the rigid motions :math:`x \mapsto R_j x + t_j` of the joints (Loper et al. 2015, equation
    2). The residual that the model cannot fit stays in the mean body.

    The result generates and poses new bodies with the other mesh. To convert existing bodies, use
    `TopologyMap`, which takes milliseconds per body and does not depend on what a model can
    represent.

    Parameters
    ----------
    model : BodyModel
    body : Template
        A body with the other mesh, metres, in any pose without contacts.

    Raises
    ------
    ArgumentError
        If the registration of the model to the body is not trusted.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> body = rh.Template(bodies[0], bodies.template.faces)
    >>> model = rh.topologies.transfer_model(bodies.model, body)  # doctest: +SKIP
    """
    vertices, faces = body.vertices, body.faces
    registered = ScanRegistration(model, unit="metres").solve((vertices, faces))
    fit = registered.fit
    if fit is None or not registered.trusted:
        raise ArgumentError(
            "body must be a body to which the model can be registered; found that "
            f"{registered.message}"
        )
    forth = correspondence_matrix(model, registered.correspondence)
    back = correspondence_matrix(body, nearest_points(registered.points, vertices, faces)[0])
    weights = forth @ model.weights
    shapedirs = _combined(forth, model.shapedirs)
    hand_directions = _combined(forth, model.hand_directions)
    posedirs = None if model.posedirs is None else _combined(forth, model.posedirs)

    local = rotation_matrix(fit.pose)
    motions = JointMotions(Skeleton(model, with_hands=False), local, fit.betas)
    blended = np.einsum("vj,jxy->vxy", weights, motions.rotations)
    moved = vertices - fit.trans - weights @ motions.shifts
    rest = np.linalg.solve(blended, moved[..., None])[..., 0]
    rest = rest - shapedirs @ fit.betas
    if fit.hands is not None:
        rest = rest - hand_directions @ fit.hands
    if posedirs is not None:
        rest = rest - posedirs @ motions.pose_feature
    return BodyModel(
        rest,
        faces,
        shapedirs,
        model.joint_regressor @ back,
        weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        posedirs=posedirs,
        joint_names=model.joint_names,
        hand_directions=hand_directions,
        hand_poses=model.hand_poses,
    )


def _combined(combination: sparse.sparray, directions: Array) -> Array:
    """Return directions of points from those of vertices, shape (V, 3, B)."""
    flat = combination @ directions.reshape(len(directions), -1)
    return np.asarray(flat).reshape(len(flat), *directions.shape[1:])
