"""One person's shape in another's pose, measured part by part on the natural bodies."""

from copy import deepcopy
from functools import cache
from types import SimpleNamespace
from unittest import mock

import numpy as np

from riemhuman.datasets import open_bodies
from riemhuman.datasets.open_bodies import natural_surfaces
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import Disentangling
from riemhuman.surfaces.measures import edge_lengths
from riemhuman.surfaces.procrustes import procrustes

# Segments with fewer vertices say little.
_FEWEST = 8

PARTS = {"head": ("head",), "torso": ("lower_spine", "middle_spine", "upper_spine", "chest")}


def random_pairs(n_pairs, seed=0):
    """Return pairs of people and of poses, (a, p, b, q): a in pose p, b in pose q."""
    rng = np.random.default_rng(seed)
    pairs = (
        (*rng.choice(10, 2, replace=False), *rng.choice(10, 2, replace=False))
        for _ in range(n_pairs)
    )
    return [(a, p, b, q) for a, b, p, q in pairs]


@cache
def natural_people(resolution, people=None):
    """Return natural bodies, and a function that performs other poses with their people's bodies.

    It takes the number of a person and pose vectors to a surface with the person's own detail and
    flesh, but for the noise that every surface has of its own.
    """
    drawn = []

    def recording(model, joints, betas, poses, rng):
        drawn.append((model, joints, betas, deepcopy(rng)))
        return natural_surfaces(model, joints, betas, poses, rng)

    with mock.patch.object(open_bodies, "natural_surfaces", recording):
        bodies = open_bodies.load_open_bodies(resolution, variant="natural", people=people)

    def perform(person, pose):
        model, joints, betas, rng = drawn[person]
        return natural_surfaces(model, joints, betas, pose[None], deepcopy(rng))[0]

    return bodies, perform


def distance(surface, other):
    """Return the mean distance of vertices in millimetres, rigid motions aside."""
    return 1000.0 * np.linalg.norm(procrustes(surface, other) - other, axis=-1).mean()


class Disentangled:
    """Measures a solver on what `natural_people` returns, ten people in ten poses."""

    def __init__(self, bodies, perform, solver=None):
        self.perform = perform
        self.poses = bodies.pose_vectors.reshape(10, 10, -1, 3)
        self.points = bodies.points.reshape(10, 10, -1, 3)
        self.edges = bodies.template.edges
        self.solver = Disentangling() if solver is None else solver
        space = AlignedSurfaces(bodies.template, equip=False)
        self.metrics = ElasticMetric(space, 1.0, 1.0, 0.0), ElasticMetric(space, 0.0, 0.0, 1.0)
        owners = bodies.model.weights.argmax(axis=1)
        names = bodies.model.joint_names
        self.parts = {
            part: np.isin(owners, [names.index(name) for name in joints])
            for part, joints in PARTS.items()
        }
        bones = (np.flatnonzero(owners == joint) for joint in range(len(names)))
        self.bones = [bone for bone in bones if len(bone) >= _FEWEST]

    def surface(self, shape, pose):
        """Return one body in the pose of another."""
        return self.solver.solve(*self.metrics, shape, pose).surface

    def similar_pairs(self, pairs):
        """Return pairs in which b is the person whose torso is most like that of a."""
        torso, similar = self.parts["torso"], []
        for a, p, _, q in pairs:
            torso_of_a = self.points[a, q][torso]
            gaps = [
                np.inf if k == a else distance(self.points[k, q][torso], torso_of_a)
                for k in range(10)
            ]
            similar.append((a, p, int(np.argmin(gaps)), q))
        return similar

    def measure(self, a, p, b, q):
        """Measure person a, known in pose p, in the pose q of person b; millimetres."""
        shape, pose, truth = self.points[a, p], self.points[b, q], self.points[a, q]
        performed = self.perform(a, self.poses[b, q])
        surface, reference = self.surface(shape, pose), self.surface(shape, truth)
        lengths, kept = (edge_lengths(f, self.edges) for f in (surface, shape))
        torso, sizes = self.parts["torso"], [len(bone) for bone in self.bones]
        gaps = [distance(surface[bone], reference[bone]) for bone in self.bones]
        return SimpleNamespace(
            # Whether a part is nearer to A's, in A's own performance of the pose, than to B's.
            nearer={
                part: distance(surface[at], truth[at]) < distance(surface[at], pose[at])
                for part, at in self.parts.items()
            },
            # From A's own torso, as a share of the distance from B's.
            torso=distance(surface[torso], truth[torso]) / distance(surface[torso], pose[torso]),
            edges=float(np.mean(np.abs(lengths / kept - 1.0))),
            # From A disentangled toward A's own performance, bone by bone and as a whole.
            segments=np.average(gaps, weights=sizes),
            whole=distance(surface, reference),
            # From A's own performance, and from A's body in B's performance, which is asked for.
            truth=distance(surface, truth),
            performed=distance(surface, performed),
            nearer_input=min(distance(shape, performed), distance(pose, performed)),
        )
