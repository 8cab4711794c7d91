"""The elastic step, in which the surface of a fitted body leaves the model to meet the scan.

In go a `DenseTask` and a pose; out comes an `ElasticFit`: a better pose, the model's surface in it,
and the surface that left the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import cg

from riemhuman.arrays import Array, Booleans
from riemhuman.geometry import ElasticMetric
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._constants import (
    CONJUGATE_TOLERANCE,
    DENSE_ALONG,
    ELASTIC_SCALE,
    FIRST_STIFFNESS,
    LONGEST_ROTATION,
    MOST_HALVINGS,
    N_CONJUGATE,
    N_ELASTIC_REPEATS,
    N_ELASTIC_STEPS,
    N_ELASTIC_STEPS_AGAIN,
    N_SURFACE_STEPS,
    NOISE_METRES,
    UNMATCHED_WEIGHT,
)
from riemhuman.registration._dense_fit import DenseTask
from riemhuman.registration._posed_body import Pose, normal_equations, pose_body, take_step
from riemhuman.registration._scan_preparation import Matches, PreparedScan


@dataclass(frozen=True)
class ElasticFit:
    """A body whose surface has left the model to meet the scan."""

    pose: Pose
    model_points: Array  # (V, 3) surface of the model
    points: Array  # (V, 3) surface that left the model
    matches: Matches  # of the vertices


def leave_model(task: DenseTask, pose: Pose) -> ElasticFit:
    """Take the elastic step, then fit the model to its result again, twice."""
    metric, scan = task.body.metric, task.scan
    softer = softer_steps(task)
    reference = task.body.surface(pose)
    points, matches = fit_elastic(metric, reference, reference, scan, softer, visible=task.visible)
    for _ in range(N_ELASTIC_REPEATS):
        weights = np.maximum(matches.weights, UNMATCHED_WEIGHT)
        pose = _fit_surface(task, pose, points, weights)
        reference = task.body.surface(pose)
        points, matches = fit_elastic(
            metric,
            points,
            reference,
            scan,
            softer[-N_ELASTIC_STEPS_AGAIN:],
            visible=task.visible,
        )
    return ElasticFit(pose, reference, points, matches)


def softer_steps(task: DenseTask) -> Array:
    """Return the stiffnesses α of elastic steps to the scan of a task."""
    last = last_stiffness(task.scan.noise, task.body.settings.last_stiffness)
    return np.geomspace(FIRST_STIFFNESS, last, N_ELASTIC_STEPS)


def last_stiffness(noise: float, least: float) -> float:
    """Return the stiffness α of the last elastic steps for a scan with such noise, metres."""
    softest = least * max(1.0, noise / NOISE_METRES) ** 2
    return min(softest, FIRST_STIFFNESS)


def _fit_surface(task: DenseTask, pose: Pose, points: Array, weights: Array) -> Pose:
    """Return the pose nearest to the vertices that left the model, with weights (V,)."""
    numbers = task.samples.numbers
    is_vertex = (numbers >= 0)[:, np.newaxis]
    shares = task.samples.areas * weights[numbers]
    for _ in range(N_SURFACE_STEPS):
        posed = pose_body(task.samples, pose)
        gaps = np.where(is_vertex, points[numbers] - posed.points, 0.0)
        equations = normal_equations(
            posed, task.prior, task.scan.prior_weight, shares, gaps, gaps, 1.0
        )
        pose = take_step(posed, equations, LONGEST_ROTATION)
    return pose


def fit_elastic(
    metric: ElasticMetric,
    start: Array,
    reference: Array,
    scan: PreparedScan,
    stiffnesses: Sequence[float] | Array,
    scale: float = ELASTIC_SCALE,
    visible: Booleans | bool = True,
) -> tuple[Array, Matches]:
    """Return a surface near a scan, elastically near a reference, and the matches of vertices."""
    # Gauss–Newton steps, one for each stiffness, minimise the cost of `TemplateRegistration` with
    # the matrix of the metric at the reference.
    template = metric.space.template
    faces, areas = template.faces, template.vertex_areas

    def match(points: Array) -> Matches:
        matches = scan.match(points, vertex_normals(points, faces), scale)
        return matches._replace(
            weights=matches.weights * visible, reliable=matches.reliable * visible
        )

    # Single precision is enough for steps.
    system = sparse.bsr_array(metric.metric_matrix(reference), blocksize=(3, 3)).astype(np.float32)
    elastic, numbers = system.data, np.arange(len(start) + 1)
    on_diagonal = np.repeat(numbers[:-1], np.diff(system.indptr)) == system.indices

    def pull_to(points: Array) -> tuple[float, Array]:
        energy, gradient = metric.energy_and_gradient(np.stack([reference, points]))
        return energy, gradient[1]

    points, matches = start, match(start)
    energy, pull = pull_to(start)
    for stiffness in stiffnesses:
        weights = areas * matches.weights
        blocks = matches.normals[:, :, np.newaxis] * matches.normals[:, np.newaxis]
        blocks = weights[:, np.newaxis, np.newaxis] * (blocks + DENSE_ALONG * np.eye(3))
        right = np.einsum("nxy,ny->nx", blocks, matches.gaps) - 0.5 * stiffness * pull
        system.data = np.float32(stiffness) * elastic
        system.data[on_diagonal] += blocks
        inverse = np.linalg.inv(system.data[on_diagonal])
        step, _ = cg(
            system,
            right.ravel().astype(np.float32),
            rtol=CONJUGATE_TOLERANCE,
            maxiter=N_CONJUGATE,
            M=sparse.bsr_array((inverse, numbers[:-1], numbers)),
        )
        step = step.reshape(-1, 3)
        cost = _squares(matches.gaps, blocks) + stiffness * energy
        # Where triangles nearly vanish, a full step may go too far.
        energy, pull = pull_to(points + step)
        for _ in range(MOST_HALVINGS):
            if _squares(matches.gaps - step, blocks) + stiffness * energy <= cost:
                break
            step = 0.5 * step
            energy, pull = pull_to(points + step)
        points = points + step
        matches = match(points)
    return points, matches


def _squares(gaps: Array, blocks: Array) -> float:
    """Return the sum of weighted squares of gaps, with a matrix of weights for each."""
    return float(np.einsum("nx,nxy,ny->", gaps, blocks, gaps, optimize=True))
