"""The experiments of the report, each a step whose result is kept, in the order of the paper."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.datasets import load_open_model, load_open_motions
from riemhuman.errors import ConvergenceWarning, RiemhumanError
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    RiemannianMetric,
    SobolevMetric,
    SRNFMetric,
)
from riemhuman.plots import contributions, embed
from riemhuman.report._storage import Computed, ResultStore, Step
from riemhuman.report.retrieval_benchmark import (
    POSE_METRIC,
    SHAPE_METRIC,
    Described,
    described_together,
    timed_distances,
)
from riemhuman.retrieval import scores
from riemhuman.solvers import (
    BasisMean,
    BasisPath,
    LinearPath,
    ModelParameters,
    ModelPath,
    compare_paths,
)
from riemhuman.surfaces import DeformationBasis

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies

Pair = tuple[int, int]
Weights = tuple[float, float, float]

# Weights (a, λ, c) of the paper's experiments.
POSE_WEIGHTS: Weights = (0.0, 0.0, 1.0)
PATH_WEIGHTS: Weights = (1.0, 1.0, 0.0)
VIEWED_METRICS = {
    "shape (1, 1, 0)": PATH_WEIGHTS,
    "pose (0, 0, 1)": POSE_WEIGHTS,
    "both (1, 1, 0.1)": (1.0, 1.0, 0.1),
}
LINEAR, SRNF_PATH, SOBOLEV, MODEL, OURS = "linear", "SRNF", "Sobolev", "body model", "ours"
# Weights a0, a1, b1, c1, d1 and a2.
SOBOLEV_WEIGHTS = (0.0, 1.0, 1.0, 1.0, 0.0, 1e-3)
SAME_PERSON, SAME_POSE = "one person, two poses", "two people, one pose"


@dataclass(frozen=True)
class Plan:
    """Sizes of the experiments, values of λ and c of the sweep with a = 1, tolerance and seed."""

    n_nodes: int = 11
    n_components: int = 100
    sequences: tuple[str, ...] | None = None  # motions of the basis
    lams: tuple[float, ...] = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    weights: tuple[float, ...] = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    n_averaged: int = 5
    tolerance: float = 1e-5
    seed: int = 0


QUICK = Plan(
    n_nodes=7,
    n_components=40,
    sequences=("punching", "knees"),
    lams=(1e-4, 1e-2, 1.0),
    weights=(0.0, 1e-4, 1e-2, 1.0),
    tolerance=1e-4,
)


def readable(name: str) -> str:
    """Return the name of a class as written in running text: "T-like" for "t_like"."""
    whole = re.sub(r"^([at])_(?=(like|pose)$)", lambda match: f"{match[1].upper()}-", name)
    return whole.replace("_", " ")


def name_of(bodies: Bodies, index: int) -> str:
    """Return the names of the person and the pose of a body."""
    subject = bodies.subject_names[bodies.subject[index]]
    return f"{readable(subject)}, {readable(bodies.pose_names[bodies.pose[index]])}"


def has_pairs(labels: ndarray) -> bool:
    """Return whether any two items share a class."""
    return len(np.unique(labels)) < len(labels)


def pair_within(distances: ndarray, same: ndarray, other: ndarray, share: float) -> Pair | None:
    """Return two items that share one class and differ in another, by their distance.

    The first class with such a pair is used; of its pairs in the order of their distances, the one
    at `share`: 0 for the nearest, 1 for the farthest.
    """
    for label in dict.fromkeys(same.tolist()):
        items = np.flatnonzero(same == label)
        first, second = np.triu_indices(len(items), 1)
        apart = other[items[first]] != other[items[second]]
        first, second = items[first[apart]], items[second[apart]]
        if len(first):
            order = np.argsort(distances[first, second], kind="stable")
            chosen = order[round(share * (len(order) - 1))]
            return int(first[chosen]), int(second[chosen])
    return None


def pair_across(distances: ndarray, same: ndarray, other: ndarray, share: float) -> Pair | None:
    """Return the first item and one that differs from it in both classes, by their distance."""
    items = np.flatnonzero((same != same[0]) & (other != other[0]))
    if len(items) == 0:
        return None
    order = items[np.argsort(distances[0, items], kind="stable")]
    return 0, int(order[round(share * (len(order) - 1))])


def group_within(same: ndarray, other: ndarray, size: int) -> ndarray:
    """Return at most `size` items of the class with the most other classes, one of each."""
    groups = []
    for label in dict.fromkeys(same.tolist()):
        items = np.flatnonzero(same == label)
        _, first = np.unique(other[items], return_index=True)
        groups.append(items[np.sort(first)])
    group = max(groups, key=len)
    places = np.linspace(0, len(group) - 1, min(size, len(group))).round().astype(np.int64)
    return group[places]


@dataclass(frozen=True)
class Results:
    """Results of the experiments; those for which no bodies have suitable labels are missing.

    `problems` holds the errors of representations without distances.
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


