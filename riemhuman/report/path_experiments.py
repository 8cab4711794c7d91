"""The experiments on single bodies: geodesics, their comparison, the mean and differences."""

from __future__ import annotations

import time
import warnings
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy import ndarray

from riemhuman.errors import ConvergenceWarning
from riemhuman.geometry import AlignedSurfaces, RiemannianMetric, SobolevMetric, SRNFMetric
from riemhuman.geometry.surface_metric import contributions
from riemhuman.report._result_store import Computed, ResultStore, Step
from riemhuman.report.choices import Pair
from riemhuman.report.plan import (
    BOTH_WEIGHTS,
    PATH_WEIGHTS,
    POSE_WEIGHTS,
    Plan,
    elastic_metric,
)
from riemhuman.solvers import BasisMean, BasisPath, LinearPath, ModelPath, compare_paths
from riemhuman.solvers.interpolated_paths import ModelParameters
from riemhuman.solvers.results import MeanResult, PathResult
from riemhuman.surfaces.deformation_basis import DeformationBasis

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies

Result = TypeVar("Result", PathResult, MeanResult)

VIEWED_METRICS = {
    "shape (1, 1, 0)": PATH_WEIGHTS,
    "pose (0, 0, 1)": POSE_WEIGHTS,
    "both (1, 1, 0.1)": BOTH_WEIGHTS,
}
LINEAR, SRNF_PATH, SOBOLEV, MODEL, OURS = "linear", "SRNF", "Sobolev", "body model", "ours"
# Weights a0, a1, b1, c1, d1 and a2.
SOBOLEV_WEIGHTS = (0.0, 1.0, 1.0, 1.0, 0.0, 1e-3)


