"""All representations of a body, by their names in tables."""

from __future__ import annotations

from typing import Any

from riemhuman.descriptors import (
    AreaProjectionTransform,
    HeatKernelSignature,
    ModelPoseVectors,
    ModelShapeVectors,
    ShapeDNA,
    WaveKernelSignature,
)
from riemhuman.extensions import extensions
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.learned.code_descriptor import shipped_descriptors
from riemhuman.retrieval.benchmark import table_metrics


def available(bodies: Any) -> dict[str, Any]:
    """Return all representations that apply to a data set, for `riemhuman.retrieval.benchmark`.

    The open bodies were made by the model they carry: its vectors are found again almost exactly,
    and rank first on these bodies for that reason.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Registered surfaces have all of them, those by model vectors if the data set has a model
        that can fit, and the codes of networks that were trained on the open model; other meshes
        have the descriptors that need no template.

    Returns
    -------
    dict of str to object
        Metrics and descriptors by name, in the order of a table; those of other packages last.
    """
    registered = hasattr(bodies, "points") and hasattr(bodies, "template")
    found: dict[str, Any] = dict(table_metrics(bodies)) if registered else {}
    model = getattr(bodies, "model", None)
    if registered and callable(getattr(model, "fit", None)):
        found["model shape vector"] = ModelShapeVectors(model)
        found["model pose vector"] = ModelPoseVectors(model)
        found["model pose, by rotation"] = ModelPoseVectors(model, "rotation", root=False)
    if registered:
        found |= shipped_descriptors(bodies.template)
    found["APT"] = AreaProjectionTransform()
    found["ShapeDNA"] = ShapeDNA()
    found["HKS"] = HeatKernelSignature()
    found["WKS"] = WaveKernelSignature()
    if registered:
        # The plain mean over vertices, common in retrieval, knows the registration.
        found["WKS, mean over vertices"] = WaveKernelSignature(pooling="vertex mean")
    return found | of_extensions(bodies)


def of_extensions(bodies: Any) -> dict[str, Any]:
    """Return the representations that other packages register, see `riemhuman.extensions`.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Surfaces; metrics are for registered ones alone.

    Returns
    -------
    dict of str to object
        Metrics and descriptors by name.
    """
    descriptors = {name: make() for name, make in extensions("descriptors").items()}
    return metrics_of_extensions(bodies) | descriptors


def metrics_of_extensions(bodies: Any) -> dict[str, Any]:
    """Return the metrics that other packages register, see `riemhuman.extensions`.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Surfaces; for those that are not registered there is no metric.

    Returns
    -------
    dict of str to RiemannianMetric
        By name.
    """
    if not (hasattr(bodies, "points") and hasattr(bodies, "template")):
        return {}
    space = AlignedSurfaces(bodies.template, equip=False)
    return {name: metric(space) for name, metric in extensions("metrics").items()}
