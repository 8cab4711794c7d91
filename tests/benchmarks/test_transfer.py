"""Motion transfer and disentangling against people's own performances and the body model.

    pytest tests/benchmarks/test_transfer.py --benchmark-enable -s

prints, for people who perform poses themselves (plain and natural open bodies and, where the
variable RIEMHUMAN_FAUST names the folder of MPI FAUST, its registrations), how far transferred
surfaces are from the person's own performance of the pose: whole bodies, each moved rigidly onto
the performance, and patches of 10 cm, each moved by itself, which leaves out that people hold poses
differently. Beside each method is what it should beat: vertex offsets, the target as it is, and the
better of both inputs. `-k own_performances` prints this alone.

Against the body model, which made the bodies and so flatters, it prints, for the fourteen open
motions replayed between four pairs of people, the mean vertex error against the model's own motion,
of vertex offsets and of deformation gradients, nothing aligned; and for twenty seeded pairs of open
bodies the mean vertex errors of both inputs and of the body with the first one's shape and the
second one's pose, by the metrics and a basis of other people's motions, after the translation that
no metric sees; and for thirty seeded pairs of natural bodies whether head and torso are A's or B's,
how far the result is from A disentangled toward A's own performance of the pose, and from A's own
body in B's performance; and what `bone_smoothing` trades.
"""

import os

import numpy as np
import pytest
from disentangled_bodies import PARTS, Disentangled, natural_people, random_pairs
from performances import basis, bodies, timed
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from riemhuman.datasets import load_faust, load_open_bodies, load_open_motions
from riemhuman.datasets.open_motions import OpenMotion
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import Disentangling, MotionTransfer, ShapeTransfer
from riemhuman.surfaces.measures import edge_lengths
from riemhuman.surfaces.procrustes import procrustes

PEOPLE = [(0, 5), (1, 6), (3, 8), (6, 1)]
N_FRAMES = 9
OTHER_PEOPLE = 31  # on whom no setting was compared
FAUST = os.environ.get("RIEMHUMAN_FAUST")
PATCH_METRES = 0.1
FEWEST = 12  # vertices of a patch: fewer say little
N_PAIRS = 20
# Methods, and what each should beat.
COMPARED = {
    "MotionTransfer": "vertex offsets",
    "ShapeTransfer": "the target as it is",
    "Disentangling": "the better input",
}


class PerformedByAnother(OpenMotion):
    """The same performance by somebody else, who stands on their own feet."""

    def __init__(self, motion, betas):
        super().__init__(motion.subject, motion.sequence, motion.model, motion.frames_per_second)
        self._betas = betas

    @property
    def betas(self):
        """Shape coefficients of the other person."""
        return self._betas


def frames_of(motion):
    """Return some frames of a motion, evenly spaced."""
    numbers = np.linspace(0, len(motion) - 1, N_FRAMES).astype(int)
    return np.stack([motion[int(k)] for k in numbers])


def mean_distance(surfaces, others):
    """Return the mean distance of vertices in millimetres."""
    return 1000.0 * np.linalg.norm(surfaces - others, axis=-1).mean()


def centred(surface):
    """Return a surface with its centroid at the origin."""
    return surface - surface.mean(axis=-2, keepdims=True)


def performed_by_people(name):
    """Return a template, and ten people in ten poses that they hold themselves."""
    if name == "FAUST":
        data = load_faust(FAUST)
    else:
        data = load_open_bodies("full", variant=name, people=OTHER_PEOPLE)
    order = np.lexsort((data.pose, data.subject))
    return data.template, data.points[order].reshape(10, 10, -1, 3)


def patches_of(template):
    """Return the vertices of each patch, at most 10 cm across along the edges."""
    lengths = edge_lengths(template.vertices, template.edges)
    shape = (template.n_vertices, template.n_vertices)
    graph = coo_matrix((lengths, template.edges.T), shape).tocsr()
    distances, cells = np.full(template.n_vertices, np.inf), np.zeros(template.n_vertices, int)
    farthest, number = 0, 0
    while distances.max() > PATCH_METRES / 2:
        found = dijkstra(graph, directed=False, indices=farthest, limit=distances.max())
        nearer = found < distances
        cells[nearer], distances[nearer] = number, found[nearer]
        farthest, number = int(distances.argmax()), number + 1
    patches = (np.flatnonzero(cells == k) for k in range(number))
    return [patch for patch in patches if len(patch) >= FEWEST]


