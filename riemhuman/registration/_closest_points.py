"""The dense fit by closest points, first of the model's parameters and then of free vertices."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg
from scipy.spatial import cKDTree

from riemhuman.geometry import ElasticMetric
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.registration._fitting_steps import Prior, take_step
from riemhuman.registration._posed_body import ModelSamples, Pose, pose_body

# Distance in metres that counts as much as a rotation of the normal by a radian.
_NORMAL_METRES = 0.05
# Number of scan points in an average, against noise.
_N_NEIGHBOURS = 4
_BLUR_METRES = 0.008
# Number of points from which noise is estimated, and the median of |x| for a standard normal x.
_N_NOISE, _MEDIAN = 3000, 0.6745

_MODEL_SCALES = (0.04, 0.03, 0.03, 0.03, *(0.02,) * 5, *(0.012,) * 4)
_MODEL_ALONG = 0.05
# One unit of a coefficient counts as much as one point of the scan that lies so far off: the fewer
# points, the more the prior counts.
_PRIOR_METRES = 0.02
# Largest rotation of a joint in a step, radians.
_LONGEST = 0.3

_N_SURFACE_STEPS = 3
_FREE_ALONG = 0.05
_FREE_SCALE = 0.01
_CONJUGATE_STEPS, _CONJUGATE_TOLERANCE = 60, 3e-2


class Matches(NamedTuple):
    """The points of a scan that match the points of a body."""

    gaps: np.ndarray  # (n, 3) vectors from the points of the body to their matches, metres
    normals: np.ndarray  # (n, 3) normals of the scan at the matches
    weights: np.ndarray  # (n,) reliability of each match, between 0 and 1

    def only(self, chosen: np.ndarray) -> Matches:
        """Return the matches with weight 0 for all but the chosen points."""
        return self._replace(weights=self.weights * chosen)


class ScanTree:
    """A search tree for the points of a scan by position and normal."""

    def __init__(self, points: np.ndarray, normals: np.ndarray) -> None:
        self.points, self.normals = points, normals
        self._tree = cKDTree(np.concatenate([points, _NORMAL_METRES * normals], axis=1))

    @property
    def prior_weight(self) -> float:
        """The weight of the prior, square metres."""
        return _PRIOR_METRES**2 / len(self.points)

    @cached_property
    def noise(self) -> float:
        """The standard deviation of the points along their normals, metres.

        On a circle, the chord between two points is perpendicular to the mean of their normals, so
        what is left of it along this mean is noise.
        """
        chosen = np.linspace(0, len(self.points) - 1, min(_N_NOISE, len(self.points))).astype(int)
        near = self._tree.query(self._tree.data[chosen], k=min(5, len(self.points)))[1][:, 1:]
        chords = self.points[near] - self.points[chosen, np.newaxis]
        means = 0.5 * (self.normals[near] + self.normals[chosen, np.newaxis])
        heights = np.einsum("nkx,nkx->nk", chords, means)
        return float(np.median(np.abs(heights))) / (_MEDIAN * np.sqrt(2.0))

    def match(self, points: np.ndarray, normals: np.ndarray, scale: float) -> Matches:
        """Match the points of a body; a match at distance `scale` has a quarter of the weight."""
        places = np.concatenate([points, _NORMAL_METRES * normals], axis=1)
        count = min(_N_NEIGHBOURS, len(self.points))
        far, near = self._tree.query(places, k=count)
        far, near = far.reshape(len(points), -1), near.reshape(len(points), -1)
        shares = np.exp(-0.5 * (far**2 - far[:, :1] ** 2) / _BLUR_METRES**2)
        shares /= shares.sum(axis=1, keepdims=True)
        gaps = np.einsum("nk,nkx->nx", shares, self.points[near]) - points
        mean_normals = unit_vectors(np.einsum("nk,nkx->nx", shares, self.normals[near]))
        cosines = np.einsum("nx,nx->n", mean_normals, normals)
        weights = (scale**2 / (np.sum(gaps**2, axis=1) + scale**2)) ** 2
        return Matches(gaps, mean_normals, weights * np.clip(cosines, 0.0, 1.0))


def fit_closest(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    scan: ScanTree,
    scales: tuple[float, ...] = _MODEL_SCALES,
) -> Pose:
    """Return the parameters that bring a body's points to the closest points of a scan.

    In each step, a match at the distance given by `scales` counts a quarter.
    """
    for scale in scales:
        points, normals = pose_body(body, pose)
        matches = scan.match(points, normals, scale)
        shares = body.areas * matches.weights
        pose = take_step(
            body,
            pose,
            prior,
            scan.prior_weight,
            shares,
            matches.gaps,
            matches.normals,
            _MODEL_ALONG,
            _LONGEST,
        )
    return pose


def fit_surface(
    body: ModelSamples,
    pose: Pose,
    prior: Prior,
    prior_weight: float,
    surface: np.ndarray,
    weights: np.ndarray,
) -> Pose:
    """Return the parameters that bring the model's vertices to a surface, with weights (V,)."""
    is_vertex = (body.numbers >= 0)[:, np.newaxis]
    shares = body.areas * weights[body.numbers]
    for _ in range(_N_SURFACE_STEPS):
        points, normals = pose_body(body, pose)
        gaps = np.where(is_vertex, surface[body.numbers] - points, 0.0)
        pose = take_step(body, pose, prior, prior_weight, shares, gaps, normals, 1.0, _LONGEST)
    return pose


def fit_elastic(
    metric: ElasticMetric,
    start: np.ndarray,
    reference: np.ndarray,
    scan: ScanTree,
    stiffnesses: Sequence[float] | np.ndarray,
    scale: float = _FREE_SCALE,
    visible: np.ndarray | None = None,
) -> tuple[np.ndarray, Matches]:
    """Return a surface near a scan, elastically near a reference, and the matches of its vertices.

    Gauss–Newton steps minimise Σ_i w_i ((n_i·r_i)² + τ |r_i|²) + α d²(f, f₀), with the gaps r to
    the scan, its normals n, the elastic distance d from the reference f₀, and a stiffness α for
    each step. They use the matrix of the metric at the reference, and conjugate gradients solve
    the equations. Only visible vertices are matched, by default all.
    """
    template = metric.space.template
    faces, areas = template.faces, template.vertex_areas
    shown = np.ones(len(start), dtype=bool) if visible is None else visible
    elastic = metric.metric_matrix(reference)
    diagonal = _diagonal_blocks(elastic)
    points = start
    matches = scan.match(points, vertex_normals(points, faces), scale).only(shown)
    for stiffness in stiffnesses:
        weights = areas * matches.weights
        blocks = matches.normals[:, :, np.newaxis] * matches.normals[:, np.newaxis]
        blocks = weights[:, np.newaxis, np.newaxis] * (blocks + _FREE_ALONG * np.eye(3))
        pull = metric.energy_and_gradient(np.stack([reference, points]))[1][1]
        right = np.einsum("nxy,ny->nx", blocks, matches.gaps) - 0.5 * stiffness * pull
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
        matches = scan.match(points, vertex_normals(points, faces), scale).only(shown)
    return points, matches


def _diagonal_blocks(matrix: object) -> np.ndarray:
    """Return the 3 × 3 blocks on the diagonal of a sparse matrix, shape (V, 3, 3)."""
    entries = matrix.tocoo()  # type: ignore[attr-defined]
    same = entries.row // 3 == entries.col // 3
    rows, columns, values = entries.row[same], entries.col[same], entries.data[same]
    blocks = np.zeros((entries.shape[0] // 3, 3, 3))
    blocks[rows // 3, rows % 3, columns % 3] = values
    return blocks
