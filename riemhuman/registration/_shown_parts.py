"""Which parts of a fitted body its scan shows, and the body fitted again without lost limbs.

The model always has all limbs. One that the scan does not show is drawn to points of other parts,
and draws the part above it out of place: an upper arm follows the forearm that is fitted to the
trunk, and is rotated about itself with it. In goes a fit of all limbs; out comes one without those
that are lost, and which vertices the scan shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse
from scipy.sparse import csgraph
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Booleans
from riemhuman.kernels.surface import unit_vectors
from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._constants import (
    DENSE_SCALES,
    LEAST_OWN,
    LEAST_RELIABLE,
    LIMB_ELSEWHERE,
    LIMB_MARGIN,
    MATCHED_METRES,
    N_DENSE,
    TOUCHING_METRES,
    WIDEST_SPACING,
)
from riemhuman.registration._dense_fit import DenseTask, fit_closest
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._scan_preparation import PreparedScan, even_points
from riemhuman.surfaces.measures import edge_lengths
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.surfaces.template import Template

_LIMB_JOINTS = ("shoulder", "elbow", "hip", "knee", "head")
# Joints of upper arms and thighs, and those of the limbs that they carry.
_CARRIERS = (
    ("left_shoulder", "left_elbow"),
    ("right_shoulder", "right_elbow"),
    ("left_hip", "left_knee"),
    ("right_hip", "right_knee"),
)


@dataclass(frozen=True, eq=False)
class ShownParts:
    """What is known about the vertices of a registered body, (V,) each."""

    visible: Booleans  # such a scan can show them
    matched: Booleans  # they have counterparts in the scan
    lost: Booleans  # they belong to limbs that the scan does not show
    seen: Booleans  # they are matched, or near those that are


def find_shown_parts(fitted: BodyFit, scan: PreparedScan) -> ShownParts:
    """Return which vertices are matched, are lost, and are seen."""
    body, fit = fitted.task.body, fitted.fit
    visible = body.find_visible(fit.model_points, scan.points, fitted.task.up)
    parts, template = body.parts, body.model.template
    near = fit.matches.distances < MATCHED_METRES
    matched = visible & near & (fit.matches.reliable > LEAST_RELIABLE)
    lost = find_lost_limbs(parts, fit.points, matched)
    seen = find_seen(template, fit.points, matched, scan) & visible & ~lost
    return ShownParts(visible, matched, lost, seen)


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
        limit=WIDEST_SPACING,
        min_only=True,
    )
    nearest = cKDTree(scan.points).query(points)[1]
    heights = np.einsum("nx,nx->n", points - scan.points[nearest], scan.normals[nearest])
    seen: Booleans = matched | (np.isfinite(distances) & (heights < TOUCHING_METRES))
    return seen


def find_lost_limbs(parts: BodyParts, points: Array, matched: Booleans) -> Booleans:
    """Return which vertices belong to limbs without which a body explains its scan as well.

    They match little of it, or little of what they match would be far from the rest of the body
    without them: they are fitted to points of other parts, or folded into the part above.
    """
    faces, own = parts.model.faces, np.ones(len(points), dtype=bool)
    joints = [k for k, name in enumerate(parts.names) if name.split("_")[-1] in _LIMB_JOINTS]
    for joint in joints:
        part, limb = parts.owners == joint, parts.vertices([joint])
        _, gaps = nearest_points(points[part], points, faces[~limb[faces].any(axis=1)])
        own[part] = matched[part] & (gaps > TOUCHING_METRES)
    is_lost = (parts.shares(matched) < LIMB_ELSEWHERE) | (parts.shares(own) < LEAST_OWN)
    return parts.vertices(joint for joint in joints if is_lost[joint])


def leave_out_lost_limbs(
    fitted: BodyFit, scan: PreparedScan, *, is_refused: bool
) -> tuple[BodyFit, ShownParts]:
    """Return a body fitted without the limbs that a scan does not show, and what it shows.

    A body that is refused anyway stays as it is, and so does one that explains the scan better with
    these limbs.
    """
    shown = find_shown_parts(fitted, scan)
    if is_refused or not (shown.lost & fitted.task.visible).any():
        return fitted, shown
    without = _fit_without(fitted, shown.lost)
    # If the limb is in the scan after all, its points are now far from the body.
    before, after = (_distances_from(body).mean() for body in (fitted, without))
    if after > (1.0 + LIMB_MARGIN) * before:
        return fitted, shown
    return without, find_shown_parts(without, scan)


def _fit_without(fitted: BodyFit, lost: Booleans) -> BodyFit:
    """Return a body fitted again, and its elastic step, without some vertices."""
    task, visible = fitted.task, fitted.task.visible & ~lost
    samples = task.samples.showing(visible)
    # A scan hardly shows how what carries a lost limb is rotated about itself: the limb had said
    # so alone, wherever it was.
    local, expected = fitted.fit.pose.local.copy(), task.prior.local.copy()
    for carrier, end in _find_carriers(task.body.parts, lost):
        local[carrier] = expected[carrier] = _with_usual_twist(task, local, carrier, end)
    task = replace(
        task, visible=visible, samples=samples, prior=task.prior._replace(local=expected)
    )
    start = fitted.fit.pose._replace(local=local)
    pose = fit_closest(samples, start, task.prior, task.scan, DENSE_SCALES)
    return replace(fitted, task=task, fit=leave_model(task, pose))


def _find_carriers(parts: BodyParts, lost: Booleans) -> list[tuple[int, int]]:
    """Return the joints of upper arms and thighs that carry lost limbs, and those of the limbs."""
    carriers = []
    for names in _CARRIERS:
        joints = parts.numbers(*names)
        if len(joints) == 2:
            is_lost = [bool(lost[parts.owners == joint].any()) for joint in joints]
            if is_lost == [False, True]:
                carriers.append((joints[0], joints[1]))
    return carriers


def _with_usual_twist(task: DenseTask, local: Array, carrier: int, end: int) -> Array:
    """Return a joint's rotation, twisted about its bone as in the start pose that is nearest."""
    rest = task.samples.skeleton.rest_joints
    bone = unit_vectors(rest[end] - rest[carrier])
    direction = local[carrier] @ bone
    nearest = max(
        (pose[carrier] for pose in task.body.poses.values()),
        key=lambda rotation: float(rotation @ bone @ direction),
    )
    change = Rotation.from_matrix(local[carrier].T @ nearest).as_quat()
    # The twist of a rotation about an axis keeps only that part of its quaternion.
    twist = np.append((change[:3] @ bone) * bone, change[3])
    twisted: Array = local[carrier] @ Rotation.from_quat(twist).as_matrix()
    return twisted


def _distances_from(fitted: BodyFit) -> Array:
    """Return the distances of some points of a scan from a body, limited, metres."""
    points = fitted.task.scan.points
    some = points[even_points(points, N_DENSE)]
    _, distances = nearest_points(some, fitted.fit.points, fitted.task.body.model.faces)
    limited: Array = np.minimum(distances, fitted.task.scan.near_metres)
    return limited
