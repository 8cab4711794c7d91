"""Several scans of one person: one shape of the model for all of them, with a pose for each.

In go registrations that were made alone; out come those that share what the scans agree on: the
coefficients of the shape, each counted by how much its scan shows of it, and the skin that the
model lacks, in the rest pose. What one scan does not show follows from the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Booleans
from riemhuman.registration._constants import (
    DENSE_ALONG,
    DENSE_SCALES,
    DIFFERENT_METRES,
    LEAST_RELIABLE,
    LIMB_ELSEWHERE,
    MOST_FOREIGN,
    N_FIRST_STEPS,
    N_SHARED_ROUNDS,
    SHARED_SHAPE_PRECISION,
    SHARED_SKIN_WEIGHT,
)
from riemhuman.registration._dense_fit import DenseTask, fit_closest
from riemhuman.registration._elastic_step import ElasticFit, fit_elastic, softer_steps
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._posed_body import Pose, normal_equations, pose_body
from riemhuman.registration.registered_scans import RegistrationTrace


@dataclass(frozen=True, eq=False)
class SharedFit:
    """The body in one scan, found with other scans of the same person."""

    fit: ElasticFit
    borrowed: Booleans  # (V,) trusted vertices that only other scans show


def fit_together(traces: Sequence[RegistrationTrace]) -> list[SharedFit | None]:
    """Return bodies that share their shape and skin, and None for scans whose shape differs.

    The scan whose body departs most from the common shape is left out, until all agree.
    """
    fits: list[SharedFit | None] = [None] * len(traces)
    chosen = list(range(len(traces)))
    while len(chosen) > 1:
        few = [traces[k] for k in chosen]
        shaped = share_shape(few)
        foreign = [_departure(trace.elastic, fit) for trace, fit in zip(few, shaped, strict=True)]
        worst = int(np.argmax(foreign))
        if foreign[worst] > MOST_FOREIGN:
            del chosen[worst]
            continue
        for k, fit in zip(chosen, _share_skin(few, shaped), strict=True):
            fits[k] = fit
        break
    return fits


def share_shape(traces: Sequence[RegistrationTrace]) -> list[ElasticFit]:
    """Return bodies with the shape that is likeliest given all scans."""
    n_betas = traces[0].task.body.model.n_betas
    poses = [trace.elastic.pose for trace in traces]
    for _ in range(N_SHARED_ROUNDS):
        # Each scan has a normal distribution of the shape; the prior counts once.
        matrix, right = np.eye(n_betas), np.zeros(n_betas)
        for trace, pose in zip(traces, poses, strict=True):
            precision, gradient = shape_shown(trace.task, pose)
            matrix += precision
            right += gradient + precision @ pose.betas[:n_betas]
        shape = np.linalg.solve(matrix, right).astype(np.float64, copy=False)
        poses = [
            _with_shape(trace.task, pose, shape) for trace, pose in zip(traces, poses, strict=True)
        ]
    skin = np.zeros((traces[0].task.body.model.n_vertices, 3))
    return [_leave_model(trace.task, pose, skin) for trace, pose in zip(traces, poses, strict=True)]


def shape_shown(task: DenseTask, pose: Pose) -> tuple[Array, Array]:
    """Return what a scan says about the shape in any pose: precision and gradient, without prior.

    Directions of the shape that change nothing which the scan shows, or nothing that another pose
    could not explain as well, have a small precision.
    """
    n_betas, n_angles = task.body.model.n_betas, 3 * len(pose.local)
    posed, prior = pose_body(task.samples, pose), task.prior
    precisions = prior.betas_precisions.copy()
    precisions[:n_betas] = 0.0
    gaps, normals, weights, *_ = task.scan.match(posed.points, posed.normals, DENSE_SCALES[-1])
    matrix, right = normal_equations(
        posed,
        prior._replace(betas_precisions=precisions),
        task.scan.prior_weight,
        task.samples.areas * weights,
        gaps,
        normals,
        DENSE_ALONG,
        with_detail=True,
    )
    of_shape = np.zeros(len(matrix), dtype=bool)
    of_shape[n_angles : n_angles + n_betas] = True
    # The Schur complement of all other parameters.
    mixed = matrix[np.ix_(~of_shape, of_shape)]
    solved = np.linalg.solve(
        matrix[np.ix_(~of_shape, ~of_shape)], np.column_stack([mixed, right[~of_shape]])
    )
    precision = matrix[np.ix_(of_shape, of_shape)] - mixed.T @ solved[:, :-1]
    gradient = right[of_shape] - mixed.T @ solved[:, -1]
    return precision / task.scan.prior_weight, gradient / task.scan.prior_weight


def _with_shape(task: DenseTask, pose: Pose, shape: Array) -> Pose:
    """Return the pose in a scan of a body whose shape is known."""
    n_betas, prior = len(shape), task.prior
    precisions = prior.betas_precisions.copy()
    precisions[:n_betas] = SHARED_SHAPE_PRECISION
    known = prior._replace(
        betas=np.concatenate([shape, prior.betas[n_betas:]]), betas_precisions=precisions
    )
    start = pose._replace(betas=np.concatenate([shape, pose.betas[n_betas:]]))
    return fit_closest(task.samples, start, known, task.scan, DENSE_SCALES[N_FIRST_STEPS:])


def _departure(alone: ElasticFit, shaped: ElasticFit) -> float:
    """Return how many times farther a body is from the model with another shape than its own."""
    shown = (alone.matches.weights > LEAST_RELIABLE) & (shaped.matches.weights > LEAST_RELIABLE)
    before, after = (
        np.linalg.norm(fit.points - fit.model_points, axis=1)[shown] for fit in (alone, shaped)
    )
    return float(after.mean() / before.mean())


def _share_skin(traces: Sequence[RegistrationTrace], fits: Sequence[ElasticFit]) -> list[SharedFit]:
    """Return surfaces that leave the model alike where scans agree, and what each borrows."""
    n_vertices = traces[0].task.body.model.n_vertices
    sums, weights = np.zeros((n_vertices, 3)), np.full(n_vertices, SHARED_SKIN_WEIGHT)
    for trace, fit in zip(traces, fits, strict=True):
        offsets = fit.points - fit.model_points
        turned = np.einsum("vyx,vy->vx", _rotations(trace.task, fit.pose), offsets)
        sums += fit.matches.weights[:, np.newaxis] * turned
        weights += fit.matches.weights
    skin = sums / weights[:, np.newaxis]
    shown = np.array([trace.verdict.trusted_vertices for trace in traces])
    anywhere = np.asarray(shown.any(axis=0), dtype=bool)
    shared = []
    for own, trace, fit in zip(shown, traces, fits, strict=True):
        left = _leave_model(trace.task, fit.pose, skin)
        moved = np.linalg.norm(left.points - trace.elastic.points, axis=1)
        parts, matched = trace.task.body.parts, trace.verdict.matched
        shared.append(SharedFit(left, find_borrowed(parts, own, matched, moved, anywhere)))
    return shared


def _leave_model(task: DenseTask, pose: Pose, skin: Array) -> ElasticFit:
    """Return the surface that leaves a model with this skin, (V, 3) in the rest pose, metres."""
    surface = task.body.surface(pose)
    reference = surface + np.einsum("vxy,vy->vx", _rotations(task, pose), skin)
    points, matches = fit_elastic(
        task.body.metric, reference, reference, task.scan, softer_steps(task), visible=task.visible
    )
    return ElasticFit(pose, surface, points, matches)


def _rotations(task: DenseTask, pose: Pose) -> Array:
    """Return the rotation of each vertex from the rest pose, (V, 3, 3)."""
    blended: Array = pose_body(task.body.samples(None), pose).blended
    return blended[: task.body.model.n_vertices]


def find_borrowed(
    parts: BodyParts, own: Booleans, matched: Booleans, moved: Array, shown: Booleans
) -> Booleans:
    """Return which vertices are trusted because other scans show them.

    The scan itself must show where the part is: enough of its vertices are trusted, none of those
    that match the scan are in doubt, and most have not moved from where they were without the other
    scans. Fingers move freely, and are never borrowed.
    """
    doubtful = np.unique(parts.owners[matched & ~own])
    stays = parts.shares(moved < DIFFERENT_METRES) > 0.5
    sure = (parts.shares(own) > LIMB_ELSEWHERE) & stays
    sure[doubtful] = False
    borrowed: Booleans = shown & ~own & sure[parts.owners] & ~parts.on_hands
    return borrowed
