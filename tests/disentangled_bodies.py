"""One person's shape in another's pose, measured part by part on the natural bodies."""

from dataclasses import dataclass

import numpy as np

from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.solvers import Disentangling
from riemhuman.surfaces.distortion import edge_lengths
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


def distance(surface, other):
    """Return the mean distance of vertices in millimetres, rigid motions aside."""
    return 1000.0 * np.linalg.norm(procrustes(surface, other) - other, axis=-1).mean()


@dataclass(frozen=True)
class Measured:
    """What was found for a pair of people; distances in millimetres.

    Attributes
    ----------
    nearer : dict of bool
        Whether a part is nearer to A's, in A's own performance of the pose, than to B's.
    edges : float
        Mean relative change of the lengths of A's edges.
    segments : float
        Mean distance, bone by bone, from A disentangled toward A's own performance.
    whole : float
        The same of whole bodies: B holds the pose otherwise than A.
    truth : float
        Mean distance of whole bodies from A's own performance.
    """

    nearer: dict
    edges: float
    segments: float
    whole: float
    truth: float


class Disentangled:
    """Measures a solver on natural bodies.

    Parameters
    ----------
    bodies : Bodies
        Ten people in ten poses.
    solver : Disentangling
        The solver.
    """

    def __init__(self, bodies, solver=None):
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

    def measure(self, a, p, b, q):
        """Measure person a, known in pose p, in the pose q of person b."""
        shape, pose, truth = self.points[a, p], self.points[b, q], self.points[a, q]
        found, own = self.surface(shape, pose), self.surface(shape, truth)
        lengths, kept = (edge_lengths(f, self.edges) for f in (found, shape))
        return Measured(
            {
                part: distance(found[at], truth[at]) < distance(found[at], pose[at])
                for part, at in self.parts.items()
            },
            float(np.mean(np.abs(lengths / kept - 1.0))),
            np.average(
                [distance(found[bone], own[bone]) for bone in self.bones],
                weights=[len(bone) for bone in self.bones],
            ),
            distance(found, own),
            distance(found, truth),
        )
