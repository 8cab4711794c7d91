"""The experiments on all bodies: distances, maps, and the sweep over the weights."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import RiemhumanError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.plots.maps import METHODS, embed
from riemhuman.report._result_store import Computed, ResultStore, Step
from riemhuman.report.plan import (
    POSE,
    POSE_WEIGHTS,
    SHAPE,
    Plan,
    elastic_metric,
)
from riemhuman.report.retrieval_benchmark import Described, described_together, timed_distances
from riemhuman.retrieval.scores import scores

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies


def distance_steps(
    store: ResultStore,
    digest: str,
    bodies: Bodies,
    representations: Mapping[str, Any],
    *,
    bars: bool = False,
) -> dict[str, Step]:
    """Compute all distances between bodies by each representation.

    If a representation cannot be used on the bodies, its step holds the error instead.

    Parameters
    ----------
    store : ResultStore
        Store of the results.
    digest : str
        Fingerprint of the bodies.
    bodies : Bodies
        The bodies.
    representations : mapping of str to object
        Metrics and descriptors by name, as for `riemhuman.report.benchmark`.
    bars : bool
        Whether to show progress bars.

    Returns
    -------
    dict of str to Step
        Distances, shape (n, n), and the seconds per body and per pair.
    """
    steps = {}

    @cache
    def together(kind: Any) -> dict[str, Described]:
        # Called only if one of them is missing in the store: spectra take long.
        sharing = {name: each for name, each in representations.items() if _kind(each) is kind}
        return described_together(sharing, bodies, progress=bars)

    for name, representation in representations.items():

        def compute(name: str = name, representation: Any = representation) -> Computed:
            kind = _kind(representation)
            described = None if kind is None else together(kind).get(name)
            try:
                return _measured_distances(representation, bodies, described)
            except RiemhumanError as error:
                return {}, {"problem": f"{type(error).__name__}: {error}"}

        slug = "-".join("".join(c if c.isalnum() else " " for c in name.lower()).split())
        kind = f"{type(representation).__module__}.{type(representation).__qualname__}"
        inputs = {"bodies": digest, "representation": name, "kind": kind}
        steps[name] = store.step(f"distances-{slug}", inputs, compute, f"Distances, {name}")
    return steps


def _kind(representation: Any) -> Any:
    """Return the function that computes descriptors of one kind together, if there is one."""
    return getattr(representation, "describe_together", None)


def _measured_distances(
    representation: Any, bodies: Bodies, described: Described | None
) -> Computed:
    matrix, per_body, per_pair = timed_distances(representation, bodies, -1, described)
    return {"distances": np.asarray(matrix)}, {
        "seconds_per_body": per_body,
        "seconds_per_pair": per_pair,
    }


def map_step(store: ResultStore, distances: Mapping[str, Step], plan: Plan) -> Step:
    """Embed the bodies in the plane by the shape metric and the pose metric.

    Parameters
    ----------
    store : ResultStore
        Store of the results.
    distances : mapping of str to Step
        Distances of each representation.
    plan : Plan
        Plan with the seed of t-SNE.

    Returns
    -------
    Step
        Positions "shape t-sne", "shape mds", "pose t-sne" and "pose mds", shape (n, 2).
    """

    def compute() -> Computed:
        positions = {
            f"{task} {method}": embed(distances[name].arrays["distances"], method, rng=plan.seed)
            for task, name in (("shape", SHAPE), ("pose", POSE))
            for method in METHODS
        }
        return positions, {}

    inputs = {"shape": distances[SHAPE], "pose": distances[POSE], "seed": plan.seed}
    return store.step("maps", inputs, compute, "Maps")


def sweep_step(
    store: ResultStore, digest: str, bodies: Bodies, space: AlignedSurfaces, plan: Plan
) -> Step:
    """Score the retrieval of people and poses over λ and c, and by the normal part alone.

    Squared distances are sums, so both parts are computed once and then weighted.

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
        Plan with λ and c.

    Returns
    -------
    Step
        Squared distances of both parts, and rows of scores.
    """

    def compute() -> Computed:
        def squared(weights: tuple[float, float, float]) -> ndarray:
            return elastic_metric(space, weights).dist_pairwise(bodies.points, n_jobs=-1) ** 2

        normal = squared(POSE_WEIGHTS)
        metric = [squared((1.0, lam, 0.0)) for lam in plan.lams]
        rows = [
            _scores_row(bodies, part + c * normal, 1.0, lam, c)
            for lam, part in zip(plan.lams, metric, strict=True)
            for c in plan.weights
        ]
        rows.append(_scores_row(bodies, normal, 0.0, None, 1.0))
        return {"metric": np.stack(metric), "normal": normal}, {"rows": rows}

    inputs = {"bodies": digest, "lams": plan.lams, "weights": plan.weights}
    return store.step("sweep", inputs, compute, "Sweep over the weights")


def retrieval_rows(distances: Mapping[str, Step], labels: ndarray) -> list[dict[str, Any]]:
    """Return the scores of each representation.

    Parameters
    ----------
    distances : mapping of str to Step
        Distances of each representation.
    labels : array, shape (n,)
        Class of each item.

    Returns
    -------
    list of dict
    """
    rows = []
    for name, step in distances.items():
        found = scores(step.arrays["distances"], labels)
        rows.append(
            {
                "representation": name,
                "nn": found.nn,
                "first_tier": found.first_tier,
                "second_tier": found.second_tier,
                "mean_average_precision": found.mean_average_precision,
            }
        )
    return rows


def has_pairs(labels: ndarray) -> bool:
    """Return whether any two items share a class.

    Parameters
    ----------
    labels : array, shape (n,)
        Class of each item.

    Returns
    -------
    bool
    """
    return len(np.unique(labels)) < len(labels)


def _scores_row(
    bodies: Bodies, squared: ndarray, a: float, lam: float | None, c: float
) -> dict[str, Any]:
    row: dict[str, Any] = {"a": a, "lam": lam, "c": c}
    for task, labels in (("shape", bodies.subject), ("pose", bodies.pose)):
        if has_pairs(labels):
            found = scores(np.sqrt(squared), labels)
            row[f"{task}_nn"] = found.nn
            row[f"{task}_mean_average_precision"] = found.mean_average_precision
    return row
