"""The body beneath clothes: its surface lies inside the scan, or on it where it is bare.

In goes a body that was fitted to a scan as if garments were skin; out comes the likeliest body
beneath them, and which of its vertices loose cloth hides.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._constants import (
    CLOTH_PULL,
    CLOTH_REACH,
    CLOTHED_PRIOR,
    CLOTHES_SCALES,
    DENSE_ALONG,
    LEAST_RELIABLE,
    LONGEST_ROTATION,
    MATCH_NORMAL_METRES,
    TIGHT_METRES,
)
from riemhuman.registration._dense_fit import DenseTask
from riemhuman.registration._elastic_step import ElasticFit, fit_elastic, softer_steps
from riemhuman.registration._posed_body import Pose, normal_equations, pose_body, take_step
from riemhuman.surfaces.template import Template


@dataclass(frozen=True, eq=False)
class BodyBeneath:
    """A body beneath clothes."""

    fit: ElasticFit
    hidden: Booleans  # (V,) vertices beneath loose clothes


def find_body_beneath(task: DenseTask, pose: Pose) -> BodyBeneath:
    """Return the body beneath the clothes to which a body was fitted as if they were skin."""
    body, bare = task.body, task.body.parts.bare
    pose = fit_beneath(task, pose)
    surface = body.surface(pose)
    distances = _distances_to_scan(task, surface)
    points, matches = fit_elastic(
        body.metric,
        surface,
        surface,
        task.scan,
        softer_steps(task),
        visible=task.visible & (bare | (distances < TIGHT_METRES)),
    )
    loose = find_loose(body.model.template, _distances_to_scan(task, points))
    hidden = hide_trunk(body.parts.on_trunk, loose & ~bare)
    return BodyBeneath(ElasticFit(pose, surface, points, matches), hidden)


def fit_beneath(task: DenseTask, pose: Pose) -> Pose:
    """Return the likeliest parameters of a body whose skin lies on or inside its scan.

    Where a part is bare, and where the scan is inside the body, gaps count as they do without
    clothes. Outside, cloth is at exponentially distributed distances h from the skin, with mean τ,
    which are alike over large parts, so that all of the surface is worth N independent places. The
    cost N h / τ pulls far cloth no more than near cloth. The body thus swells until the closest
    cloth or the prior holds it.
    """
    samples, scan = task.samples, task.scan
    bare = task.body.parts.bare[samples.numbers]
    for scale in CLOTHES_SCALES:
        posed = pose_body(samples, pose)
        gaps, normals, weights, *_ = scan.match(posed.points, posed.normals, scale)
        heights = np.einsum("nx,nx->n", gaps, normals)
        # The square with this weight touches the cost at the height.
        outside = CLOTHED_PRIOR * CLOTH_PULL / np.maximum(heights, TIGHT_METRES)
        shares = samples.areas * weights * np.where(bare | (heights < 0.0), 1.0, outside)
        equations = normal_equations(
            posed, task.prior, CLOTHED_PRIOR, shares, gaps, normals, DENSE_ALONG
        )
        pose = take_step(posed, equations, LONGEST_ROTATION)
    return pose


def find_loose(template: Template, distances: Array) -> Booleans:
    """Return the vertices around which a scan is not near on average; NaN is unknown.

    One near vertex does not tell: loose cloth, too, touches skin in places.
    """
    places = np.concatenate(
        [
            template.vertices,
            MATCH_NORMAL_METRES * vertex_normals(template.vertices, template.faces),
        ],
        axis=1,
    )
    known = np.flatnonzero(np.isfinite(distances))
    near = cKDTree(places[known]).query_ball_point(places, CLOTH_REACH)
    means = [distances[known[numbers]].mean() if numbers else np.inf for numbers in near]
    loose: Booleans = np.array(means) > TIGHT_METRES
    return loose


def hide_trunk(on_trunk: Booleans, hidden: Booleans) -> Booleans:
    """Return the hidden vertices, with all of a trunk of which cloth hides more than half.

    Where the rest of the cloth touches the skin, the scan shows where skin is, but not which: with
    shoulders and hips hidden, a waist slides along the trunk by several centimetres.
    """
    return hidden | on_trunk if hidden[on_trunk].sum() > 0.5 * on_trunk.sum() else hidden


def _distances_to_scan(task: DenseTask, points: Array) -> Array:
    """Return how far the scan is from vertices, metres; NaN where it does not match them."""
    normals = vertex_normals(points, task.body.model.faces)
    matches = task.scan.match(points, normals, CLOTHES_SCALES[-1])
    heights = np.abs(np.einsum("nx,nx->n", matches.gaps, matches.normals))
    return np.where(matches.reliable > LEAST_RELIABLE, heights, np.nan)
