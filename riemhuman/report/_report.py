"""What the sections of the report share: the bodies, distances, a basis, and chosen bodies."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.arrays import Array, Booleans, Integers, JSONValue
from riemhuman.datasets import load_open_model, load_open_motions
from riemhuman.errors import RiemhumanError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.plots.figures import FIGURE_DPI
from riemhuman.report._page import Output
from riemhuman.report._storage import Computed, ResultStore, Step
from riemhuman.retrieval.benchmarks import (
    POSE_METRIC,
    SHAPE_METRIC,
    Described,
    Representation,
    described_together,
    timed_distances,
)
from riemhuman.solvers import BasisPath
from riemhuman.surfaces import DeformationBasis

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies

Pair = tuple[int, int]
Weights = tuple[float, float, float]

# Weights (a, λ, c) of the paper's experiments.
POSE_WEIGHTS: Weights = (0.0, 0.0, 1.0)
PATH_WEIGHTS: Weights = (1.0, 1.0, 0.0)
SAME_PERSON = "one person, two poses"
SAME_POSE = "two people, one pose"
TWO_BODIES = "the two bodies that differ most"  # of those that share neither


@dataclass(frozen=True)
class Plan:
    """Sizes of the experiments, values of λ and c of the sweep with a = 1, tolerance and seed.

    Of a person, some poses are measured; figures have some dots an inch.
    """

    n_nodes: int = 11
    n_components: int = 100
    sequences: tuple[str, ...] | None = None  # motions of the basis
    lams: tuple[float, ...] = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    weights: tuple[float, ...] = (0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0)
    n_averaged: int = 5
    most_poses: int = 3
    dots_an_inch: int = FIGURE_DPI
    tolerance: float = 1e-5
    seed: int = 0


QUICK = Plan(
    n_nodes=7,
    n_components=40,
    sequences=("punching", "knees"),
    lams=(1e-4, 1e-2, 1.0),
    weights=(0.0, 1e-4, 1e-2, 1.0),
    most_poses=2,
    dots_an_inch=100,
    tolerance=1e-4,
)


def readable(name: str) -> str:
    """Return the name of a class as written in running text: "T-like" for "t_like"."""
    letter, _, rest = name.partition("_")
    if letter in ("a", "t") and rest in ("like", "pose"):
        return f"{letter.upper()}-{rest}"
    return name.replace("_", " ")


def name_of(bodies: Bodies, index: int) -> str:
    subject = readable(bodies.subject_names[bodies.subject[index]])
    pose = readable(bodies.pose_names[bodies.pose[index]])
    return f"{subject}, {pose}" if pose else subject


def choose_pair(distances: Array, suits: Booleans, share: float) -> Pair | None:
    """Return the suitable pair at a share of the order by distance; 1 is the farthest."""
    first, second = np.nonzero(np.triu(suits, 1))
    if not len(first):
        return None
    order = np.argsort(distances[first, second], kind="stable")
    number = order[round(share * (len(order) - 1))]
    return int(first[number]), int(second[number])


def group_within(same: Integers, labels: Integers, size: int) -> Integers:
    """Return at most `size` items of the class with the most other classes, one of each."""
    groups = []
    for label in dict.fromkeys(same.tolist()):
        items = np.flatnonzero(same == label)
        _, first = np.unique(labels[items], return_index=True)
        groups.append(items[np.sort(first)])
    group = max(groups, key=len)
    places = np.linspace(0, len(group) - 1, min(size, len(group))).round().astype(np.int64)
    return group[places]


@dataclass(frozen=True)
class Task:
    """A retrieval task: its question, the paper's metric for it, and the classes of the bodies."""

    name: str
    kind: str
    question: str
    metric: str
    labels: Integers
    names: tuple[str, ...]

    @property
    def n_classes(self) -> int:
        return len(np.unique(self.labels))

    @property
    def is_named_by_item(self) -> bool:
        """Whether every body is alone in its class."""
        return self.n_classes == len(self.labels)

    @property
    def is_retrieval(self) -> bool:
        """Whether bodies can be confused: two classes or more have two bodies or more."""
        _, counts = np.unique(self.labels, return_counts=True)
        return bool(np.count_nonzero(counts > 1) > 1)


