"""One person's shape in another's pose, measured part by part on the natural bodies."""

from copy import deepcopy
from dataclasses import dataclass
from unittest import mock

import numpy as np

from riemhuman.datasets import load_open_bodies, open_bodies
from riemhuman.datasets._natural_bodies import natural_surfaces
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
        bodies = load_open_bodies(resolution, variant="natural", people=people)

    def perform(person, pose):
        model, joints, betas, rng = drawn[person]
        return natural_surfaces(model, joints, betas, pose[None], deepcopy(rng))[0]

    return bodies, perform


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
    torso : float
        Distance of the torso from A's own, as a share of that from B's.
    edges : float
        Mean relative change of the lengths of A's edges.
    segments : float
        Mean distance, bone by bone, from A disentangled toward A's own performance.
    whole : float
        The same of whole bodies: B holds the pose otherwise than A.
    truth : float
        Mean distance of whole bodies from A's own performance.
    performed : float
        The same from A's own body in B's performance, which is what is asked for.
    nearer_input : float
        That of the nearer of the two inputs.
    """

    nearer: dict
    torso: float
    edges: float
    segments: float
    whole: float
    truth: float
    performed: float
    nearer_input: float


class Disentangled:
    """Measures a solver on natural bodies.

    Parameters
    ----------
    bodies : Bodies
        Ten people in ten poses.
    perform : callable
        Gives a person's own body in any pose, see `natural_people`.
    solver : Disentangling
        The solver.
    """

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
            own = self.points[a, q][torso]
            gaps = [
                np.inf if k == a else distance(self.points[k, q][torso], own) for k in range(10)
            ]
            similar.append((a, p, int(np.argmin(gaps)), q))
        return similar

    def measure(self, a, p, b, q):
        """Measure person a, known in pose p, in the pose q of person b."""
        shape, pose, truth = self.points[a, p], self.points[b, q], self.points[a, q]
        performed = self.perform(a, self.poses[b, q])
        found, own = self.surface(shape, pose), self.surface(shape, truth)
        lengths, kept = (edge_lengths(f, self.edges) for f in (found, shape))
        torso = self.parts["torso"]
        return Measured(
            {
                part: distance(found[at], truth[at]) < distance(found[at], pose[at])
                for part, at in self.parts.items()
            },
            distance(found[torso], truth[torso]) / distance(found[torso], pose[torso]),
            float(np.mean(np.abs(lengths / kept - 1.0))),
            np.average(
                [distance(found[bone], own[bone]) for bone in self.bones],
                weights=[len(bone) for bone in self.bones],
            ),
            distance(found, own),
            distance(found, truth),
            distance(found, performed),
            min(distance(shape, performed), distance(pose, performed)),
        )
