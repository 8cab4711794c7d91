"""Representations of motions, compared on the open motions after random re-timing."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator
from riemhuman.datasets.open_motions import OpenMotion, load_open_motions
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.motions.dynamic_time_warping import DynamicTimeWarping
from riemhuman.motions.gram_hankel import GramHankel
from riemhuman.motions.joint_angles import JointAngles
from riemhuman.motions.motion_space import MotionSpace
from riemhuman.motions.rate_invariant_metric import RateInvariantMetric
from riemhuman.motions.velocity_time_warping import VelocityTimeWarping
from riemhuman.retrieval.tables import TableRow, retrieval_table

_FEWEST, _MOST = 24, 60
# Speeds change by up to a factor of two either way, at five times in between.
_SPEEDS, _FASTEST = 5, 2.0
_COMPONENTS = 200


def random_places(n_frames: int, n_times: int, rng: Rng = None) -> ndarray:
    """Return frame positions at a random, changing speed.

    Parameters
    ----------
    n_frames : int
        Number of frames of the motion.
    n_times : int
        Number of times.
    rng : int or numpy.random.Generator, optional
        Seed, or the generator to draw from; by default every call draws anew.

    Returns
    -------
    array, shape (n_times,)
        Increasing from 0 to ``n_frames - 1``.
    """
    drawn = generator(rng).uniform(-np.log(_FASTEST), np.log(_FASTEST), _SPEEDS)
    speeds = np.exp(np.interp(np.linspace(0, _SPEEDS - 1, n_times - 1), range(_SPEEDS), drawn))
    places = np.concatenate([[0.0], np.cumsum(speeds)])
    return places * ((n_frames - 1) / places[-1])


def retimed(motion: OpenMotion, rng: np.random.Generator) -> ndarray:
    """Return the frames of a motion nearest to random times, 24 to 60 of them.

    Parameters
    ----------
    motion : OpenMotion
        The motion.
    rng : numpy.random.Generator
        Generator to draw from.

    Returns
    -------
    array, shape (n_times, V, 3)
    """
    n_times = int(rng.integers(_FEWEST, _MOST + 1))
    frames = random_places(len(motion), n_times, rng).round().astype(int)
    poses, places = motion.pose_vectors[frames], motion.translations[frames]
    return np.asarray(motion.model(motion.betas, poses, places))


def compare_representations(
    seed: int = 0,
    *,
    angles: bool = False,
    resolution: str = "coarse",
    task: Callable[[str], AbstractContextManager[None]] = lambda name: nullcontext(),
) -> list[TableRow]:
    """Return how well each representation finds the same motion of other people.

    Parameters
    ----------
    seed : int
        Seed of the speeds at which the open motions are re-timed.
    angles : bool
        Whether to fit the body model to all frames, which takes minutes.
    resolution : {"full", "coarse"}
        Resolution of the bodies.
    task : callable
        Maps the name of a task to the context manager in which the task runs.

    Returns
    -------
    list of TableRow
    """
    rng = np.random.default_rng(seed)
    with task("Motions"):
        open_motions = load_open_motions(resolution)
        motions = [retimed(motion, rng) for motion in open_motions]
    labels = np.array([motion.sequence for motion in open_motions])
    model = open_motions[0].model
    space = AlignedSurfaces(model.template, equip=False)
    pose = ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    space.metric = pose
    shared: dict[str, Any] = {"n_components": _COMPONENTS, "n_jobs": -1}
    measures: dict[str, Callable[[], ndarray]] = {
        "pose metric, frame by frame": lambda: _frame_by_frame(pose, motions),
        "Hankel matrices of currents": lambda: GramHankel(space).dist_pairwise(motions),
        "time warping, SRNF": lambda: DynamicTimeWarping(SRNFMetric(space), **shared).dist_pairwise(
            motions
        ),
        "time warping, pose metric": lambda: DynamicTimeWarping(pose, **shared).dist_pairwise(
            motions
        ),
        "time warping, changes of pose": lambda: DynamicTimeWarping(
            pose, centered=True, **shared
        ).dist_pairwise(motions),
        "time warping, velocities": lambda: VelocityTimeWarping(pose, **shared).dist_pairwise(
            motions
        ),
        "rate-invariant, pose metric": lambda: RateInvariantMetric(
            MotionSpace(space), n_components=_COMPONENTS
        ).dist_pairwise(motions, -1),
    }
    if angles:
        joints = JointAngles(model)
        measures["time warping, fitted joint angles"] = lambda: DynamicTimeWarping(
            joints.metric, n_jobs=-1
        ).dist_pairwise([joints.rotations(motion) for motion in motions])
    distances = {}
    for name, measure in measures.items():
        with task(name):
            distances[name] = measure()
    return retrieval_table(distances, labels)


def _frame_by_frame(metric: Any, motions: list[ndarray]) -> ndarray:
    """Return L² distances at 24 equally spaced frames each, whatever the speed."""
    frames = [m[np.linspace(0, len(m) - 1, _FEWEST).round().astype(int)] for m in motions]
    squared = np.zeros((len(motions), len(motions)))
    for k in range(_FEWEST):
        squared += metric.dist_pairwise(np.stack([m[k] for m in frames]), n_jobs=-1) ** 2
    return np.sqrt(squared / _FEWEST)