@dataclass(frozen=True, eq=False)
class Experiments:
    """The experiments on a set of bodies with a fingerprint."""

    store: ResultStore
    digest: str
    bodies: Bodies
    plan: Plan

    def run(
        self,
        representations: Mapping[str, Any],
        basis: DeformationBasis | None = None,
        *,
        bars: bool = False,
    ) -> Results:
        """Run all experiments; the paper's two metrics are among the representations."""
        steps = self._distances(representations, bars=bars)
        problems = {n: s.record["problem"] for n, s in steps.items() if "problem" in s.record}
        distances = {name: step for name, step in steps.items() if name not in problems}
        maps, sweep = self._maps(distances), self._sweep()
        by_pose, by_shape = (
            distances[name].arrays["distances"] for name in (POSE_METRIC, SHAPE_METRIC)
        )
        subject, pose = self.bodies.subject, self.bodies.pose
        moving = pair_within(by_pose, subject, pose, 0.5)
        growing = pair_within(by_shape, pose, subject, 1.0)
        bending = pair_within(by_pose, subject, pose, 0.9)
        both = pair_across(by_pose, subject, pose, 0.5)
        group = group_within(pose, subject, self.plan.n_averaged)

        chosen, origin = self._basis(basis)
        geodesics, viewed = {}, {}
        if moving is not None:
            geodesics[SAME_PERSON] = self._geodesic(
                chosen, "pose-change", moving, PATH_WEIGHTS, "between two poses"
            )
        if growing is not None:
            geodesics[SAME_POSE] = self._geodesic(
                chosen, "shape-change", growing, POSE_WEIGHTS, "between two people"
            )
        if both is not None:
            for name, weights in VIEWED_METRICS.items():
                viewed[name] = self._geodesic(chosen, name.split()[0], both, weights, name)
        pairs = {
            name: pair
            for name, pair in ((SAME_PERSON, moving), (SAME_POSE, growing))
            if pair is not None
        }
        return Results(
            distances,
            problems,
            maps,
            sweep,
            geodesics,
            viewed,
            self._differences(pairs) if pairs else None,
            self._comparison(chosen, bending) if bending is not None else None,
            self._mean(chosen, group) if len(group) > 1 else None,
            origin,
        )

    def metric(self, weights: Weights) -> ElasticMetric:
        """Return a metric of the paper's family."""
        a, lam, c = weights
        space = AlignedSurfaces(self.bodies.template, equip=False)
        return ElasticMetric(space, a=a, lam=lam, c=c)

    def _distances(self, representations: Mapping[str, Any], *, bars: bool) -> dict[str, Step]:
        """Compute all distances and their times; a step holds the error of a representation."""

        @cache
        def together(kind: Any) -> dict[str, Described]:
            # Called only if one of them is missing in the store: spectra take long.
            sharing = {n: r for n, r in representations.items() if _kind(r) is kind}
            return described_together(sharing, self.bodies, progress=bars)

        def compute(name: str, representation: Any) -> Computed:
            kind = _kind(representation)
            described = None if kind is None else together(kind).get(name)
            try:
                matrix, per_body, per_pair = timed_distances(
                    representation, self.bodies, -1, described
                )
            except RiemhumanError as error:
                return {}, {"problem": f"{type(error).__name__}: {error}"}
            record = {"seconds_per_body": per_body, "seconds_per_pair": per_pair}
            return {"distances": np.asarray(matrix)}, record

        steps = {}
        for name, representation in representations.items():
            slug = "-".join("".join(c if c.isalnum() else " " for c in name.lower()).split())
            kind = f"{type(representation).__module__}.{type(representation).__qualname__}"
            inputs = {"bodies": self.digest, "representation": name, "kind": kind}
            steps[name] = self.store.step(
                f"distances-{slug}",
                inputs,
                partial(compute, name, representation),
                f"Distances, {name}",
            )
        return steps

    def _maps(self, distances: Mapping[str, Step]) -> Step:
        """Place the bodies in the plane: "shape t-sne", "shape mds", "pose t-sne", "pose mds"."""
        by = {"shape": distances[SHAPE_METRIC], "pose": distances[POSE_METRIC]}

        def compute() -> Computed:
            return {
                f"{task} {method}": embed(step.arrays["distances"], method, rng=self.plan.seed)
                for task, step in by.items()
                for method in ("t-sne", "mds")
            }, {}

        return self.store.step("maps", {**by, "seed": self.plan.seed}, compute, "Maps")

    def _sweep(self) -> Step:
        """Score the retrieval of people and poses over λ and c, and by the normal part alone.

        Squared distances are sums, so both parts are computed once and then weighted.
        """
        plan = self.plan

        def squared(weights: Weights) -> ndarray:
            return self.metric(weights).dist_pairwise(self.bodies.points, n_jobs=-1) ** 2

        def compute() -> Computed:
            normal = squared(POSE_WEIGHTS)
            metric = [squared((1.0, lam, 0.0)) for lam in plan.lams]
            rows = [
                self._sweep_row(part + c * normal, 1.0, lam, c)
                for lam, part in zip(plan.lams, metric, strict=True)
                for c in plan.weights
            ]
            rows.append(self._sweep_row(normal, 0.0, None, 1.0))
            return {"metric": np.stack(metric), "normal": normal}, {"rows": rows}

        inputs = {"bodies": self.digest, "lams": plan.lams, "weights": plan.weights}
        return self.store.step("sweep", inputs, compute, "Sweep over the weights")

    def _sweep_row(self, squared: ndarray, a: float, lam: float | None, c: float) -> dict[str, Any]:
        row: dict[str, Any] = {"a": a, "lam": lam, "c": c}
        for task, labels in (("shape", self.bodies.subject), ("pose", self.bodies.pose)):
            if has_pairs(labels):
                own = scores(np.sqrt(squared), labels)
                row[f"{task}_nn"] = own.nn
                row[f"{task}_mean_average_precision"] = own.mean_average_precision
        return row

    def _basis(self, basis: DeformationBasis | None) -> tuple[DeformationBasis, str]:
        """Return the basis and its origin."""
        if basis is not None:
            return basis, f"{len(basis)} deformations, given"
        template, plan = self.bodies.template, self.plan
        # The open bodies have motions.
        resolution = next(
            (
                resolution
                for resolution in ("coarse", "full")
                if np.array_equal(load_open_model(resolution).faces, template.faces)
            ),
            None,
        )

        def compute() -> Computed:
            if resolution is None:
                made = DeformationBasis.from_laplacian(template, plan.n_components)
            else:
                motions = load_open_motions(resolution, sequences=plan.sequences)
                made = DeformationBasis.from_motions(motions, plan.n_components, step=10)
            return {"vectors": made.vectors}, {}

        inputs = {
            "template": [template.vertices, template.faces],
            "open motions": resolution,
            "sequences": plan.sequences,
            "n_components": plan.n_components,
        }
        step = self.store.step("basis", inputs, compute, "Basis of deformations")
        made = DeformationBasis(step.arrays["vectors"])
        kind = "principal components of the open motions" if resolution else "mesh harmonics"
        return made, f"{len(made)} {kind}"

    def _solver(self, basis: DeformationBasis) -> BasisPath:
        return BasisPath(basis, self.plan.n_nodes, tolerance=self.plan.tolerance)

    def _path_inputs(self, basis: DeformationBasis, **inputs: Any) -> dict[str, Any]:
        return {
            "bodies": self.digest,
            "basis": np.asarray(basis.vectors),
            "n_nodes": self.plan.n_nodes,
            "tolerance": self.plan.tolerance,
            **inputs,
        }

    def _geodesic(
        self, basis: DeformationBasis, slug: str, pair: Pair, weights: Weights, title: str
    ) -> Step:
        """Find the geodesic between two bodies (figure 4 of the paper).

        The search begins on a path that rotates each triangle, and once more on the straight path,
        as in the paper.
        """
        start, end = self.bodies.points[list(pair)]

        def compute() -> Computed:
            metric = self.metric(weights)
            linear = LinearPath(self.plan.n_nodes)
            straight = linear.solve(metric, start, end)
            as_printed = replace(self._solver(basis), initial=linear)
            with warnings.catch_warnings():
                # The record tells whether this path, as in the paper, converged.
                warnings.simplefilter("ignore", ConvergenceWarning)
                from_straight = as_printed.solve(metric, start, end)
            began = time.perf_counter()
            result = self._solver(basis).solve(metric, start, end)
            seconds = time.perf_counter() - began
            arrays = {
                "path": result.path,
                "energies": result.energies,
                "energies_from_straight": from_straight.energies,
            }
            return arrays, {
                "pair": list(pair),
                "weights": list(weights),
                "straight_energy": straight.energy,
                "energy_from_straight": from_straight.energy,
                "energy": result.energy,
                "squared_distance": float(metric.squared_dist(start, end)),
                "n_iterations": result.n_iterations,
                "converged": bool(result.converged),
                "converged_from_straight": bool(from_straight.converged),
                "seconds": seconds,
            }

        inputs = self._path_inputs(basis, pair=pair, weights=weights)
        return self.store.step(f"geodesic-{slug}", inputs, compute, f"Geodesic, {title}")

    def _comparison(self, basis: DeformationBasis, pair: Pair) -> Step:
        """Find paths between two bodies by several methods, and compare them (figure 5)."""
        start, end = self.bodies.points[list(pair)]
        n_nodes = self.plan.n_nodes

        def compute() -> Computed:
            space = AlignedSurfaces(self.bodies.template, equip=False)
            metrics: dict[str, RiemannianMetric] = {
                "ours": self.metric(PATH_WEIGHTS),
                "srnf": SRNFMetric(space),
                "sobolev": SobolevMetric(space, *SOBOLEV_WEIGHTS),
            }
            srnf = BasisPath(basis, n_nodes, initial=LinearPath(n_nodes), tolerance=1e-3)
            solvers: dict[str, tuple[Any, str]] = {
                LINEAR: (LinearPath(n_nodes), "ours"),
                SRNF_PATH: (srnf, "srnf"),
                SOBOLEV: (self._solver(basis), "sobolev"),
            }
            reference = None
            model_path = self._model_path(pair)
            if model_path is not None:
                solvers[MODEL] = (model_path, "ours")
                reference = model_path.solve(metrics["ours"], start, end).path
            solvers[OURS] = (self._solver(basis), "ours")
            compared = compare_paths(metrics, start, end, solvers, reference)
            paths = {path.name: path.result.path for path in compared}
            return paths, {"pair": list(pair), "rows": [path.as_row() for path in compared]}

        inputs = self._path_inputs(basis, pair=pair, sobolev=SOBOLEV_WEIGHTS)
        return self.store.step("comparison", inputs, compute, "Paths compared")

    def _model_path(self, pair: Pair) -> ModelPath | None:
        """Return the path of the body model, if the parameters of the bodies are known."""
        bodies = self.bodies
        model, betas, poses = bodies.model, bodies.betas, bodies.pose_vectors
        places = bodies.translations
        if model is None or betas is None or poses is None or places is None:
            return None

        def parameters(surface: ndarray) -> ModelParameters:
            gaps = [float(np.abs(bodies.points[index] - surface).max()) for index in pair]
            index = pair[int(np.argmin(gaps))]
            return ModelParameters(betas[index], poses[index], places[index])

        return ModelPath(model, self.plan.n_nodes, parameters=parameters)

    def _mean(self, basis: DeformationBasis, group: ndarray) -> Step:
        """Find the Karcher mean of bodies by the normal part alone (figure 6 of the paper)."""
        points = self.bodies.points[group]

        def compute() -> Computed:
            metric = self.metric(POSE_WEIGHTS)
            start = time.perf_counter()
            result = BasisMean(basis).solve(metric, points)
            return {"mean": result.point, "variances": result.variances}, {
                "group": group.tolist(),
                "variance": result.variance,
                "distances": metric.dist(points, result.point).tolist(),
                "n_iterations": result.n_iterations,
                "converged": bool(result.converged),
                "seconds": time.perf_counter() - start,
            }

        inputs = self._path_inputs(basis, group=group.tolist())
        return self.store.step("mean", inputs, compute, "Karcher mean")

    def _differences(self, pairs: Mapping[str, Pair]) -> Step:
        """Compute where pairs of bodies differ: "NAME metric" and "NAME normal", shape (F,)."""
        weights = (1.0, 1.0, 1.0)

        def compute() -> Computed:
            metric = self.metric(weights)
            arrays: dict[str, ndarray] = {}
            rows = []
            for name, pair in pairs.items():
                points = self.bodies.points[list(pair)]
                parts = contributions(metric, *points)
                arrays |= {f"{name} metric": parts.metric, f"{name} normal": parts.normal}
                row: dict[str, Any] = {"pair": name, "metric_part": float(parts.metric.sum())}
                row["normal_part"] = float(parts.normal.sum())
                row["squared_distance"] = float(metric.squared_dist(*points))
                rows.append(row)
            return arrays, {"rows": rows, "pairs": {n: list(pair) for n, pair in pairs.items()}}

        inputs = {"bodies": self.digest, "pairs": dict(pairs), "weights": weights}
        return self.store.step("differences", inputs, compute, "Where bodies differ")


def _kind(representation: Any) -> Any:
    """Return the function that computes descriptors of one kind together, if there is one."""
    return getattr(representation, "describe_together", None)
