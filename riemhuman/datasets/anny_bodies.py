"""Bodies of Anny, whose skin has the mesh of the open model, and their parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, ArrayLike
from riemhuman.bodies.open_model import load_open_model
from riemhuman.checks import check_human_size, real_array, values_of
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.kernels.rotations import nearest_rotations
from riemhuman.optional import import_optional
from riemhuman.surfaces.procrustes import make_upright

if TYPE_CHECKING:
    import anny

_EXTRA = "anny"
# Anny's default topology: its skin, then the inside of the mouth and the eyes.
_N_VERTICES, _N_SKIN = 13_718, 13_348
# Vertices of the face that carry mouth and eyes.
_N_ANCHORS = 400


@dataclass(frozen=True, eq=False)
class AnnyParameters:
    """Parameters of Anny that were fitted to bodies.

    Attributes
    ----------
    phenotypes : dict of str to array, shape (n,)
        Values from 0 to 1, see Anny's documentation.
    pose : array, shape (n, 104, 4, 4)
        Rigid motions of the bones, in Anny's default parameterisation, "local-ref".
    distances : array, shape (n, 13348)
        Distances of the vertices from the body with these parameters, metres.

    Examples
    --------
    >>> body = rh.datasets.load_open_bodies("full")[0]
    >>> rh.datasets.anny_parameters(body).phenotypes["height"]  # doctest: +SKIP
    """

    phenotypes: dict[str, Array]
    pose: Array
    distances: Array


def bodies_from_anny(vertices: ArrayLike) -> Array:
    """Convert the vertices that Anny computes to bodies of the open model at full resolution.

    The skin of Anny's default topology has the triangles of the open model, vertex by vertex, so
    the correspondence is exact. Eyes and the inside of the mouth are left out, and z up becomes y
    up. This does not need the package.

    Parameters
    ----------
    vertices : array_like or tensor, shape (..., 13718, 3)
        ``anny.Anny()(…)["vertices"]``, metres, z up.

    Returns
    -------
    array, shape (..., 13348, 3)

    Examples
    --------
    >>> rh.datasets.bodies_from_anny(model()["vertices"]).shape  # doctest: +SKIP
    (1, 13348, 3)
    """
    points = np.asarray(real_array(values_of(vertices, "vertices"), "vertices", ("V", 3)))
    if points.shape[-2] != _N_VERTICES:
        raise ArgumentError(
            f"vertices must be the {_N_VERTICES:,} of Anny's default topology, "
            f'Anny(topology="anny"); found {points.shape[-2]:,}'
        )
    return make_upright(points[..., :_N_SKIN, :], up="z")


def anny_bodies(
    phenotypes: Mapping[str, ArrayLike],
    pose: ArrayLike | None = None,
) -> Array:
    """Return bodies of the open model at full resolution from Anny's parameters.

    This needs the package ``anny`` (extra ``anny``), which needs PyTorch and takes about a minute
    at first use.

    Parameters
    ----------
    phenotypes : mapping of str to array_like, shape (n,)
        Values from 0 to 1 of "gender", "age", "muscle", "weight", "height" and "proportions"; 0.5
        for those that are missing.
    pose : array_like, shape (n, 104, 4, 4), optional
        Rigid motions of the bones of Anny's default rig, in the parameterisation that Anny names
        "local-ref"; by default the rest pose.

    Returns
    -------
    array, shape (n, 13348, 3)
        Metres, y up.

    Examples
    --------
    >>> rh.datasets.anny_bodies({"height": [0.3, 0.8]}).shape  # doctest: +SKIP
    (2, 13348, 3)
    """
    model = _load_anny()
    unknown = [name for name in phenotypes if name not in model.phenotype_labels]
    if unknown:
        raise ArgumentError(
            f"phenotypes must be among {', '.join(model.phenotype_labels)}; found {unknown[0]!r}"
        )
    values = {
        name: np.atleast_1d(real_array(phenotypes.get(name, 0.5), name))
        for name in model.phenotype_labels
    }
    values = dict(zip(values, np.broadcast_arrays(*values.values()), strict=True))
    n_bodies = len(values["height"])
    shape = (n_bodies, model.bone_count, 4, 4)
    poses = np.broadcast_to(np.eye(4), shape) if pose is None else pose
    poses = real_array(values_of(poses, "pose"), "pose", shape, batched=False)
    torch = import_optional("torch", _EXTRA)
    with torch.no_grad():
        output = model(
            pose_parameters=torch.tensor(poses, dtype=model.dtype),
            phenotype_kwargs={
                name: torch.tensor(value, dtype=model.dtype) for name, value in values.items()
            },
            pose_parameterization="local-ref",
        )
    return bodies_from_anny(output["vertices"].numpy())


def anny_parameters(points: ArrayLike) -> AnnyParameters:
    """Return the parameters of Anny that fit bodies of the open model, by Anny's inverter.

    Like `anny_bodies`, this needs the package ``anny`` (extra ``anny``). It takes seconds per body.

    Parameters
    ----------
    points : array_like, shape (n, 13348, 3) or (13348, 3)
        Bodies of the open model at full resolution, metres, y up.

    Examples
    --------
    >>> found = rh.datasets.anny_parameters(body)  # doctest: +SKIP
    >>> rh.datasets.anny_bodies(found.phenotypes, found.pose).shape  # doctest: +SKIP
    (1, 13348, 3)
    """
    bodies = np.asarray(real_array(points, "points", (_N_SKIN, 3)), dtype=np.float64)
    bodies = bodies.reshape(-1, _N_SKIN, 3)
    for body in bodies:
        check_human_size(float(np.ptp(body, axis=0).max()), np.nan, "points")
    model = _load_anny()
    torch = import_optional("torch", _EXTRA)
    inverter = import_optional("anny.anny_inverter", _EXTRA).AnnyInverter(model.float())
    whole = _with_inner_parts(
        make_upright(bodies, up="-z"), model.template_vertices.numpy().astype(np.float64)
    )
    with torch.no_grad():
        pose, phenotypes, fitted = inverter(torch.tensor(whole, dtype=torch.float32))
    gaps = fitted.numpy()[:, :_N_SKIN] - whole[:, :_N_SKIN]
    return AnnyParameters(
        {name: np.atleast_1d(value.numpy().astype(float)) for name, value in phenotypes.items()},
        pose.numpy().astype(np.float64),
        np.linalg.norm(gaps, axis=-1),
    )


def _load_anny() -> anny.Anny:
    """Return Anny with its default rig and topology, whose skin must be that of the open model."""
    model = import_optional("anny", _EXTRA).Anny(rig="anny", topology="anny")
    faces = model.faces.numpy()
    skin = faces[(faces < _N_SKIN).all(axis=1)]
    if len(model.template_vertices) != _N_VERTICES or not np.array_equal(
        skin, load_open_model("full").faces
    ):
        raise FileFormatError(
            "the skin in this version of anny and the open model have different triangles; in "
            "version 0.6.2 they are the same"
        )
    return model


def _with_inner_parts(skins: Array, template: Array) -> Array:
    """Return whole bodies of Anny: mouth and eyes follow the face by a similarity."""
    inner = template[_N_SKIN:]
    anchors = cKDTree(template[:_N_SKIN]).query(inner.mean(axis=0), k=_N_ANCHORS)[1]
    centre = template[anchors].mean(axis=0)
    before = template[anchors] - centre
    whole = []
    for skin in skins:
        middle = skin[anchors].mean(axis=0)
        after = skin[anchors] - middle
        rotation = nearest_rotations(after.T @ before)
        scale = np.linalg.norm(after) / np.linalg.norm(before)
        whole.append(np.concatenate([skin, scale * (inner - centre) @ rotation.T + middle]))
    return np.stack(whole)
