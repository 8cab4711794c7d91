"""A benchmark of representations on retrieval tasks: scores and computing times."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from dataclasses import dataclass
from typing import TypeAlias, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Integers
from riemhuman.checks import (
    a_function,
    checked,
    each,
    flag,
    instance,
)
from riemhuman.checks.labels import class_numbers
from riemhuman.datasets import Bodies, LabelledMeshes
from riemhuman.descriptors import (
    AreaProjectionTransform,
    Descriptor,
    HeatKernelSignature,
    ModelPoseVectors,
    ModelShapeVectors,
    ShapeDNA,
    WaveKernelSignature,
)
from riemhuman.descriptors.descriptor import Surfaces, meshes_of
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    MissingDependencyError,
    RiemhumanError,
)
from riemhuman.extensions import extensions
from riemhuman.geometry import (
    AlignedSurfaces,
    AreaMetric,
    ElasticMetric,
    GaugeInvariantMetric,
    GeneralElasticMetric,
    RiemannianMetric,
    RotationMetric,
    SobolevMetric,
    SRNFMetric,
)
from riemhuman.geometry.manifold import SurfaceSpace
from riemhuman.learned.intrinsic_extrinsic_codes import IntrinsicExtrinsicCodes
from riemhuman.learned.shape_pose_codes import ShapePoseCodes
from riemhuman.retrieval.scores import RetrievalScores, scores
from riemhuman.solvers.paths import LinearPath
from riemhuman.statistics import LearnedMetric, PersonMetric
from riemhuman.surfaces.template import Template

# Names in tables.
SHAPE_METRIC = "shape metric (1, 0.0001, 0)"
POSE_METRIC = "pose metric (0, 0, 1)"
_LEARNED_METRIC = "learned from labels, other people"  # fitted without the people of both bodies
# Metrics without closed form, compared by the cost of straight paths.
_STRAIGHT = ", straight"
LEARNED = ", trained here"  # ending of the names of learned codes
SOBOLEV = f"Sobolev metric{_STRAIGHT}"
GAUGE_INVARIANT = f"gauge-invariant SRNF{_STRAIGHT}"

Described: TypeAlias = tuple[Array, float]
Task: TypeAlias = Callable[[str], AbstractContextManager[object]]

AMONG_OTHERS = "pose among other people"  # other bodies of the same person are left out
TITLES = {"shape": "Who is it?", "pose": "How do they stand?"}
TITLES[AMONG_OTHERS] = "How, among other people?"
_COLUMNS = ("NN", "FT", "ST", "mAP")
_LABELS = {"shape": "subject", "pose": "pose"}


Representation: TypeAlias = "RiemannianMetric | Descriptor"
"""A way to compare bodies: a metric of registered surfaces, or vectors that describe meshes."""


Together: TypeAlias = Callable[..., tuple[list[Array], list[float]]]  # type: ignore[explicit-any]
"""Describes bodies by several descriptors of one kind, which differs between such functions."""


@dataclass(frozen=True)
class BenchmarkRecord:
    """Scores and computing times of one representation on one task.

    Attributes
    ----------
    representation : str
    task : {"shape", "pose", "pose among other people"}
        The retrieval of the person or of the pose.
    scores : RetrievalScores or None
        None if the representation failed.
    seconds_per_body, seconds_per_pair : float
        Wall-clock time to describe a body (0 for a metric), and to compute a distance.
    problem : str or None
        The error, if the representation failed.

    Examples
    --------
    See `format_benchmark`.
    """

    representation: str
    task: str
    scores: RetrievalScores | None
    seconds_per_body: float
    seconds_per_pair: float
    problem: str | None = None


@checked(learned=flag, task=a_function, progress=flag)
def benchmark(
    bodies: Bodies | LabelledMeshes,
    representations: Mapping[str, Representation] | None = None,
    *,
    learned: bool = False,
    progress: bool = False,
    task: Task = nullcontext,
) -> list[BenchmarkRecord]:
    """Score representations by leave-one-out retrieval of people and of poses.

    If a representation cannot be used on the data, its records contain the error instead.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Surfaces with the labels ``subject`` and ``pose``; a task is left out if its labels are
        None, or no two surfaces share a label. Labels of single surfaces may not be missing, see
        `rh.retrieval.scores`.
    representations : mapping of str to object, optional
        By name, metrics (with the method ``dist_pairwise``) or descriptors (with the methods
        ``describe`` and ``distances``), such as `representations` of the bodies; by default the
        metrics of the paper, its successors and other packages.
    learned : bool
        Whether to add metrics learned from the labels of other people, and the retrieval of the
        pose among other people.
    progress : bool
    task : callable
        Takes the name of a task; returns a context manager that is open during the task.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> shape = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template))
    >>> [record.task for record in rh.retrieval.benchmark(bodies, {"shape": shape})]
    ['shape', 'pose']
    """
    if representations is None:
        representations = _default_metrics(bodies, task)
    labels = _labels_by_task(bodies)

    def score(matrices: Mapping[str, Array]) -> dict[str, RetrievalScores]:
        scores_by_task = {kind: scores(matrix, labels[kind]) for kind, matrix in matrices.items()}
        if learned and "pose" in scores_by_task:
            scores_by_task[AMONG_OTHERS] = scores(matrices["pose"], labels["pose"], bodies.subject)
        return scores_by_task

    records: list[BenchmarkRecord] = []
    described = described_together(representations, bodies, progress=progress)
    n_pairs = len(bodies) * (len(bodies) - 1) // 2
    for name, representation in representations.items():
        try:
            with task(f"{name}: {n_pairs:,} distances"):
                distances, seconds_per_body, seconds_per_pair = timed_distances(
                    representation, bodies, described.get(name)
                )
            scores_by_task = score(dict.fromkeys(labels, distances))
        except RiemhumanError as error:
            problem = f"{type(error).__name__}: {error}"
            records += [BenchmarkRecord(name, t, None, np.nan, np.nan, problem) for t in labels]
            continue
        records += [
            BenchmarkRecord(name, t, task_scores, seconds_per_body, seconds_per_pair)
            for t, task_scores in scores_by_task.items()
        ]
    if learned:
        with task(f"{_LEARNED_METRIC}: distances"), suppress(MissingDependencyError):
            scores_by_task = score(_learned_distances(bodies))
            records += [
                BenchmarkRecord(_LEARNED_METRIC, t, task_scores, 0.0, np.nan)
                for t, task_scores in scores_by_task.items()
            ]
    return records


def _default_metrics(bodies: Bodies | LabelledMeshes, task: Task) -> dict[str, Representation]:
    """Return the metrics of tables, and those of extensions."""
    metrics = table_metrics(bodies, task)
    for name, representation in of_extensions(bodies).items():
        if hasattr(representation, "dist_pairwise"):
            metrics[name] = representation
    return metrics


def _labels_by_task(bodies: Bodies | LabelledMeshes) -> dict[str, Integers]:
    """Return numbers of classes, for each task in which some surfaces share a label."""
    labels = {}
    for kind, field in _LABELS.items():
        labels_of_field = getattr(bodies, field, None)
        if labels_of_field is None:
            continue
        numbers, classes = class_numbers(labels_of_field, f"bodies.{field}", len(bodies))
        if len(classes) < len(numbers):
            labels[kind] = numbers
    if not labels:
        raise ArgumentError(
            f"bodies must have labels that some surfaces share; no two of {len(bodies)} surfaces "
            f"do ({' or '.join(_LABELS.values())})"
        )
    return labels


def table_metrics(
    bodies: Bodies | LabelledMeshes, task: Task = nullcontext
) -> dict[str, Representation]:
    """Return the metrics of retrieval tables by name."""
    if not _is_registered(bodies):
        raise ArgumentTypeError(
            "bodies must be registered surfaces, with points and a template, to be compared by "
            f"metrics; found {type(bodies).__name__}"
        )
    space = AlignedSurfaces(bodies.template, equip=False)
    metrics: dict[str, Representation] = {
        SHAPE_METRIC: ElasticMetric(space, a=1.0, lam=1e-4, c=0.0),
        POSE_METRIC: ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
        "area metric": AreaMetric(space),
    }
    with suppress(ArgumentError):  # of surfaces that are not human bodies
        metrics["person metric"] = person_metric(space, task)
    return metrics | {
        "SRNF": SRNFMetric(space),
        "rotation metric": RotationMetric(space),
        "general elastic metric (1, 1, 1)": GeneralElasticMetric(space, a=1.0, b=1.0, c=1.0),
    }


def person_metric(space: SurfaceSpace, task: Task = nullcontext) -> PersonMetric:
    """Return the metric of people, by a map to the open model if the triangles are others."""
    try:
        return PersonMetric(space)
    except ArgumentError:
        # Most tables need no registration, which takes a while to import.
        from riemhuman.topologies import TopologyMap

        with task("Registering the template to the open model"):
            topology = TopologyMap.fit(space.template)
        return PersonMetric(space, topology)


def representations(bodies: Bodies | LabelledMeshes) -> dict[str, Representation]:
    """Return all representations that apply to a data set, in the order of tables.

    The model of the open bodies also generated them, so its fits recover the vectors almost
    exactly. This is why model vectors rank first on these bodies.

    Parameters
    ----------
    bodies : Bodies or LabelledMeshes
        Metrics and learned codes need registered surfaces, and model vectors a data set with a
        model that has the method ``fit``; the other descriptors apply to all meshes.

    Examples
    --------
    >>> list(rh.retrieval.representations(rh.datasets.load_open_bodies("coarse")))[2]
    'area metric'
    """
    descriptors: dict[str, Representation] = {
        "APT": AreaProjectionTransform(),
        "ShapeDNA": ShapeDNA(),
        "HKS": HeatKernelSignature(),
        "WKS": WaveKernelSignature(),
    }
    if not _is_registered(bodies):
        return descriptors | of_extensions(bodies)
    chosen = table_metrics(bodies)
    space, straight = AlignedSurfaces(bodies.template, equip=False), LinearPath(n_nodes=2)
    # Thousands of geodesics would take hours; norms of differences, halfway, take minutes.
    chosen[SOBOLEV] = SobolevMetric(space, d1=1.0, geodesic_solver=straight)
    # Vertices of a template whose triangles are not oriented consistently have no normals.
    with suppress(ArgumentError):
        chosen[GAUGE_INVARIANT] = GaugeInvariantMetric(SRNFMetric(space), geodesic_solver=straight)
    model = getattr(bodies, "model", None)
    if model is not None and hasattr(model, "fit"):
        chosen["model shape vector"] = ModelShapeVectors(model)
        chosen["model pose vector"] = ModelPoseVectors(model)
        chosen["model pose, by rotation"] = ModelPoseVectors(model, "rotation", root=False)
    chosen |= shipped_descriptors(bodies.template) | descriptors
    # The mean over vertices is common in retrieval, but it uses the registration.
    chosen["WKS, mean over vertices"] = WaveKernelSignature(pooling="vertex mean")
    return chosen | of_extensions(bodies)


def _is_registered(bodies: Surfaces) -> TypeGuard[Bodies]:
    return hasattr(bodies, "points") and hasattr(bodies, "template")


def of_extensions(bodies: Bodies | LabelledMeshes) -> dict[str, Representation]:
    """Return the representations that other packages register, see `riemhuman.extensions`."""
    metrics: dict[str, Representation] = {}
    if _is_registered(bodies):
        space = AlignedSurfaces(bodies.template, equip=False)
        metrics = {name: metric(space) for name, metric in extensions("metrics").items()}
    return metrics | {name: make() for name, make in extensions("descriptors").items()}


@dataclass(frozen=True, eq=False)
class _CodeDescriptor(Descriptor):
    """One of the two codes that a network computes for registered bodies, by its name."""

    codes: ShapePoseCodes | IntrinsicExtrinsicCodes
    which: str

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        vector: Array = self._of(np.asarray(vertices)[None])[0]
        return vector

    def describe_all(self, bodies: Surfaces, n_jobs: int | None = None) -> Array:
        if not _is_registered(bodies):
            raise ArgumentTypeError("codes of networks need registered bodies")
        return self._of(bodies.points)

    def _of(self, points: Array) -> Array:
        parts = self.codes.split(self.codes.transform(points))
        return parts[self.codes.code_names.index(self.which)]


def shipped_descriptors(template: Template) -> dict[str, Descriptor]:
    """Return the codes of the networks that ship, for tables."""
    networks: list[ShapePoseCodes | IntrinsicExtrinsicCodes]
    networks = [IntrinsicExtrinsicCodes.load_pretrained(template)]
    with suppress(ArgumentError):  # of another triangulation
        networks.append(ShapePoseCodes.load_pretrained(template))
    return {
        f"{which} code{LEARNED}": _CodeDescriptor(codes, which)
        for codes in networks
        for which in codes.code_names
    }


def _learned_distances(bodies: Bodies | LabelledMeshes) -> dict[str, Array]:
    """Return distances learned from labels, by task, for people they were not fitted to."""
    subject, pose = getattr(bodies, "subject", None), getattr(bodies, "pose", None)
    if not _is_registered(bodies) or subject is None or len(np.unique(subject)) < 5:
        return {}
    space = AlignedSurfaces(bodies.template, equip=False)
    metrics = {
        "shape": (AreaMetric(space), subject),
        "pose": (RotationMetric(space), pose),
    }
    return {
        task: LearnedMetric(metric).held_out_distances(bodies.points, labels, subject)
        for task, (metric, labels) in metrics.items()
        if labels is not None and 1 < len(np.unique(labels)) < len(labels)
    }


def described_together(
    representations: Mapping[str, Representation],
    bodies: Bodies | LabelledMeshes,
    *,
    progress: bool = False,
) -> dict[str, Described]:
    """Compute the vectors of descriptors that share a costly step, such as spectra."""
    kinds: dict[Together, dict[str, Representation]] = {}
    for name, representation in representations.items():
        if hasattr(representation, "describe_together"):
            kinds.setdefault(representation.describe_together, {})[name] = representation
    described: dict[str, Described] = {}
    for together, sharing in kinds.items():
        if len(sharing) < 2:
            continue
        try:
            vectors, seconds = together(list(sharing.values()), bodies, progress=progress)
        except RiemhumanError:
            continue
        for name, rows, duration in zip(sharing, vectors, seconds, strict=True):
            described[name] = rows, duration
    return described


def timed_distances(
    representation: Representation,
    bodies: Bodies | LabelledMeshes,
    described: Described | None = None,
) -> tuple[Array, float, float]:
    """Return all distances within a set of bodies, the seconds for a body, and for a pair."""
    n_bodies = len(bodies)
    n_pairs = n_bodies * (n_bodies - 1) // 2
    if hasattr(representation, "dist_pairwise"):
        if not hasattr(bodies, "points"):
            raise ArgumentTypeError("a metric needs surfaces registered to a template")
        # Compile the loops first: that is not part of the time of a distance.
        representation.dist_pairwise(bodies.points[:2])
        start = time.perf_counter()
        distances = representation.dist_pairwise(bodies.points, n_jobs=-1)
        return distances, 0.0, (time.perf_counter() - start) / n_pairs

    if described is None:
        start = time.perf_counter()
        if hasattr(representation, "describe_all"):
            vectors = representation.describe_all(bodies, n_jobs=-1)
        else:
            count, mesh = meshes_of(bodies)
            vectors = np.stack([representation.describe(*mesh(i)) for i in range(count)])
        described = vectors, time.perf_counter() - start
    vectors, seconds = described
    start = time.perf_counter()
    distances = representation.distances(vectors)
    return distances, seconds / n_bodies, (time.perf_counter() - start) / n_pairs


@checked(records=each(instance(BenchmarkRecord), "a list of BenchmarkRecord"))
def format_benchmark(records: Sequence[BenchmarkRecord]) -> str:
    """Format a benchmark as text, one table per task with an asterisk at the best of each column.

    Parameters
    ----------
    records : sequence of BenchmarkRecord
        Records of `riemhuman.retrieval.benchmark`.

    Examples
    --------
    >>> failed = rh.retrieval.BenchmarkRecord("height", "shape", None, 0.0, 0.0, "no head")
    >>> rh.retrieval.format_benchmark([failed]).splitlines()[1]
    'height      failed: no head'
    """
    tasks = dict.fromkeys(record.task for record in records)
    tables = []
    for task in tasks:
        tables.append(_task_table(task, [record for record in records if record.task == task]))
    columns = (
        "Per cent, each body against all others: NN nearest neighbour, FT and ST first and "
        "second tier,\nmAP mean average precision; an asterisk marks the best of a column."
    )
    notes = [columns]
    if any(record.representation.endswith(_STRAIGHT) for record in records):
        notes.append(
            "Metrics called straight have no closed-form distance: their rows compare bodies by "
            "the\n"
            "norm of their difference, halfway between them."
        )
    if any(record.representation.endswith(LEARNED) for record in records):
        notes.append(
            "Codes come from networks following GDVAE and Zhou et al., trained on open bodies "
            "of other\n"
            "people in other poses."
        )
    return "\n\n".join([*tables, *notes])


def _task_table(task: str, records: list[BenchmarkRecord]) -> str:
    title = TITLES[task]
    width = max(len(title), *(len(record.representation) for record in records))
    scored = [values for values in map(_rounded_scores, records) if values]
    best = {column: max((values[column] for values in scored), default=0.0) for column in _COLUMNS}
    header = "".join(f"{column:>6} " for column in _COLUMNS)
    lines = [f"{title:<{width}}  {header} ms a body  ms a pair"]
    for record in records:
        values = _rounded_scores(record)
        if not values:
            lines.append(f"{record.representation:<{width}}  failed: {record.problem}")
            continue
        cells = ""
        for column, value in values.items():
            mark = "*" if value == best[column] else " "
            cells += f"{value:6.1f}{mark}"
        body = f"{1e3 * record.seconds_per_body:9.1f}" if record.seconds_per_body else f"{'-':>9}"
        pair = f"{1e3 * record.seconds_per_pair:9.4f}"
        lines.append(f"{record.representation:<{width}}  {cells} {body}  {pair}")
    return "\n".join(lines)


def _rounded_scores(record: BenchmarkRecord) -> dict[str, float]:
    """Return the scores of a record as tables show them; none if it failed."""
    if record.scores is None:
        return {}
    return {
        "NN": round(record.scores.nn, 1),
        "FT": round(record.scores.first_tier, 1),
        "ST": round(record.scores.second_tier, 1),
        "mAP": round(record.scores.mean_average_precision, 1),
    }