def whole_and_patches(surface, truth, patches):
    """Return mean distances of vertices, millimetres: rigid motions aside of all, and of each."""
    # A patch may be torn, which is an error to measure and not a unit to ask about: scale=None.
    gaps = [mean_distance(procrustes(surface[k], truth[k], scale=None), truth[k]) for k in patches]
    by_patches = np.average(gaps, weights=[len(patch) for patch in patches])
    return mean_distance(procrustes(surface, truth), truth), by_patches


@pytest.mark.parametrize("name", ["plain", "natural", "FAUST"])
def test_own_performances(benchmark, name):
    if name == "FAUST" and FAUST is None:
        pytest.skip("RIEMHUMAN_FAUST names no folder of MPI FAUST")
    template, people = performed_by_people(name)
    space = AlignedSurfaces(template, equip=False)
    metrics = ElasticMetric(space, 1.0, 1.0, 0.0), ElasticMetric(space, 0.0, 0.0, 1.0)
    patches = patches_of(template)

    def surfaces_of(a, p, b, q):
        """Return candidates for person a in pose q, from a in pose p and b in both."""
        body, before, after = people[a, p], people[b, p], people[b, q]
        return {
            "vertex offsets": body + after - before,
            "MotionTransfer": MotionTransfer().solve(space, [before, after], body)[1],
            "the target as it is": after,
            "ShapeTransfer": ShapeTransfer().solve(space, before, body, after),
            "the other input": body,
            "Disentangling": Disentangling().solve(*metrics, body, after).surface,
        }

    def errors_of_pairs():
        rows = []
        for a, p, b, q in random_pairs(N_PAIRS, OTHER_PEOPLE):
            surfaces = surfaces_of(a, p, b, q)
            truth = people[a, q]
            found = {n: whole_and_patches(f, truth, patches) for n, f in surfaces.items()}
            inputs = found["the target as it is"], found.pop("the other input")
            found["the better input"] = tuple(np.min(inputs, axis=0))
            rows.append(found)
        return rows

    rows = benchmark.pedantic(errors_of_pairs, rounds=1)
    means = {name: np.mean([row[name] for row in rows], axis=0) for name in rows[0]}
    print(f"\n{name}, {len(rows)} pairs, {len(patches)} patches       whole body, mm   patches, mm")
    for method, baseline in COMPARED.items():
        for label in (baseline, method):
            print(f"{label:>36} {means[label][0]:16.1f} {means[label][1]:13.1f}")
        whole, part = means[method] / means[baseline]
        print(f"{'ratio':>36} {whole:16.2f} {part:13.2f}")
    for method in ("MotionTransfer", "ShapeTransfer"):
        assert means[method][1] < means[COMPARED[method]][1]
    # By patches the better input is mostly the same person in the first pose: hard to beat.
    assert means["Disentangling"][0] < means["the better input"][0]


def test_motion_transfer(benchmark):
    motions = load_open_motions("full")
    space = AlignedSurfaces(motions[0].template, equip=False)
    n_sequences = len(motions) // 10
    rows = []
    for one, other in PEOPLE:
        for k in range(n_sequences):
            source = motions[n_sequences * one + k]
            true_frames = frames_of(PerformedByAnother(source, motions[n_sequences * other].betas))
            seen = frames_of(source)
            moved = MotionTransfer().solve(space, seen, true_frames[0])
            reshaped = ShapeTransfer().solve(space, seen[0], true_frames[0], seen[4])
            row = [
                mean_distance(true_frames[0] + seen - seen[0], true_frames),
                mean_distance(moved, true_frames),
                mean_distance(centred(seen[4] + true_frames[0] - seen[0]), centred(true_frames[4])),
                mean_distance(centred(reshaped), centred(true_frames[4])),
            ]
            rows.append(row)
    rows = np.array(rows)
    means = rows.mean(axis=0)
    ratios = rows[:, 1::2] / rows[:, ::2]
    print(
        f"\nmotion: {means[1] / means[0]:.2f} of the offsets' error in the mean, "
        f"{np.median(ratios[:, 0]):.2f} in the median, {ratios[:, 0].max():.2f} at most; "
        f"shape: {means[3] / means[2]:.2f}, {np.median(ratios[:, 1]):.2f}, "
        f"{ratios[:, 1].max():.2f}"
    )
    benchmark.pedantic(MotionTransfer().solve, (space, seen, true_frames[0]), rounds=1)
    # If nothing at rest stayed there, the mean would be 0.79.
    # Before the people of the open motions had builds of ANSUR II, it was 0.31: pairs differed by
    # up to 0.29 m in stature, now 0.12 m, so offsets erred by 17.9 mm, now by 10.7; the transfer
    # erred by 5.5 mm, now by 7.0.
    assert means[1] < 0.7 * means[0]
    assert means[3] < 0.5 * means[2]
    assert np.median(ratios[:, 0]) < 0.75