class PathExperiments:
    """The experiments that use a basis of deformations.

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
    basis : DeformationBasis
        Basis of deformations.
    plan : Plan
        Sizes of the experiments.
    """

    def __init__(
        self,
        store: ResultStore,
        digest: str,
        bodies: Bodies,
        space: AlignedSurfaces,
        basis: DeformationBasis,
        plan: Plan,
    ) -> None:
        self._store = store
        self._bodies = bodies
        self._space = space
        self._basis = basis
        self._plan = plan
        self._inputs = {
            "bodies": digest,
            "basis": np.asarray(basis.vectors),
            "n_nodes": plan.n_nodes,
            "tolerance": plan.tolerance,
        }

    def geodesic(
        self, name: str, pair: Pair, weights: tuple[float, float, float], title: str
    ) -> Step:
        """Find the geodesic between two bodies (figure 4 of the paper).

        Parameters
        ----------
        name : str
            Name of the step.
        pair : tuple of int
            The bodies.
        weights : tuple of float
            (a, λ, c).
        title : str
            Title of the step.

        Returns
        -------
        Step
            The path, its energies, the energy of the straight path and the squared distance.
        """
        start, end = self._bodies.points[list(pair)]

        def compute() -> Computed:
            metric = elastic_metric(self._space, weights)
            linear = LinearPath(self._plan.n_nodes)
            straight = linear.solve(metric, start, end)
            as_printed = replace(self._solver(), initial=linear)
            with warnings.catch_warnings():
                # The record tells whether this path, as in the paper, converged.
                warnings.simplefilter("ignore", ConvergenceWarning)
                from_straight = as_printed.solve(metric, start, end)
            began = time.perf_counter()
            result = self._solver().solve(metric, start, end)
            seconds = time.perf_counter() - began
            energies = {
                "energies": result.energies,
                "energies_from_straight": from_straight.energies,
            }
            return {"path": result.path, **energies}, {
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

        return self._store.step(
            name, {**self._inputs, "pair": pair, "weights": weights}, compute, title
        )

    def comparison(self, pair: Pair) -> Step:
        """Find paths between two bodies by several methods, and compare them (figure 5).

        Parameters
        ----------
        pair : tuple of int
            The bodies.

        Returns
        -------
        Step
            Paths by name, and a row of measures for each.
        """
        bodies, n_nodes = self._bodies, self._plan.n_nodes
        start, end = bodies.points[list(pair)]

        def compute() -> Computed:
            metrics: dict[str, RiemannianMetric] = {
                "ours": elastic_metric(self._space, PATH_WEIGHTS),
                "srnf": SRNFMetric(self._space),
                "sobolev": SobolevMetric(self._space, *SOBOLEV_WEIGHTS),
            }
            srnf = BasisPath(self._basis, n_nodes, initial=LinearPath(n_nodes), tolerance=1e-3)
            solvers: dict[str, tuple[Any, str]] = {
                LINEAR: (LinearPath(n_nodes), "ours"),
                SRNF_PATH: (srnf, "srnf"),
                SOBOLEV: (self._solver(), "sobolev"),
            }
            reference = None
            model_path = self._model_path(pair)
            if model_path is not None:
                solvers[MODEL] = (model_path, "ours")
                reference = model_path.solve(metrics["ours"], start, end).path
            solvers[OURS] = (self._solver(), "ours")
            compared = compare_paths(metrics, start, end, solvers, reference)
            paths = {one.name: one.result.path for one in compared}
            return paths, {"pair": list(pair), "rows": [one.as_row() for one in compared]}

        inputs = {**self._inputs, "pair": pair, "sobolev": SOBOLEV_WEIGHTS}
        return self._store.step("comparison", inputs, compute, "Paths compared")

    def mean(self, group: ndarray) -> Step:
        """Find the Karcher mean of bodies by the normal part alone, as in the paper.

        Parameters
        ----------
        group : array of int, shape (n,)
            The bodies.

        Returns
        -------
        Step
            The mean, the variance, and the distances of the bodies from the mean.
        """
        points = self._bodies.points[group]

        def compute() -> Computed:
            metric = elastic_metric(self._space, POSE_WEIGHTS)
            began = time.perf_counter()
            result = BasisMean(self._basis).solve(metric, points)
            return {"mean": result.point, "variances": result.variances}, {
                "group": group.tolist(),
                "variance": result.variance,
                "distances": metric.dist(points, result.point).tolist(),
                "n_iterations": result.n_iterations,
                "converged": bool(result.converged),
                "seconds": time.perf_counter() - began,
            }

        return self._store.step(
            "mean", {**self._inputs, "group": group.tolist()}, compute, "Karcher mean"
        )

    def _solver(self) -> BasisPath:
        return BasisPath(self._basis, self._plan.n_nodes, tolerance=self._plan.tolerance)

    def _model_path(self, pair: Pair) -> ModelPath | None:
        """Return the path of the body model, if the parameters of the bodies are known."""
        bodies = self._bodies
        model, betas, poses = bodies.model, bodies.betas, bodies.pose_vectors
        if model is None or betas is None or poses is None or bodies.translations is None:
            return None
        places = bodies.translations

        def parameters(surface: ndarray) -> ModelParameters:
            gaps = [float(np.abs(bodies.points[index] - surface).max()) for index in pair]
            index = pair[int(np.argmin(gaps))]
            return ModelParameters(betas[index], poses[index], places[index])

        return ModelPath(model, self._plan.n_nodes, parameters=parameters)


def difference_step(
    store: ResultStore,
    digest: str,
    bodies: Bodies,
    space: AlignedSurfaces,
    pairs: dict[str, Pair],
) -> Step:
    """Compute where pairs of bodies differ, in the metric part and in the normal part.

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
    pairs : dict of str to tuple of int
        Pairs of bodies by name.

    Returns
    -------
    Step
        Parts of the squared distance under (1, 1, 1): "NAME metric" and "NAME normal", shape (F,).
    """
    weights = (1.0, 1.0, 1.0)

    def compute() -> Computed:
        metric = elastic_metric(space, weights)
        arrays: dict[str, ndarray] = {}
        rows = []
        for name, (one, other) in pairs.items():
            parts = contributions(metric, bodies.points[one], bodies.points[other])
            arrays |= {f"{name} metric": parts.metric, f"{name} normal": parts.normal}
            rows.append(
                {
                    "pair": name,
                    "metric_part": float(parts.metric.sum()),
                    "normal_part": float(parts.normal.sum()),
                    "squared_distance": float(
                        metric.squared_dist(bodies.points[one], bodies.points[other])
                    ),
                }
            )
        return arrays, {"rows": rows, "pairs": {name: list(pair) for name, pair in pairs.items()}}

    inputs = {"bodies": digest, "pairs": pairs, "weights": weights}
    return store.step("differences", inputs, compute, "Where bodies differ")
