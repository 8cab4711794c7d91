"""The dense fit by closest points, first of the model's parameters and then of free vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg
from scipy.spatial import cKDTree

from riemhuman.geometry import ElasticMetric
from riemhuman.kernels.vertex_normals import unit_vectors, vertex_normals
from riemhuman.registration._fitting_steps import Prior, add_normal_equations, add_prior, stepped
from riemhuman.registration._posed_body import ModelSamples, Pose, posed

# Distance in metres that counts as much as a turn of the normal by a radian.
_NORMAL_METRES = 0.05
# Number of scan points in an average, against noise.
_N_NEIGHBOURS = 4
_BLUR_METRES = 0.008

_MODEL_SCALES = (0.04, 0.03, 0.03, 0.03, *(0.02,) * 5, *(0.012,) * 4)
_MODEL_ALONG = 0.05
# Weight of the prior: one unit of a coefficient counts as much as this mean distance.
_PRIOR_METRES = 1e-4

_STIFFNESSES = (1e-3, 1e-3, 5e-4, 5e-4, 2e-4, 2e-4, 1e-4, 1e-4)
_FREE_ALONG = 0.05
_FREE_SCALE = 0.01
_CONJUGATE_STEPS, _CONJUGATE_TOLERANCE = 60, 3e-2


class Matches(NamedTuple):
    """The points of a scan that match the points of a body."""

    gaps: np.ndarray
    normals: np.ndarray
    weights: np.ndarray


class ScanTree:
    """A search tree for the points of a scan by position and normal."""

    def __init__(self, points: np.ndarray, normals: np.ndarray) -> None:
        self.points, self.normals = points, normals
        self._tree = cKDTree(np.concatenate([points, _NORMAL_METRES * normals], axis=1))

    def matches(self, points: np.ndarray, normals: np.ndarray, scale: float) -> Matches:
        """Match the points of a body; far matches count less (Geman and McClure)."""
        places = np.concatenate([points, _NORMAL_METRES * normals], axis=1)
        count = min(_N_NEIGHBOURS, len(self.points))
        far, near = self._tree.query(places, k=count)
        far, near = far.reshape(len(points), -1), near.reshape(len(points), -1)
        shares = np.exp(-0.5 * (far**2 - far[:, :1] ** 2) / _BLUR_METRES**2)
        shares /= shares.sum(axis=1, keepdims=True)
        gaps = np.einsum("nk,nkx->nx", shares, self.points[near]) - points
        found = unit_vectors(np.einsum("nk,nkx->nx", shares, self.normals[near]))
        cosines = np.einsum("nx,nx->n", found, normals)
        weights = (scale**2 / (np.sum(gaps**2, axis=1) + scale**2)) ** 2
        return Matches(gaps, found, weights * np.clip(cosines, 0.0, 1.0))


def fit_closest(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: ScanTree,
    scales: tuple[float, ...] = _MODEL_SCALES,
) -> Pose:
    """Return the parameters that bring a body's points to the closest points of a scan."""
    n_columns = 3 * len(body.parents) + len(pose.betas) + 3
    for scale in scales:
        points, normals = posed(body, pose)
        found = scan.matches(points, normals, scale)
        shares = body.areas * found.weights
        matrix, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
        add_normal_equations(
            body, pose, shares, found.gaps, found.normals, _MODEL_ALONG, matrix, right
        )
        add_prior(body, pose, prior, _PRIOR_METRES**2, matrix, right)
        pose = stepped(body, pose, matrix, right, 0.3)
    return pose


def fit_elastic(
    metric: ElasticMetric,
    start: np.ndarray,
    reference: np.ndarray,
    scan: ScanTree,
    stiffnesses: tuple[float, ...] = _STIFFNESSES,
    scale: float = _FREE_SCALE,
) -> tuple[np.ndarray, Matches]:
    """Return a surface near a scan whose elastic distance from a reference is small."""
    template = metric.space.template
    faces, areas = template.faces, template.vertex_areas
    elastic = metric.metric_matrix(reference)
    diagonal = _diagonal_blocks(elastic)
    points = start
    found = scan.matches(points, vertex_normals(points, faces), scale)
    for stiffness in stiffnesses:
        weights = areas * found.weights
        blocks = found.normals[:, :, np.newaxis] * found.normals[:, np.newaxis]
        blocks = weights[:, np.newaxis, np.newaxis] * (blocks + _FREE_ALONG * np.eye(3))
        pull = metric.energy_and_gradient(np.stack([reference, points]))[1][1]
        right = np.einsum("nxy,ny->nx", blocks, found.gaps) - 0.5 * stiffness * pull
        inverse = np.linalg.inv(blocks + stiffness * diagonal)

        def apply(
            vector: np.ndarray, blocks: np.ndarray = blocks, stiffness: float = stiffness
        ) -> np.ndarray:
            rows = np.einsum("nxy,ny->nx", blocks, vector.reshape(-1, 3))
            product: np.ndarray = rows.ravel() + stiffness * (elastic @ vector)
            return product

        def precondition(vector: np.ndarray, inverse: np.ndarray = inverse) -> np.ndarray:
            return np.einsum("nxy,ny->nx", inverse, vector.reshape(-1, 3)).ravel()

        shape = elastic.shape
        step = cg(
            LinearOperator(shape, matvec=apply, dtype=float),
            right.ravel(),
            rtol=_CONJUGATE_TOLERANCE,
            maxiter=_CONJUGATE_STEPS,
            M=LinearOperator(shape, matvec=precondition, dtype=float),
        )[0]
        points = points + step.reshape(-1, 3)
        found = scan.matches(points, vertex_normals(points, faces), scale)
    return points, found


def _diagonal_blocks(matrix: object) -> np.ndarray:
    """Return the 3 × 3 blocks on the diagonal of a sparse matrix, shape (V, 3, 3)."""
    entries = matrix.tocoo()  # type: ignore[attr-defined]
    same = entries.row // 3 == entries.col // 3
    rows, columns, values = entries.row[same], entries.col[same], entries.data[same]
    blocks = np.zeros((entries.shape[0] // 3, 3, 3))
    blocks[rows // 3, rows % 3, columns % 3] = values
    return blocks
