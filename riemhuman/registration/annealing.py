"""Fits of a body to loose points from one start, by soft assignment with falling deviations."""

from __future__ import annotations

import math

import numpy as np

from riemhuman.kernels.compiled import compiled
from riemhuman.registration.model_samples import ModelSamples
from riemhuman.registration.posing import Pose, posed
from riemhuman.registration.posing_equations import Prior, add_normal_equations, add_prior, stepped
from riemhuman.registration.soft_assignment import assign

# Number of independent points that the scan counts as, relative to the prior.
_WORTH = 300.0
_LONGEST_TURN = 0.6
# Weight of a landmark, as a share of all scan points.
_LANDMARK = 0.03


@compiled
def annealed(
    body: ModelSamples,
    start: Pose,
    prior: Prior,
    scan: np.ndarray,
    scan_normals: np.ndarray,
    sigmas: np.ndarray,
    signed: bool,
    landmarks: np.ndarray,
) -> tuple[Pose, float]:
    """Fit a body to a scan, and return it with the likelihood before the last step.

    Parameters
    ----------
    body : ModelSamples
        The model.
    start : Pose
        Start of the fit.
    prior : Prior
        Prior of pose and shape.
    scan, scan_normals : array, shape (m, 3), float32
        Points of the scan, metres, and unit normals.
    sigmas : array, shape (n_steps,)
        Standard deviation in each step, metres.
    signed : bool
        Whether the signs of the normals are known.
    landmarks : array, shape (n, 3)
        Known places of points of the body; NaN for all others.

    Returns
    -------
    pose : Pose
    likelihood : float
        Mean log-likelihood of the scan points.
    """
    n = len(body.areas)
    n_columns = 3 * len(body.parents) + len(start.betas) + 3
    areas = body.areas.astype(np.float32)
    masses, targets = np.empty(n, np.float32), np.empty((3, n), np.float32)
    shares, gaps = np.empty(n), np.empty((n, 3))
    pose, likelihood = start, -np.inf
    for sigma in sigmas:
        points, normals = posed(body, pose)
        likelihood = assign(
            np.ascontiguousarray(points.T).astype(np.float32),
            np.ascontiguousarray(normals.T).astype(np.float32),
            areas,
            scan,
            scan_normals,
            sigma,
            signed,
            masses,
            targets,
        )
        for i in range(n):
            shares[i] = masses[i] / len(scan)
            for x in range(3):
                mean = targets[x, i] / masses[i] if masses[i] > 0.0 else 0.0
                gaps[i, x] = mean - points[i, x]
            if not math.isnan(landmarks[i, 0]):
                shares[i] = _LANDMARK
                for x in range(3):
                    gaps[i, x] = landmarks[i, x] - points[i, x]
        matrix, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
        add_normal_equations(body, pose, shares, gaps, normals, 1.0, matrix, right)
        add_prior(body, pose, prior, sigma * sigma / _WORTH, matrix, right)
        pose = stepped(body, pose, matrix, right, _LONGEST_TURN)
    return pose, likelihood
