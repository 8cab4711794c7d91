"""All results of a report, computed or read from the store, in the order of the paper."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from riemhuman.datasets import load_open_model, load_open_motions
from riemhuman.geometry import AlignedSurfaces
from riemhuman.report._result_store import Computed, ResultStore, Step
from riemhuman.report.choices import group_of, pair_across, pair_within
from riemhuman.report.experiments import distance_steps, map_step, sweep_step
from riemhuman.report.path_experiments import (
    VIEWED_METRICS,
    PathExperiments,
    difference_step,
)
from riemhuman.report.plan import PATH_WEIGHTS, POSE, POSE_WEIGHTS, SHAPE, Plan
from riemhuman.surfaces.deformation_basis import DeformationBasis

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies

SAME_PERSON, SAME_POSE = "one person, two poses", "two people, one pose"


@dataclass(frozen=True)
class Results:
    """Results of the experiments; those for which no bodies have suitable labels are missing.

    Attributes
    ----------
    distances : mapping of str to Step
        Distances by representation.
    problems : mapping of str to str
        Error of each representation that has no distances.
    maps, sweep : Step
        Positions in the plane, and scores over the weights.
    geodesics : mapping of str to Step
        Geodesics of figure 4 by name.
    viewed : mapping of str to Step
        Geodesics between one pair of bodies, by metric.
    differences, comparison, mean : Step or None
        Differences of bodies, comparison of paths, and Karcher mean.
    basis : str
        Origin of the basis of deformations.
    """

    distances: Mapping[str, Step]
    problems: Mapping[str, str]
    maps: Step
    sweep: Step
    geodesics: Mapping[str, Step]
    viewed: Mapping[str, Step]
    differences: Step | None
    comparison: Step | None
    mean: Step | None
    basis: str


def compute_results(
    store: ResultStore,
    digest: str,
    bodies: Bodies,
    space: AlignedSurfaces,
    plan: Plan,
    basis: DeformationBasis | None,
    representations: Mapping[str, Any],
    *,
    bars: bool = False,
) -> Results:
    """Run all experiments.

    Parameters
    ----------
    store : ResultStore
        Store of the results.
    digest : str
        Fingerprint of the bodies.
    bodies : Bodies
        The bodies.
    space : AlignedSurfaces
        The surfaces.
    plan : Plan
        Sizes and seed.
    basis : DeformationBasis, optional
        Deformations; by default those of the open motions for the open bodies, mesh harmonics for
        others.
    representations : mapping of str to object
        Metrics and descriptors by name; the paper's two metrics are among them.
    bars : bool
        Whether to show progress bars.

    Returns
    -------
    Results
    """
    measured = distance_steps(store, digest, bodies, representations, bars=bars)
    problems = {n: s.record["problem"] for n, s in measured.items() if "problem" in s.record}
    distances = {name: step for name, step in measured.items() if name not in problems}
    pose, shape = (distances[name].arrays["distances"] for name in (POSE, SHAPE))
    maps = map_step(store, distances, plan)
    sweep = sweep_step(store, digest, bodies, space, plan)

    subject, stance = bodies.subject, bodies.pose
    moving = pair_within(pose, subject, stance, 0.5)
    growing = pair_within(shape, stance, subject, 1.0)
    bending = pair_within(pose, subject, stance, 0.9)
    both = pair_across(pose, subject, stance, 0.5)
    group = group_of(stance, subject, plan.n_averaged)

    found, origin = _basis(store, bodies, plan, basis)
    paths = PathExperiments(store, digest, bodies, space, found, plan)
    geodesics, viewed = {}, {}
    if moving is not None:
        title = "Geodesic between two poses"
        step = paths.geodesic("geodesic-pose-change", moving, PATH_WEIGHTS, title)
        geodesics[SAME_PERSON] = step
    if growing is not None:
        title = "Geodesic between two people"
        step = paths.geodesic("geodesic-shape-change", growing, POSE_WEIGHTS, title)
        geodesics[SAME_POSE] = step
    if both is not None:
        for name, weights in VIEWED_METRICS.items():
            slug = name.split()[0]
            viewed[name] = paths.geodesic(f"geodesic-{slug}", both, weights, f"Geodesic, {name}")
    pairs = {SAME_PERSON: moving, SAME_POSE: growing}
    chosen = {name: pair for name, pair in pairs.items() if pair is not None}
    return Results(
        distances,
        problems,
        maps,
        sweep,
        geodesics,
        viewed,
        difference_step(store, digest, bodies, space, chosen) if chosen else None,
        paths.comparison(bending) if bending is not None else None,
        paths.mean(group) if len(group) > 1 else None,
        origin,
    )


def _basis(
    store: ResultStore, bodies: Bodies, plan: Plan, basis: DeformationBasis | None
) -> tuple[DeformationBasis, str]:
    """Return the basis and its origin."""
    if basis is not None:
        return basis, f"{len(basis)} deformations, given"
    resolution = _open_resolution(bodies)

    def compute() -> Computed:
        if resolution is None:
            made = DeformationBasis.from_laplacian(bodies.template, plan.n_components)
        else:
            motions = load_open_motions(resolution, sequences=plan.sequences)
            made = DeformationBasis.from_motions(motions, plan.n_components, step=10)
        return {"vectors": made.vectors}, {}

    inputs = {
        "template": [bodies.template.vertices, bodies.template.faces],
        "open motions": resolution,
        "sequences": plan.sequences,
        "n_components": plan.n_components,
    }
    step = store.step("basis", inputs, compute, "Basis of deformations")
    made = DeformationBasis(step.arrays["vectors"])
    kind = "mesh harmonics" if resolution is None else "principal components of the open motions"
    return made, f"{len(made)} {kind}"


def _open_resolution(bodies: Bodies) -> str | None:
    """Return the resolution of the open bodies, or None for other bodies."""
    for resolution in ("coarse", "full"):
        model = load_open_model(resolution)
        if np.array_equal(model.template.faces, bodies.template.faces):
            return resolution
    return None
