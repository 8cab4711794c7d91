"""Figures of motions: how well they are found when re-timed or noisy, and how fast they are posed.

Run with `pytest tests/benchmarks/test_motions.py --benchmark-enable -s`.
"""

import itertools
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from performances import clocked

import riemhuman as rh
from riemhuman.datasets import pose_vectors
from riemhuman.motions.motion_representations import random_places, retime_at_random

COMPONENTS = 200


@cache
def open_motions():
    return rh.datasets.load_open_motions("coarse")


@cache
def space():
    template = open_motions()[0].template
    return rh.AlignedSurfaces(template).equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)


@cache
def performances(seed=0):
    """Return the 140 motions, each re-timed at random, in 24 to 60 frames."""
    rng = np.random.default_rng(seed)
    return [retime_at_random(motion, rng) for motion in open_motions()]


def labels():
    return np.array([motion.sequence for motion in open_motions()])


def warping(**options):
    return rh.motions.DynamicTimeWarping(space().metric, n_jobs=2, **options)


def velocities(**options):
    return rh.motions.VelocityTimeWarping(space().metric, n_jobs=2, **options)


def rate_invariant():
    motions = rh.motions.MotionSpace(space())
    return rh.motions.RateInvariantMetric(motions, n_components=COMPONENTS, n_jobs=2)


def timed_pairs(measure, motions):
    return clocked(lambda: measure.dist_pairwise(motions))


def at_places(motion, places):
    """Return an open motion between its frames too: its curves are known at all times."""
    rotations = motion.joint_rotations(places / motion.frames_per_second)
    return motion.model(motion.betas, pose_vectors(rotations, motion.model))


def shares_of_others(measure, motions, counts):
    """Return distances of whole motions to their samplings, in % of those to other people's.

    Samplings are at random speeds, with frames between those of the whole motions. The usual
    distance is the median over samplings and the whole motions of the next person.
    """
    rng = np.random.default_rng(29)
    within, others = [], []
    for motion, count in zip(motions, counts, strict=True):
        places = random_places(len(motion), count, rng)
        few = at_places(motion, places)
        warp = measure.warp(few, at_places(motion, np.arange(len(motion))))
        within.append((warp.dist, np.median(np.abs(warp(np.arange(count)) - places))))
        same = [m for m in motions if m.sequence == motion.sequence]
        person = [m.subject for m in same].index(motion.subject)
        others.append(measure.dist(few, same[(person + 1) % len(same)][:]))
    distances, errors = np.array(within).T
    return 100 * distances / np.median(others), errors


def own_samplings(frames):
    """Return how many frames each open motion is sampled in."""
    if frames is not None:
        return [frames] * len(open_motions())
    return np.random.default_rng(31).integers(24, 61, len(open_motions())).tolist()


@pytest.mark.parametrize(
    ("name", "frames"),
    [
        *itertools.product(["time warping, between frames", "velocities"], [None, 60, 40, 24]),
        ("rate-invariant", None),
    ],
)
def test_motions_and_their_own_samplings(name, frames):
    """Whole motions and their re-timings at random speeds, in 24 to 60 frames or so many.

    Settings were chosen on the first five people in alphabetical order; the others are the last.
    """
    measure = {
        "time warping, between frames": lambda: warping(between_frames=True),
        "velocities": velocities,
        "rate-invariant": lambda: rh.motions.RateInvariantMetric(rh.motions.MotionSpace(space())),
    }[name]()
    people = sorted({motion.subject for motion in open_motions()})
    unseen = np.array([motion.subject in people[5:] for motion in open_motions()])
    shares, errors = shares_of_others(measure, open_motions(), own_samplings(frames))
    print(
        f"\n{name}, {frames or '24 to 60'} frames: own re-timing at {np.median(shares):.2f} % of "
        f"another's, of unseen people {np.median(shares[unseen]):.2f} %; at most 2 % in "
        f"{np.sum(shares <= 2)} of {len(shares)} motions, at worst {max(shares):.0f} %; warps "
        f"{np.median(errors):.3f} frames off in the median, {max(errors):.2f} at most"
    )
    assert np.median(errors) <= 1.0
    if name == "velocities":
        assert np.median(shares) <= 2.0
        assert np.median(shares[unseen]) <= 2.0


