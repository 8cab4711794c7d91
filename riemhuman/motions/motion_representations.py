r"""Other representations of motions, and a comparison of all on re-timed open motions.

Gram–Hankel matrices: frames are currents, in a Hilbert space with a Gaussian kernel of width σ,

.. math:: \langle f, h\rangle = \sum_{t, s} \langle a_t, b_s\rangle\, e^{-|x_t - y_s|^2/\sigma^2}

over triangles with centres x, y and area vectors a, b. H is the Hankel matrix of r rows of a
sequence f_1, …, f_N, and G = H Hᵀ has the entries :math:`\sum_k \langle f_{i+k}, f_{j+k}\rangle`;
the distance of sequences is that of their matrices G, each divided by its norm, after Pierson,
Daoudi and Arguillère, "3D shape sequence of human comparison and classification using current and
varifolds" (arXiv 2111.13985). Here the kernel is the mean over random Fourier features (Rahimi and
Recht, 2007): frames become vectors, and no sum over pairs of triangles is needed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial.distance import pdist, squareform

from riemhuman.arrays import Array
from riemhuman.checks import Rng, generator
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.motions._frames import Motion, frame_runs
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


@dataclass(frozen=True)
class GramHankel:
    """Distances of sequences by products of their Hankel matrices; they depend on the speed."""

    space: AlignedSurfaces
    width: float = 0.2  # σ, metres
    n_rows: int = 8  # r
    n_features: int = 64  # random Fourier features

    def describe(self, motion: Motion, name: str) -> Array:
        """Return G divided by its norm, shape (r, r)."""
        rows = np.concatenate([self.currents(run) for run in frame_runs(self.space, motion, name)])
        gram = rows @ rows.T
        n_columns = len(rows) - self.n_rows + 1
        hankel = sum(gram[k : k + self.n_rows, k : k + self.n_rows] for k in range(n_columns))
        return np.asarray(hankel / np.linalg.norm(hankel))

    def dist_pairwise(self, motions: Sequence[Motion]) -> Array:
        rows = [self.describe(m, f"motions[{k}]").ravel() for k, m in enumerate(motions)]
        distances: Array = squareform(pdist(np.stack(rows)))
        return distances

    def currents(self, run: Array) -> Array:
        """Return frames as vectors: area vectors times Fourier features at the centres."""
        rng = np.random.default_rng(0)
        # The Fourier transform of exp(−|x|²/σ²) is a normal density of deviation √2/σ.
        waves = rng.normal(0.0, np.sqrt(2.0) / self.width, (3, self.n_features))
        faces = self.space.template.faces
        # The mean vertex is moved to the origin, so that positions in space do not count.
        centred = run - run.mean(axis=1, keepdims=True)
        parts = np.empty((len(run), 2, 3, self.n_features))
        for part, frame, areas in zip(parts, centred, self.space.normals(run), strict=True):
            # Cosines and sines by the tangent of half the angle: NumPy needs a fourth of the time.
            tangents = np.tan(0.5 * (frame[faces].mean(axis=1) @ waves))
            scale = 2.0 / (1.0 + tangents**2)  # 1 + cos
            part[0] = areas.T @ (scale - 1.0)
            part[1] = areas.T @ (scale * tangents)
        return np.asarray(parts.reshape(len(run), -1) / np.sqrt(self.n_features))


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
    measures: dict[str, GramHankel | MotionDistance] = {
        "Hankel matrices of currents": GramHankel(space),
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
