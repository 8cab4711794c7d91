"""A benchmark of all representations on all tasks: scores and computing times."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from riemhuman.errors import ArgumentError, ArgumentTypeError, RiemhumanError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.geometry.general_elastic_metric import GeneralElasticMetric
from riemhuman.geometry.rotation_metric import RotationMetric
from riemhuman.geometry.srnf import SRNFMetric
from riemhuman.progress import ProgressBar
from riemhuman.retrieval.scores import RetrievalScores, scores

SHAPE_METRIC = "shape metric (1, 0.0001, 0)"
"""Name of the paper's metric that tells who it is."""

POSE_METRIC = "pose metric (0, 0, 1)"
"""Name of the paper's metric that tells how they stand."""

ROTATION_METRIC = "rotation metric"
GENERAL_METRIC = "general elastic metric (1, 1, 1)"
"""Name of the metric of diffused rotations, which tells how they stand whoever they are."""

Described = tuple[np.ndarray, float]

_LABELS = {"shape": "subject", "pose": "pose"}


@dataclass(frozen=True)
class BenchmarkRecord:
    """One representation on one task.

    Attributes
    ----------
    representation : str
        What the distances are made of.
    task : str
        "shape", who is it, or "pose", how do they stand.
    scores : RetrievalScores or None
        Retrieval scores; None if the representation failed.
    seconds_per_body : float
        Time to describe a body, on the clock; 0 for a metric, all of whose work is in the pairs.
    seconds_per_pair : float
        Time of a distance, on the clock.
    problem : str or None
        Why the representation failed, if it did.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> shape = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template))
    >>> records = rh.retrieval.benchmark(bodies, {"shape": shape})
    >>> [(record.representation, record.task) for record in records]
    [('shape', 'shape'), ('shape', 'pose')]
    """

    representation: str
    task: str
    scores: RetrievalScores | None
    seconds_per_body: float
    seconds_per_pair: float
    problem: str | None = None


def benchmark(
    bodies: Any,
    representations: Mapping[str, Any] | None = None,
    *,
    n_jobs: int | None = None,
    progress: bool = False,
) -> list[BenchmarkRecord]:
    """Score representations by leave-one-out retrieval of people and of poses.

    A representation that refuses the data, such as a metric on meshes that are not registered or
    vectors that lack a body, does not end the benchmark: its records say why instead of scores.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Surfaces with the labels ``subject`` and ``pose``; a task is left out if its labels are
        None, or no two surfaces share one.
    representations : mapping of str to object, optional
        By name, metrics (with the method ``dist_pairwise``) or descriptors (with the methods
        ``describe`` and ``distances``). By default those of `table_metrics`;
        `riemhuman.retrieval.representations.available` lists all there are.
    n_jobs : int, optional
        Number of threads, -1 for one a core; by default one.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    list of BenchmarkRecord
        Representation by representation, in the order given, the task "shape" before "pose".

    Raises
    ------
    ArgumentTypeError
        If a representation is neither a metric nor a descriptor.
    ArgumentError
        If there is nothing to retrieve: fewer than two surfaces, or none share a label.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> shape = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template))
    >>> records = rh.retrieval.benchmark(bodies, {"shape": shape})
    >>> [(record.representation, record.task) for record in records]
    [('shape', 'shape'), ('shape', 'pose')]
    """
    if representations is None:
        representations = table_metrics(bodies)
    for name, representation in representations.items():
        _refuse_unknown(name, representation)
    labels = _labels(bodies)

    records = []
    described = described_together(representations, bodies, progress=progress)
    bar = ProgressBar(representations.items(), disable=not progress, unit="representation")
    for name, representation in bar:
        bar.set_description(name)
        try:
            distances, per_body, per_pair = timed_distances(
                representation, bodies, n_jobs, described.get(name)
            )
            found = {task: scores(distances, classes) for task, classes in labels.items()}
            records += [
                BenchmarkRecord(name, task, found[task], per_body, per_pair) for task in found
            ]
        except RiemhumanError as error:
            problem = f"{type(error).__name__}: {error}"
            records += [
                BenchmarkRecord(name, task, None, np.nan, np.nan, problem) for task in labels
            ]
        except Exception as error:
            error.add_note(f"while computing the representation {name!r}")
            raise
    return records