def test_people_unlike_those_of_the_model():
    """Noise of 2 mm in every frame: which motion is it?"""
    rng = np.random.default_rng(2)
    some = [k for k in range(140) if k // 14 < 5]
    names = labels()[some]
    plain = [performances()[k] for k in some]
    noisy = [m + rng.normal(0.0, 2e-3, m.shape) for m in plain]
    for name, measure in (
        ("poses", warping(n_components=COMPONENTS)),
        ("changes", warping(n_components=COMPONENTS, centered=True)),
        ("velocities", velocities(n_components=COMPONENTS)),
        ("rate-invariant", rate_invariant()),
    ):
        scores = rh.retrieval.scores(timed_pairs(measure, noisy)[0], names)
        print(f"\nnoise of 2 mm, {name}: NN {scores.nn:.1f}, FT {scores.first_tier:.1f}")


@pytest.mark.parametrize("name", ["joints", "rotations", "pose", "shape"])
def test_which_movement_and_who(name):
    """Nearest neighbours of a descriptor: the movement of other people, and the person elsewhere.

    The open motions are of simulated people, ten in fourteen movements.
    """
    motions, template = open_motions(), open_motions()[0].template
    metric = {
        "joints": lambda: rh.motions.JointMetric(rh.AlignedSurfaces(template), motions[0].model),
        "rotations": lambda: rh.RotationMetric(rh.AlignedSurfaces(template)),
        "pose": lambda: space().metric,
        "shape": lambda: rh.ElasticMetric(rh.AlignedSurfaces(template)),
    }[name]()
    rows = rh.motions.MotionDescriptor(metric).fit_transform(motions)
    gaps = np.linalg.norm(rows[:, None] - rows[None], axis=-1)
    people = np.array([motion.subject for motion in motions])
    shares = []
    for sought, others in ((labels(), people), (people, labels())):
        nearest = np.where(others[:, None] == others, np.inf, gaps).argmin(axis=1)
        shares.append(100 * np.mean(sought[nearest] == sought))
    print(f"\n{name}: movement {shares[0]:.1f} %, person {shares[1]:.1f} %")
    assert max(shares) > 98.0


def test_long_recordings():
    """A minute at 120 Hz: frames a second of performing a recording, and of posing bodies."""
    folder = Path(__file__).parents[1] / "mocap" / "recordings"
    recording = rh.datasets.load_bvh(folder / "cmu_01_01.bvh")
    there_and_back = np.concatenate([np.arange(len(recording)), np.arange(len(recording))[::-1]])
    frames = np.resize(there_and_back, 7200)
    rotations, translations = recording.rotations[frames], recording.translations[frames]
    long = replace(recording, rotations=rotations, translations=translations)
    rh.datasets.retarget(recording)[:100]  # compiles what is posed
    motion = rh.datasets.retarget(long)
    poses, wall, processor = clocked(lambda: motion.pose_vectors)
    places, betas = motion.translations, motion.betas
    print(f"\nperforming: {7200 / wall:.0f} frames a second ({7200 / processor:.0f} a core)")
    for resolution, n_frames in (("coarse", 1200), ("full", 120)):
        model = rh.datasets.load_open_model(resolution)
        some = rh.datasets.ArrayMotion(
            ("", ""), 120.0, model, betas, poses[:n_frames], places[:n_frames]
        )
        bodies, wall, processor = clocked(lambda motion=some: motion[:], 3)
        print(
            f"posing, {resolution}: {n_frames / wall:.0f} frames a second "
            f"({n_frames / processor:.0f} a core)"
        )
        assert np.isfinite(bodies).all()
