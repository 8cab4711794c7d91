"""Bodies in the standard pose: a fit of the body model removes the pose, and detail is kept."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.bodies import BodyModel, ModelFit
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.solvers import ShapeTransfer


def in_standard_pose(description: MeasurementSet, points: ndarray) -> ndarray:
    """Return bodies in the standard pose, along the axes of the body model.

    The body model is fitted to each body. `riemhuman.solvers.ShapeTransfer` then transfers the
    difference between the body and its fit to the fitted person in the standard pose: triangles
    stretch by the same amounts, along axes that turn with them.

    Parameters
    ----------
    description : MeasurementSet
        Measurements of a body model, with the standard pose.
    points : array, shape (..., V, 3)
        Bodies, metres.

    Returns
    -------
    array, shape (..., V, 3)

    Raises
    ------
    ArgumentError
        If the template is not a body model.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> own = rh.measurements.Measurements(bodies.model)
    >>> straight = rh.measurements.in_standard_pose(own.definitions, bodies[3])
    >>> straight.shape
    (1202, 3)
    """
    model = description.model
    if model is None:
        raise ArgumentError(
            'pose="standard" needs a body model, whose fit removes the pose; found a surface'
        )
    fit = model.fit(points, weights=model.template.vertex_areas)
    return transferred(model, fit, points, standard_pose_vector(description))


def transferred(model: BodyModel, fit: ModelFit, points: ndarray, pose: ndarray) -> ndarray:
    """Return bodies in another pose, with the residuals of the fit.

    Parameters
    ----------
    model : BodyModel
        The body model.
    fit : ModelFit
        Its fit to the bodies.
    points : array, shape (..., V, 3)
        The bodies, metres.
    pose : array, shape (J, 3)
        The new pose: axis-angle vectors, radians.

    Returns
    -------
    array, shape (..., V, 3)
    """
    space = AlignedSurfaces(model.template, equip=False, scale=None)
    transfer = ShapeTransfer()
    moved = np.empty_like(points)
    for index in np.ndindex(points.shape[:-2]):
        before = model(fit.betas[index], fit.pose[index], fit.trans[index])
        target = model(fit.betas[index], pose)
        moved[index] = transfer.solve(space, before, points[index], target)
    return moved


def standard_pose_vector(description: MeasurementSet) -> ndarray:
    """Return the standard pose of a body model.

    Parameters
    ----------
    description : MeasurementSet
        Measurements of a body model.

    Returns
    -------
    array, shape (J, 3)
        Axis-angle vectors, radians.
    """
    model = description.model
    assert model is not None, "callers have checked this"
    pose = np.zeros((model.n_joints, 3))
    for name, vector in description.standard_pose.items():
        pose[model.joint_names.index(name)] = vector
    return pose