def table_metrics(bodies: Any) -> dict[str, Any]:
    """Return the metrics of all tables on registered bodies, by name.

    Parameters
    ----------
    bodies : Bodies
        Registered surfaces.

    Returns
    -------
    dict of str to RiemannianMetric
        The paper's shape metric and pose metric, that of square root normal fields, that of
        diffused rotations, and the general elastic metric. Metrics without a closed-form distance
        are no part of tables of all pairs.

    Raises
    ------
    ArgumentTypeError
        If the surfaces are not registered to a template.
    """
    if not hasattr(bodies, "points") or not hasattr(bodies, "template"):
        raise ArgumentTypeError(
            "bodies must be registered surfaces, with points and a template, for the metrics; "
            f"found {type(bodies).__name__}"
        )
    space = AlignedSurfaces(bodies.template, equip=False)
    return {
        SHAPE_METRIC: ElasticMetric(space, a=1.0, lam=1e-4, c=0.0),
        POSE_METRIC: ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
        "SRNF": SRNFMetric(space),
        ROTATION_METRIC: RotationMetric(space),
        GENERAL_METRIC: GeneralElasticMetric(space, a=1.0, b=1.0, c=1.0),
    }


def _refuse_unknown(name: str, representation: Any) -> None:
    if not (
        hasattr(representation, "dist_pairwise")
        or (hasattr(representation, "describe") and hasattr(representation, "distances"))
    ):
        raise ArgumentTypeError(
            f"representations[{name!r}] must be a metric, with dist_pairwise, or a descriptor, "
            f"with describe and distances; found {type(representation).__name__}"
        )


def _labels(bodies: Any) -> dict[str, list[Any]]:
    """Return the labels of every task that there is."""
    found = {}
    for task, field in _LABELS.items():
        labels = getattr(bodies, field, None)
        if labels is not None and max(Counter(np.asarray(labels).tolist()).values(), default=0) > 1:
            found[task] = np.asarray(labels).tolist()
    if not found:
        raise ArgumentError(
            f"bodies has nothing to retrieve: no two of its {len(bodies)} surfaces share a label "
            f"({' or '.join(_LABELS.values())})"
        )
    return found


def described_together(
    representations: Mapping[str, Any], bodies: Any, *, progress: bool = False
) -> dict[str, Described]:
    """Compute descriptors that share a costly step, such as spectra, together.

    Parameters
    ----------
    representations : mapping of str to object
        By name, metrics and descriptors; those with the same static method ``describe_together``
        share.
    bodies : Bodies or LabelledMeshes
        Surfaces.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    dict of str to (array, float)
        Vectors of the bodies by one descriptor, and the seconds it would take alone. Nothing of
        descriptors that share with no other, or refuse the bodies: each says why then.
    """
    kinds: dict[Any, dict[str, Any]] = {}
    for name, each in representations.items():
        if hasattr(each, "describe_together"):
            kinds.setdefault(each.describe_together, {})[name] = each
    found: dict[str, Described] = {}
    for together, sharing in kinds.items():
        if len(sharing) < 2:
            continue
        try:
            vectors, seconds = together(list(sharing.values()), bodies, progress=progress)
        except RiemhumanError:
            continue
        found.update(zip(sharing, zip(vectors, seconds, strict=True), strict=True))
    return found


def timed_distances(
    representation: Any, bodies: Any, n_jobs: int | None, described: Described | None = None
) -> tuple[np.ndarray, float, float]:
    """Return all distances of a set of bodies, and how long they took.

    Parameters
    ----------
    representation : object
        A metric or a descriptor.
    bodies : Bodies or LabelledMeshes
        Surfaces.
    n_jobs : int, optional
        Number of threads, -1 for one a core; by default one.
    described : (array, float), optional
        Vectors of the bodies by the descriptor, and the seconds they took; see
        `described_together`.

    Returns
    -------
    distances : array, shape (n, n)
    seconds_per_body : float
        Seconds on the clock to describe a body; 0 for a metric.
    seconds_per_pair : float
        Seconds on the clock of a distance.

    Raises
    ------
    ArgumentTypeError
        If the surfaces are not registered, and the representation is a metric.
    """
    n_bodies = len(bodies)
    n_pairs = n_bodies * (n_bodies - 1) // 2
    if hasattr(representation, "dist_pairwise"):
        if not hasattr(bodies, "points"):
            raise ArgumentTypeError("a metric needs surfaces registered to a template")
        # Loops compiled at first use are no part of what a distance costs.
        representation.dist_pairwise(bodies.points[:2])
        start = time.perf_counter()
        distances = representation.dist_pairwise(bodies.points, n_jobs=n_jobs)
        return distances, 0.0, (time.perf_counter() - start) / n_pairs

    start = time.perf_counter()
    if described is not None:
        vectors, seconds = described
    elif hasattr(representation, "describe_all"):
        vectors = representation.describe_all(bodies, n_jobs=n_jobs)
    else:
        vectors = np.stack([representation.describe(*mesh) for mesh in _meshes(bodies)])
    if described is None:
        seconds = time.perf_counter() - start
    start = time.perf_counter()
    distances = representation.distances(vectors)
    return distances, seconds / n_bodies, (time.perf_counter() - start) / n_pairs


def _meshes(bodies: Any) -> Any:
    if hasattr(bodies, "points"):
        return ((points, bodies.template.faces) for points in bodies.points)
    return (bodies[i] for i in range(len(bodies)))