@dataclass(frozen=True, eq=False)
class Report:
    """What sections are made from; whatever is computed is kept in the store."""

    bodies: Bodies
    plan: Plan
    store: ResultStore
    output: Output
    representations: Mapping[str, JSONValue]
    given_basis: DeformationBasis | None = None
    units: str = "cm"

    @property
    def has_poses(self) -> bool:
        """Whether the poses of bodies are known; if not, they have no names."""
        return any(self.bodies.pose_names)

    def metric(self, weights: Weights) -> ElasticMetric:
        a, lam, c = weights
        space = AlignedSurfaces(self.bodies.template, equip=False)
        return ElasticMetric(space, a=a, lam=lam, c=c)

    @property
    def tasks(self) -> list[Task]:
        """Return both tasks, also without bodies that share a class."""
        bodies = self.bodies
        return [
            Task(
                "shape",
                "person",
                "Who is it?",
                SHAPE_METRIC,
                bodies.subject,
                bodies.subject_names,
            ),
            Task(
                "pose",
                "pose",
                "How do they stand?",
                POSE_METRIC,
                bodies.pose,
                bodies.pose_names,
            ),
        ]

    @property
    def has_retrieval(self) -> bool:
        """Whether people or poses can be confused with others."""
        return any(task.is_retrieval for task in self.tasks)

    @cached_property
    def all_distances(self) -> dict[str, Step]:
        """All distances and their times; a step holds the error of a representation."""
        if len(self.bodies) < 2:
            return {}
        return {
            name: self._distance_step(name, representation)
            for name, representation in self.representations.items()
        }

    def _distance_step(self, name: str, representation: Representation) -> Step:
        def compute() -> Computed:
            vectors = None
            if hasattr(representation, "describe_together"):
                vectors = self._described.get(name)
            try:
                matrix, per_body, per_pair = timed_distances(representation, self.bodies, vectors)
            except RiemhumanError as error:
                return {}, {"problem": f"{type(error).__name__}: {error}"}
            record = {"seconds_per_body": per_body, "seconds_per_pair": per_pair}
            return {"distances": np.asarray(matrix)}, record

        return self.store.step(
            "distances-" + "-".join(re.findall("[a-z0-9]+", name.lower())),
            compute,
            f"Distances, {name}",
            representation=name,
            kind=f"{type(representation).__module__}.{type(representation).__qualname__}",
        )

    @cached_property
    def _described(self) -> dict[str, Described]:
        """Vectors of bodies; needed only if the store lacks distances, since spectra take long."""
        return described_together(self.representations, self.bodies)

    @cached_property
    def distances(self) -> dict[str, Step]:
        """The steps of representations that have distances."""
        return {
            name: step for name, step in self.all_distances.items() if "problem" not in step.record
        }

    def matrix(self, name: str) -> Array:
        return self.distances[name].arrays["distances"]

    def pair(self, metric: str, share: float, *, person: bool, pose: bool) -> Pair | None:
        """Return bodies that do or do not share the person and the pose, see `choose_pair`."""
        if len(self.bodies) < 2:
            return None
        same_person = np.equal.outer(self.bodies.subject, self.bodies.subject)
        same_pose = np.equal.outer(self.bodies.pose, self.bodies.pose)
        suits = (same_person == person) & (same_pose == pose)
        return choose_pair(self.matrix(metric), suits, share)

    @cached_property
    def pairs(self) -> dict[str, Pair]:
        """A person in two poses and two people in one pose, or else any two bodies."""
        pairs = {}
        same_person = self.pair(POSE_METRIC, 0.5, person=True, pose=False)
        if same_person is not None:
            pairs[SAME_PERSON] = same_person
        same_pose = self.pair(SHAPE_METRIC, 1.0, person=False, pose=True)
        if same_pose is not None:
            pairs[SAME_POSE] = same_pose
        if pairs:
            return pairs
        two_bodies = self.pair(SHAPE_METRIC, 1.0, person=False, pose=False)
        return {} if two_bodies is None else {TWO_BODIES: two_bodies}

    @cached_property
    def basis(self) -> tuple[DeformationBasis, str]:
        """The basis of paths and a phrase on what it is made of."""
        if self.given_basis is not None:
            return self.given_basis, f"{len(self.given_basis)} given deformations"
        template, plan = self.bodies.template, self.plan
        origin = "mesh harmonics"
        resolution_of_motions = ""  # of the open bodies, which have motions
        for resolution in ("coarse", "full"):
            if np.array_equal(load_open_model(resolution).faces, template.faces):
                origin = "principal components of the open motions"
                resolution_of_motions = resolution

        def compute() -> Computed:
            if resolution_of_motions:
                motions = load_open_motions(resolution_of_motions, sequences=plan.sequences)
                basis = DeformationBasis.from_motions(motions, plan.n_components, step=10)
            else:
                basis = DeformationBasis.from_laplacian(template, plan.n_components)
            return {"vectors": basis.vectors}, {}

        inputs = {"sequences": plan.sequences, "n_components": plan.n_components}
        step = self.store.step("basis", compute, "Basis of deformations", **inputs)
        basis = DeformationBasis(step.arrays["vectors"])
        return basis, f"{len(basis)} {origin}"

    def path_solver(self) -> BasisPath:
        return BasisPath(self.basis[0], self.plan.n_nodes, tolerance=self.plan.tolerance)

    def path_step(
        self, name: str, compute: Callable[[], Computed], title: str, **inputs: object
    ) -> Step:
        """Return a result that also depends on the basis and the plan of paths."""
        plan = {"n_nodes": self.plan.n_nodes, "tolerance": self.plan.tolerance}
        vectors = np.asarray(self.basis[0].vectors)
        return self.store.step(name, compute, title, basis=vectors, **plan, **inputs)
