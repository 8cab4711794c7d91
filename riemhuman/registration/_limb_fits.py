"""Some joints of a body fitted to the points of a scan on them; all else stays as it is."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TypeVar

import numpy as np

from riemhuman.kernels.threads import mapped
from riemhuman.registration._dense_fit import DenseTask, fit_closest, nearest_vertices
from riemhuman.registration._posed_body import ModelSamples, Pose, Prior
from riemhuman.registration._scan_preparation import N_THREADS
from riemhuman.registration.settings import ArmSettings
from riemhuman.surfaces.nearest_points import nearest_points

# Inverse variance of what does not move while a limb is fitted.
_FIXED = 1e15

Item = TypeVar("Item")
Result = TypeVar("Result")


def points_on(task: DenseTask, pose: Pose, vertices: np.ndarray) -> np.ndarray:
    """Return the points of the scan that lie near some vertices."""
    nearest = nearest_vertices(task.body.surface(pose), task.scan.points)
    points: np.ndarray = task.scan.points[np.isin(nearest, vertices)]
    return points


def fit_joints(
    task: DenseTask,
    joints: np.ndarray,
    samples: ModelSamples,
    prior: Prior,
    start: Pose,
    scales: tuple[float, ...] | None = None,
) -> Pose:
    """Fit some joints and the hands to the scan by points on them; all else stays as it starts."""
    model = task.body.model
    moving = np.isin(np.arange(model.n_joints), joints)
    of_hands = np.arange(len(start.betas)) >= model.n_betas
    of_limb = Prior(
        np.where(moving[:, np.newaxis, np.newaxis], prior.local, start.local),
        np.where(moving, prior.precisions, _FIXED),
        np.where(of_hands, prior.betas, start.betas),
        np.where(of_hands, prior.betas_precisions, _FIXED),
    )
    samples = samples._replace(areas=samples.areas * task.visible[samples.numbers])
    scales = task.body.settings.dense.scales if scales is None else scales
    return fit_closest(samples, start, of_limb, task.scan, scales)


def fit_starts(
    task: DenseTask,
    joints: np.ndarray,
    samples: ModelSamples,
    starts: list[Pose],
    scales: tuple[float, ...],
) -> list[Pose]:
    """Return what some joints become when they are fitted from several starts."""
    return mapped_fits(partial(_fit_from, task, joints, samples, scales), starts)


def _fit_from(
    task: DenseTask,
    joints: np.ndarray,
    samples: ModelSamples,
    scales: tuple[float, ...],
    start: Pose,
) -> Pose:
    return fit_joints(task, joints, samples, task.prior, start, scales)


def mapped_fits(fit: Callable[[Item], Result], starts: list[Item]) -> list[Result]:
    """Return what a fit makes of several starts, some at once."""
    return list(mapped(fit, starts, N_THREADS))


def faces_among(faces: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """Return the triangles of some vertices, numbered among these, which ascend."""
    inside = np.isin(faces, vertices).all(axis=1)
    return np.searchsorted(vertices, faces[inside])


def limited_distances(
    points: np.ndarray, surface: np.ndarray, faces: np.ndarray, farthest: float
) -> np.ndarray:
    """Return the distances of points from a surface; farther points count as so far, metres."""
    return np.minimum(nearest_points(points, surface, faces)[1], farthest)


def are_less(some: np.ndarray, others: np.ndarray, settings: ArmSettings) -> bool:
    """Return whether distances of the same points are less, by more than chance makes them."""
    gains = others - some
    chance = settings.n_errors * np.sqrt(np.mean(gains**2) / len(gains))
    return bool(gains.mean() > max(settings.least_gain * others.mean(), chance))
