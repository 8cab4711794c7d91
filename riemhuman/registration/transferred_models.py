"""Body models on other meshes, by transferring skinning weights and joint regressors."""

from __future__ import annotations

from typing import Any

import numpy as np

from riemhuman.bodies import BodyModel
from riemhuman.bodies.correspondence import combination_of_vertices
from riemhuman.bodies.joint_tree import root_first
from riemhuman.bodies.skinning import chained_motions
from riemhuman.errors import ArgumentError
from riemhuman.kernels.rotations import rotation_matrix
from riemhuman.registration.scan_registration import ScanRegistration
from riemhuman.surfaces.nearest_places import nearest_places
from riemhuman.surfaces.template import Template


def transfer_model(model: BodyModel, body: Template) -> BodyModel:
    r"""Transfer a body model to another mesh, from one body that has this mesh.

    The model is registered to the body. Each vertex of the body takes the skinning weights, shape
    directions and pose directions of its nearest point on the registered surface. Each joint is the
    combination of the points of the body nearest to the vertices that it combines in the model. The
    mean body in the rest pose is the body itself, with the fitted pose and the fitted shape undone:

    .. math:: v_i = \Big(\sum_j w_{ij} R_j\Big)^{-1} \Big(f_i - \sum_j w_{ij} t_j\Big)
              - \text{shapedirs}_i\, \beta - \text{posedirs}_i\,(R - I)

    with the rigid motions :math:`x \mapsto R_j x + t_j` of the joints (Loper et al. 2015,
    equation 2). What the model cannot fit of the body stays in the mean body.

    Parameters
    ----------
    model : BodyModel
        The model, metres.
    body : Template
        A body with the other mesh, metres, in any pose without contacts.

    Returns
    -------
    model : BodyModel
        A model of the same joints and shape coefficients with the mesh of the body.

    Raises
    ------
    ArgumentTypeError
        If `model` is not a body model.
    ArgumentError
        If the registration of the model to the body is not trusted.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> body = rh.Template(bodies[0], bodies.template.faces)
    >>> model = rh.registration.transfer_model(bodies.model, body)  # doctest: +SKIP
    >>> model  # doctest: +SKIP
    <BodyModel: 23 joints, 16 shape coefficients, 1,202 vertices>
    """
    vertices, faces = body.vertices, body.faces
    registered = ScanRegistration(model, unit="metres").solve((vertices, faces))
    fit = registered.fit
    if fit is None or not registered.trusted:
        raise ArgumentError(
            "body must be a body to which the model can be registered; found that "
            f"{registered.message}"
        )
    forth = combination_of_vertices(model, registered.correspondence)
    back = combination_of_vertices(body, nearest_places(registered.points, vertices, faces)[0])
    weights = forth @ model.weights
    shapedirs = _combined(forth, model.shapedirs)
    posedirs = None if model.posedirs is None else _combined(forth, model.posedirs)

    rotations = rotation_matrix(fit.pose)
    joints = model.joints(fit.betas)
    turns, places = chained_motions(joints, rotations, model.parents, root_first(model.parents))
    shifts = places - np.einsum("jxy,jy->jx", turns, joints)
    blended = np.einsum("vj,jxy->vxy", weights, turns)
    moved = vertices - fit.trans - weights @ shifts
    rest = np.linalg.solve(blended, moved[..., None])[..., 0] - shapedirs @ fit.betas
    if posedirs is not None:
        limbs = model.parents >= 0
        rest = rest - posedirs @ (rotations[limbs] - np.eye(3)).ravel()
    return BodyModel(
        rest,
        faces,
        shapedirs,
        model.joint_regressor @ back,
        weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        posedirs=posedirs,
        joint_names=model.joint_names,
        dtype=model.dtype,
    )


def _combined(combination: Any, directions: np.ndarray) -> np.ndarray:
    """Return directions of points from those of vertices, shape (V, 3, B)."""
    flat = combination @ directions.reshape(len(directions), -1)
    return np.asarray(flat).reshape(-1, *directions.shape[1:])