def test_disentangling(benchmark):
    data = bodies("full")
    space = AlignedSurfaces(data.template, equip=False)
    metrics = ElasticMetric(space, 1.0, 1.0, 0.0), ElasticMetric(space, 0.0, 0.0, 1.0)
    solver = Disentangling(basis("full"))
    rng = np.random.default_rng(0)
    rows, aligned_rows = [], []
    for _ in range(20):
        people = rng.choice(10, 2, replace=False)
        poses = rng.choice(10, 2, replace=False)
        one, other = (int(k) for k in 10 * people + poses)
        truth = data.model(data.betas[one], data.pose_vectors[other])
        arguments = (metrics[1], data.points[one], data.points[other])
        found, _ = timed(solver, metrics[0], *arguments, benchmark=benchmark)
        surfaces = (data.points[one], data.points[other], found.surface)
        row = [mean_distance(centred(surface), centred(truth)) for surface in surfaces]
        rows.append((min(row[:2]), row[2]))
        aligned = [mean_distance(procrustes(surface, truth), truth) for surface in surfaces]
        aligned_rows.append((min(aligned[:2]), aligned[2]))
    for name, pairs in (("translation", rows), ("rigid motion", aligned_rows)):
        better, ours = np.array(pairs).T
        ratios = ours / better
        print(
            f"\nafter a {name}: {ours.mean():.1f} mm, {ours.mean() / better.mean():.2f} of the "
            f"better input's {better.mean():.1f} mm in the mean, {np.median(ratios):.2f} in the "
            f"median, {ratios.max():.2f} at most",
            end="",
        )
    print()
    better, ours = np.array(rows).mean(axis=0)
    # If heat flowed across joints, it would be 0.57. Before the open bodies had builds of ANSUR II,
    # it was 0.31: the better input erred by 67.0 mm, now by 44.0, and the result by 20.6, now 19.8.
    assert ours < better / 2


def test_whose_body_it_is(benchmark):
    measured = Disentangled(*natural_people("full", OTHER_PEOPLE))
    pairs = random_pairs(30, OTHER_PEOPLE)
    found = benchmark.pedantic(lambda: [measured.measure(*pair) for pair in pairs], rounds=1)
    nearer = {part: np.mean([one.nearer[part] for one in found]) for part in PARTS}
    names = ("edges", "segments", "whole", "truth", "performed", "nearer_input")
    edges, segments, whole, truth, performed, nearer_input = (
        np.mean([getattr(one, name) for one in found]) for name in names
    )
    print(
        f"\n{len(pairs)} pairs: nearer to A than to B are "
        + " and ".join(f"{100 * share:.0f} % of the {part}s" for part, share in nearer.items())
        + f"; edges differ from A's by {100 * edges:.1f} % in the mean; from A disentangled toward "
        f"A's own performance, {segments:.1f} mm bone by bone and {whole:.1f} mm as a whole; from "
        f"that performance {truth:.1f} mm; from A's body in B's performance {performed:.1f} mm, "
        f"{performed / nearer_input:.2f} of the nearer input's {nearer_input:.1f} mm"
    )
    assert min(nearer.values()) >= 0.9
    assert edges < 0.06


def test_trade_off_of_heat_along_bones(benchmark):
    """Pairs of people of similar torsos, on whom `bone_smoothing` was not chosen."""
    people = natural_people("full", OTHER_PEOPLE)
    for bone_smoothing in (3.0, 10.0, 20.0):
        measured = Disentangled(*people, Disentangling(bone_smoothing=bone_smoothing))
        pairs = measured.similar_pairs(random_pairs(20, OTHER_PEOPLE))
        found = [measured.measure(*pair) for pair in pairs]
        torsos = 100 * np.mean([one.nearer["torso"] for one in found])
        torso, truth, performed = (
            np.mean([getattr(one, name) for one in found])
            for name in ("torso", "truth", "performed")
        )
        print(
            f"\nbone_smoothing {bone_smoothing:g}: {torsos:.0f} % of the torsos nearer to A's, "
            f"{torso:.2f} times as far from A's as from B's; {truth:.1f} mm from A's own "
            f"performance, {performed:.1f} mm from A's body in B's performance"
        )
    benchmark.pedantic(measured.measure, pairs[0], rounds=1)
    assert torso < 1.0
