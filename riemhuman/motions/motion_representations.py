"""A comparison of representations of motions on re-timed open motions."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.arrays import Array
from riemhuman.checks import Rng, generator
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.motions.joint_metric import JointMetric
from riemhuman.motions.motion_space import MotionSpace
from riemhuman.motions.rate_invariant_metric import RateInvariantMetric
from riemhuman.motions.time_warping import (
    DynamicTimeWarping,
    MotionDistance,
    VelocityTimeWarping,
)

if TYPE_CHECKING:
    from riemhuman.datasets.open_motions import OpenMotion
    from riemhuman.geometry import RiemannianMetric

_FEWEST_FRAMES = 24
_MOST_FRAMES = 60
# Speeds change by up to this factor either way, and are interpolated between so many values.
_FASTEST = 2.0
_SPEEDS = 5
_COMPONENTS = 200


def random_places(n_frames: int, n_times: int, rng: Rng = None) -> Array:
    """Return n_times positions from 0 to n_frames - 1 at a random, changing speed."""
    logs = generator(rng).uniform(-np.log(_FASTEST), np.log(_FASTEST), _SPEEDS)
    speeds = np.exp(np.interp(np.linspace(0, _SPEEDS - 1, n_times - 1), range(_SPEEDS), logs))
    places = np.concatenate([[0.0], np.cumsum(speeds)])
    scaled: Array = places * ((n_frames - 1) / places[-1])
    return scaled


def retime_at_random(motion: OpenMotion, rng: np.random.Generator) -> Array:
    """Return the frames of an open motion nearest to random times, 24 to 60 of them."""
    n_times = int(rng.integers(_FEWEST_FRAMES, _MOST_FRAMES + 1))
    frames = random_places(len(motion), n_times, rng).round().astype(int)
    poses, translations = motion.pose_vectors[frames], motion.translations[frames]
    return np.asarray(motion.model(motion.betas, poses, translations))


def compare_representations(
    seed: int = 0,
    *,
    task: Callable[[str], AbstractContextManager[None]] = lambda name: nullcontext(),
) -> tuple[dict[str, Array], Array]:
    """Return the distances between the open motions, re-timed at random, for each representation.

    Parameters
    ----------
    seed : int
        Seed of the speeds.
    task : callable
        Maps the name of a task to the context manager in which the task runs.

    Returns
    -------
    distances : dict of str to array, shape (140, 140)
    labels : array of str, shape (140,)
        Names of the motions.

    Examples
    --------
    >>> distances, labels = rh.motions.compare_representations()  # doctest: +SKIP
    >>> table = rh.retrieval.retrieval_table(distances, labels)  # doctest: +SKIP
    """
    from riemhuman.datasets import load_open_motions

    rng = np.random.default_rng(seed)
    with task("Motions"):
        open_motions = load_open_motions("coarse")
        motions = [retime_at_random(motion, rng) for motion in open_motions]
    labels = np.array([motion.sequence for motion in open_motions])
    model = open_motions[0].model
    space = AlignedSurfaces(model.template, equip=False)
    pose = ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    space.metric = pose
    count = _COMPONENTS
    measures: dict[str, MotionDistance] = {
        "time warping, joints": DynamicTimeWarping(JointMetric(space, model), n_jobs=-1),
        "time warping, SRNF": DynamicTimeWarping(SRNFMetric(space), n_components=count, n_jobs=-1),
        "time warping, pose metric": DynamicTimeWarping(pose, n_components=count, n_jobs=-1),
        "time warping, changes of pose": DynamicTimeWarping(
            pose, centered=True, n_components=count, n_jobs=-1
        ),
        "time warping, velocities": VelocityTimeWarping(pose, n_components=count, n_jobs=-1),
        "rate-invariant, pose metric": RateInvariantMetric(
            MotionSpace(space), n_components=count, n_jobs=-1
        ),
    }
    distances = {}
    with task("pose metric, frame by frame"):
        distances["pose metric, frame by frame"] = _frame_by_frame(pose, motions)
    for name, measure in measures.items():
        with task(name):
            distances[name] = measure.dist_pairwise(motions)
    return distances, labels


def _frame_by_frame(metric: RiemannianMetric, motions: list[Array]) -> Array:
    """Return L² distances over 24 equally spaced frames of each motion, whatever its speed."""
    n = _FEWEST_FRAMES
    frames = [m[np.linspace(0, len(m) - 1, n).round().astype(int)] for m in motions]
    squared = np.zeros((len(motions), len(motions)))
    for k in range(n):
        squared += metric.dist_pairwise(np.stack([m[k] for m in frames]), n_jobs=-1) ** 2
    return np.sqrt(squared / n)
