"""All representations of bodies, by their names in tables."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from riemhuman.descriptors import (
    AreaProjectionTransform,
    HeatKernelSignature,
    ModelPoseVectors,
    ModelShapeVectors,
    ShapeDNA,
    WaveKernelSignature,
)
from riemhuman.errors import ArgumentError
from riemhuman.extensions import extensions
from riemhuman.geometry import AlignedSurfaces, GaugeInvariantMetric, SobolevMetric, SRNFMetric
from riemhuman.report.code_descriptors import LEARNED, shipped_descriptors
from riemhuman.report.retrieval_benchmark import PAPER_TABLES, BenchmarkRecord, table_metrics
from riemhuman.solvers.paths import LinearPath

STRAIGHT = ", straight"
"""End of the names of metrics without closed form, compared by the cost of straight paths."""
SOBOLEV = f"Sobolev metric{STRAIGHT}"
GAUGE_INVARIANT = f"gauge-invariant SRNF{STRAIGHT}"


def available(bodies: Any) -> dict[str, Any]:
    """Return all representations that apply to a data set, for `riemhuman.report.benchmark`.

    The model of the open bodies also generated them: its fits recover the vectors almost exactly,
    which is why model vectors rank first on these bodies.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Surfaces. Metrics and learned codes need registered surfaces, and model vectors a data set
        with a model that has the method ``fit``; the other descriptors apply to all meshes.

    Returns
    -------
    dict of str to object
        Metrics and descriptors by name, in the order of tables; those of other packages come last.
    """
    registered = hasattr(bodies, "points") and hasattr(bodies, "template")
    found: dict[str, Any] = dict(table_metrics(bodies)) if registered else {}
    if registered:
        found |= _straight_metrics(AlignedSurfaces(bodies.template, equip=False))
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
        # The mean over vertices is common in retrieval, but it uses the registration.
        found["WKS, mean over vertices"] = WaveKernelSignature(pooling="vertex mean")
    return found | of_extensions(bodies)


def _straight_metrics(space: AlignedSurfaces) -> dict[str, Any]:
    """Return metrics without a closed-form distance, by the cost of the straight way.

    Thousands of geodesics would take hours; norms of differences, halfway, take minutes.
    """
    straight = LinearPath(n_nodes=2)
    found: dict[str, Any] = {SOBOLEV: SobolevMetric(space, d1=1.0, geodesic_solver=straight)}
    # Vertices of a template whose triangles are not oriented consistently have no normals.
    with suppress(ArgumentError):
        found[GAUGE_INVARIANT] = GaugeInvariantMetric(SRNFMetric(space), geodesic_solver=straight)
    return found


def of_extensions(bodies: Any) -> dict[str, Any]:
    """Return the representations that other packages register, see `riemhuman.extensions`.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Surfaces; metrics apply only to registered ones.

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
        Surfaces; there are no metrics for surfaces that are not registered.

    Returns
    -------
    dict of str to RiemannianMetric
        By name.
    """
    if not (hasattr(bodies, "points") and hasattr(bodies, "template")):
        return {}
    space = AlignedSurfaces(bodies.template, equip=False)
    return {name: metric(space) for name, metric in extensions("metrics").items()}


def benchmark_notes(records: Sequence[BenchmarkRecord]) -> list[str]:
    """Return paragraphs that explain the columns and the rows of a formatted benchmark."""
    columns = (
        "Per cent, each body against all others: NN nearest neighbour, FT and ST first and "
        "second tier,\nmAP mean average precision; an asterisk marks the best of a column."
    )
    notes = [columns]
    if any(record.representation.endswith(STRAIGHT) for record in records):
        notes.append(
            "Metrics called straight have no closed-form distance: their rows compare by the\n"
            "norm of the difference of two bodies, halfway between them."
        )
    if any(record.representation.endswith(LEARNED) for record in records):
        scores = [
            f"  {row[0]} {', '.join(f'{score:.1f}' for score in row[1:])} ({task})"
            for task, rows in PAPER_TABLES.items()
            for row in rows
            if row[0].startswith(("GDVAE", "Zhou"))
        ]
        notes.append(
            "Codes are from networks after GDVAE and Zhou et al., trained on open bodies of other "
            "people in other\nposes. The paper's scores of the originals on FAUST (NN, FT, ST):\n"
            + "\n".join(scores)
        )
    return notes
