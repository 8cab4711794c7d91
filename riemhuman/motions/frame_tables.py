r"""Tables of squared distances between frames, from which motions are interpolated and centred.

In a flat space :math:`|\sum_k \alpha_k x_k - \sum_l \beta_l y_l|^2`, for coefficients with one sum,
is :math:`\sum \alpha_k\beta_l D_{kl} - u(\alpha) - u(\beta)` with :math:`u(\alpha) = \tfrac12 \sum
\alpha_k\alpha_{k'} D_{kk'}`: so motions can be interpolated between frames, and their means
subtracted, from the squared distances D alone. Metrics of surfaces are not flat, but nearly so over
the distance of neighbouring frames.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.interpolate import CubicSpline

from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.projections import Projection
from riemhuman.motions.dtw_kernels import between_frames
from riemhuman.motions.frames import Motion, frame_runs, n_frames_of, sampled_frames

# Frames whose principal components stand for those of all.
_MOST_SAMPLED = 600


@dataclass(frozen=True)
class Frames:
    """One motion, prepared for comparison.

    Attributes
    ----------
    features : tuple of array, each of shape (n_frames, ...)
        Features of each frame.
    coefficients : array, shape (n_times, n_frames) or None
        Combinations of frames to be compared in place of the frames.
    spread : array, shape (n_times,)
        u of every combination.
    steps : array, shape (n_times - 1,) or None
        Squared distances of consecutive combinations, where positions between them count.
    """

    features: tuple[ndarray, ...]
    coefficients: ndarray | None
    spread: ndarray
    steps: ndarray | None


class Tables(InheritsDocstrings, ABC):
    """Distances of the frames of motions, from features of each frame."""

    @abstractmethod
    def features(self, motion: Motion, name: str) -> tuple[ndarray, ...]:
        """Return the features of each frame.

        Parameters
        ----------
        motion : array or sequence, shape (n_frames, V, 3)
            The motion.
        name : str
            Name of the motion, for messages.

        Returns
        -------
        tuple of array
        """

    @abstractmethod
    def squared(self, a: tuple[ndarray, ...], b: tuple[ndarray, ...]) -> ndarray:
        """Return the squared distances of all pairs of frames.

        Parameters
        ----------
        a, b : tuple of array
            Features of n and of m frames.

        Returns
        -------
        array, shape (n, m)
        """


class ExactTables(Tables):
    """Distances of the metric itself, in double precision.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames.
    """

    def __init__(self, metric: RiemannianMetric) -> None:
        self._metric = metric

    def features(self, motion: Motion, name: str) -> tuple[ndarray, ...]:
        runs = [self._metric.features(run) for run in frame_runs(self._metric.space, motion, name)]
        return tuple(np.concatenate(arrays) for arrays in zip(*runs, strict=True))

    def squared(self, a: tuple[ndarray, ...], b: tuple[ndarray, ...]) -> ndarray:
        return self._metric.bulk.squared_distances(a, b)


class ProjectedTables(Tables):
    """Distances of principal components of a metric's lower-bound coordinates.

    No distance is above the metric's own. What the components leave out counts by its norm.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric with a method `lower_bound_coordinates`.
    motions : sequence of motions
        Motions from whose frames, evenly sampled, the components are computed.
    n_components : int
        Largest number of components.

    Raises
    ------
    ArgumentError
        If the metric has no such method.
    """

    def __init__(
        self, metric: RiemannianMetric, motions: Sequence[Motion], n_components: int
    ) -> None:
        if not metric.has_lower_bound_coordinates:
            raise ArgumentError(
                f"n_components needs a metric with lower_bound_coordinates, such as ElasticMetric; "
                f"found {type(metric).__name__}"
            )
        self._metric: Any = metric
        step = -(-sum(len(motion) for motion in motions) // _MOST_SAMPLED)
        sample = [
            metric.lower_bound_coordinates(frame)
            for k, motion in enumerate(motions)
            for frame in sampled_frames(metric.space, motion, f"motions[{k}]", step)
        ]
        self._projection = Projection.fit(np.stack(sample), n_components)

    def features(self, motion: Motion, name: str) -> tuple[ndarray, ...]:
        """Return the coordinates of each frame."""
        runs = frame_runs(self._metric.space, motion, name)
        rows = [self._projection(self._metric.lower_bound_coordinates(run)) for run in runs]
        return (np.concatenate(rows),)

    def squared(self, a: tuple[ndarray, ...], b: tuple[ndarray, ...]) -> ndarray:
        """Return the squared distances of all pairs of frames."""
        rows, others = a[0], b[0]
        squares = np.einsum("ij,ij->i", rows, rows)[:, None] + np.einsum("ij,ij->i", others, others)
        return np.maximum(squares - 2.0 * rows @ others.T, 0.0)


def tables_of(
    metric: RiemannianMetric, motions: Sequence[Motion], n_components: int | None
) -> Tables:
    """Return how distances of the frames of motions are found.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames.
    motions : sequence of motions
        The motions.
    n_components : int or None
        Number of principal components; None for exact distances.

    Returns
    -------
    Tables

    Raises
    ------
    ArgumentError
        If the metric has no lower bound to take components of.
    """
    if n_components is None:
        return ExactTables(metric)
    return ProjectedTables(metric, motions, n_components)


def kept_frames(
    tables: Any,
    motion: Motion,
    name: str,
    n_times: int | None,
    centered: bool,
    between: bool,
) -> Frames:
    """Prepare a motion for comparison with others.

    Parameters
    ----------
    tables : Tables
        Distances of frames.
    motion : array or sequence, shape (n_frames, V, 3)
        The motion, of at least two frames.
    name : str
        Name of the motion, for messages.
    n_times : int or None
        Number of equally spaced times to compare, by cubic interpolation; None compares frames.
    centered : bool
        Whether to subtract its mean along its length.
    between : bool
        Whether positions between frames count.

    Returns
    -------
    Frames

    Raises
    ------
    ArgumentError
        If there are fewer than two frames, or one is wrong.
    """
    n_frames = n_frames_of(motion, name, 2)
    features = tables.features(motion, name)
    if n_times is None and not centered and not between:
        return Frames(features, None, np.zeros(n_frames), None)
    within = tables.squared(features, features)
    if n_times is None:
        coefficients = np.eye(n_frames)
    else:
        places = np.linspace(0.0, n_frames - 1.0, n_times)
        coefficients = CubicSpline(np.arange(n_frames), np.eye(n_frames))(places)
    if centered:
        coefficients = coefficients - _shares_of_length(within)
    spread = 0.5 * np.einsum("ti,ij,tj->t", coefficients, within, coefficients, optimize=True)
    if not between:
        return Frames(features, coefficients, spread, None)
    changes = np.diff(coefficients, axis=0)
    steps = -0.5 * np.einsum("ti,ij,tj->t", changes, within, changes, optimize=True)
    return Frames(features, coefficients, spread, np.maximum(steps, 0.0))


def costs_between(tables: Any, one: Frames, other: Frames) -> ndarray:
    """Return the squared distances between two motions at all pairs of times.

    Parameters
    ----------
    tables : Tables
        Distances of frames.
    one, other : Frames
        The prepared motions.

    Returns
    -------
    array, shape (n_times, n_times of the other)
    """
    costs = tables.squared(one.features, other.features)
    if one.coefficients is not None and other.coefficients is not None:
        costs = one.coefficients @ costs @ other.coefficients.T
        costs = np.maximum(costs - one.spread[:, None] - other.spread, 0.0)
    if one.steps is not None and other.steps is not None:
        costs = between_frames(costs, one.steps, other.steps)
    return costs


def _shares_of_length(within: ndarray) -> ndarray:
    """Return the weight of each frame in the mean of a motion along its length."""
    lengths = np.sqrt(np.maximum(np.diagonal(within, 1), 0.0))
    if not lengths.any():
        return np.full(len(within), 1.0 / len(within))
    shares = np.zeros(len(within))
    shares[:-1] += 0.5 * lengths
    shares[1:] += 0.5 * lengths
    return shares / shares.sum()
