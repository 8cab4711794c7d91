"""Which parts of a fitted body its scan shows: matched, lying in others, lost, or seen.

In go a fit and its scan; out come sets of vertices.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._constants import (
    ALONG_METRES,
    APART_METRES,
    LEAST_BENT,
    LEAST_RELIABLE,
    LIMB_ELSEWHERE,
    MATCHED_METRES,
    N_OVERLAP_NEIGHBOURS,
    ONE_SIDED,
    OUTSIDE_METRES,
    OVERLAP_METRES,
    SAME_PLACE,
    SEEN_METRES,
    SHARED_LIMB,
)
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.surfaces.measures import edge_lengths
from riemhuman.surfaces.template import Template

_LIMB_JOINTS = ("shoulder", "elbow", "hip", "knee", "head")
# Joints that bend, and those that end the bone below.
_FOLDING = (
    ("left_elbow", "left_wrist"),
    ("right_elbow", "right_wrist"),
    ("left_knee", "left_ankle"),
    ("right_knee", "right_ankle"),
)


@dataclass(frozen=True, eq=False)
class ShownParts:
    """What is known about the vertices of a registered body, (V,) each."""

    visible: Booleans  # such a scan can show them
    matched: Booleans  # they have counterparts in the scan
    overlaps: Booleans  # they lie where another matched part does
    lost: Booleans  # they belong to limbs that the scan does not show
    seen: Booleans  # they are matched, or near those that are


def find_shown_parts(fitted: BodyFit, scan: PreparedScan) -> ShownParts:
    """Return which vertices are matched, lie where another part does, are lost, and are seen."""
    body, fit = fitted.task.body, fitted.fit
    visible = body.find_visible(fit.model_points, scan.points, fitted.task.up)
    parts, template = body.parts, body.model.template
    near = fit.matches.distances < MATCHED_METRES
    matched = visible & near & (fit.matches.reliable > LEAST_RELIABLE)
    # Hands that lie on the body are so thin that they count as being in it, though they are right.
    overlaps = find_overlaps(template, fit.points, matched & ~parts.on_hands)
    lost = find_lost_limbs(parts, fit.points, matched, overlaps.near)
    if lost.any():
        chosen = matched & ~parts.on_hands & ~lost
        overlaps = find_overlaps(template, fit.points, chosen)
    seen = find_seen(template, fit.points, matched, scan) & visible & ~lost
    return ShownParts(visible, matched, overlaps.around, lost, seen)


def find_seen(template: Template, points: Array, matched: Booleans, scan: PreparedScan) -> Booleans:
    """Return which vertices are matched or near those that are, along the surface."""
    if not matched.any():
        return matched
    first, second = template.edges.T
    lengths = edge_lengths(template.vertices, template.edges)
    shape = (template.n_vertices, template.n_vertices)
    graph = sparse.csr_array((lengths, (first, second)), shape=shape)
    distances = csgraph.dijkstra(
        graph,
        directed=False,
        indices=np.flatnonzero(matched),
        limit=SEEN_METRES,
        min_only=True,
    )
    nearest = cKDTree(scan.points).query(points)[1]
    heights = np.einsum("nx,nx->n", points - scan.points[nearest], scan.normals[nearest])
    seen: Booleans = matched | (np.isfinite(distances) & (heights < OUTSIDE_METRES))
    return seen


class Overlaps(NamedTuple):
    """Matched vertices that lie where another matched part of the body lies.

    At a seam, where a calf is folded onto a thigh, the other part is near on one side only; where
    one limb is fitted to the scan of another, it is all around.
    """

    near: Booleans
    around: Booleans


def find_overlaps(template: Template, points: Array, matched: Booleans) -> Overlaps:
    """Return which matched vertices lie in the same place as another matched part of the body."""
    overlaps = Overlaps(*np.zeros((2, len(points)), dtype=bool))
    matched_numbers = np.flatnonzero(matched)
    if not len(matched_numbers):
        return overlaps
    normals = vertex_normals(points, template.faces)[matched_numbers]
    count = min(N_OVERLAP_NEIGHBOURS, len(matched_numbers))
    ends = template.vertices[template.edges]
    edge = float(np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).mean())
    farthest = np.clip(edge, *OVERLAP_METRES)
    distances, near = cKDTree(points[matched_numbers]).query(
        points[matched_numbers], k=count, distance_upper_bound=farthest
    )
    close = np.isfinite(distances)
    near[~close] = 0
    gaps = points[matched_numbers][near] - points[matched_numbers, np.newaxis]
    heights = np.einsum("nkx,nx->nk", gaps, normals)
    close &= np.abs(heights) < ALONG_METRES
    rest = template.vertices[matched_numbers]
    apart = np.linalg.norm(rest[near] - rest[:, np.newaxis], axis=-1) > APART_METRES
    alike = np.einsum("nkx,nx->nk", normals[near], normals) > 0.5
    others = apart & alike & close
    sideways = gaps - heights[:, :, np.newaxis] * normals[:, np.newaxis]
    lengths = np.linalg.norm(sideways, axis=-1)
    directions = sideways / np.maximum(lengths, 1e-12)[:, :, np.newaxis]
    counts = np.maximum(others.sum(axis=1), 1)
    towards = np.linalg.norm((directions * others[:, :, np.newaxis]).sum(axis=1), axis=1) / counts
    same_place = (others & (lengths < SAME_PLACE * farthest)).any(axis=1)
    overlaps.near[matched_numbers] = others.any(axis=1)
    overlaps.around[matched_numbers] = others.any(axis=1) & (same_place | (towards < ONE_SIDED))
    return overlaps


def find_lost_limbs(
    parts: BodyParts, points: Array, matched: Booleans, overlaps: Booleans
) -> Booleans:
    """Return which vertices belong to limbs that match little of the scan."""
    # The model always has all limbs. A limb that the scan does not show is fitted to points of
    # other parts: most of what it matches is matched by another part of the body too, or it is
    # folded into the part above it.
    names, model = parts.names, parts.model
    few = parts.shares(matched & ~overlaps) < LIMB_ELSEWHERE
    shared = parts.shares(overlaps) > SHARED_LIMB * parts.shares(matched)
    lost = [int(k) for k in np.flatnonzero(few | shared) if names[k].split("_")[-1] in _LIMB_JOINTS]
    joints = model.joint_regressor @ points
    for middle_name, end_name in _FOLDING:
        limb = parts.numbers(middle_name, end_name)
        if len(limb) < 2:
            continue
        middle, end = limb
        above, below = joints[middle] - joints[model.parents[middle]], joints[end] - joints[middle]
        if above @ below < LEAST_BENT * np.linalg.norm(above) * np.linalg.norm(below):
            lost.append(middle)
    return parts.vertices(lost)
