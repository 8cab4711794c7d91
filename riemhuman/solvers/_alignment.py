"""Rigid motions of end points and members that a metric ignores, removed and restored.

A basis holds deformations in space: a body that faces another way is out of its reach. Where a
metric is invariant under rotations and translations of each of two surfaces, solvers therefore move
one onto the other first, and turn what they have found back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, Points, TangentVectors
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import surface_space
from riemhuman.kernels.drift import centroid, least_squares_motions, rigid_motions

# Motions by less than this share of the body's size are ignored: if bodies already stand alike,
# solvers receive exactly the points that they are given.
_STILL = 1e-3

# Ends of logarithms that are turned by less stay as they are, and so does the exponential's end: it
# follows small rotations of its velocity.
_FACES_AWAY = np.radians(30.0)

# Rounds of alignment with the average; after these, it hardly moves.
_ROUNDS = 3


def ignores_rigid_motions(metric: RiemannianMetric) -> bool:
    """Return whether a metric of surfaces ignores how each of them is placed and turned."""
    return bool(
        metric.space.is_surface_space
        and metric.is_translation_invariant
        and metric.is_rotation_invariant
    )


@dataclass(frozen=True)
class AlignedEnds:
    """Two ends of a path, the second moved onto the first if the metric ignores that.

    With x ↦ (x − c) Q + c + b for the motion that takes the second end, of centroid c, to where the
    first is, a path between the aligned ends is turned back by a uniform rotation: the point at
    time t turns by Q^(−t) about its own centroid and moves by −t b.
    """

    start: Points
    end: Points
    given_end: Points
    are_moved: bool
    # The motion of the end: a rotation vector for row vectors, and the shift of the centroid.
    turn: Array
    shift: Array
    weights: Array

    def turned_back(self, path: Points) -> Array:
        """Return a path between the aligned ends as one between the given ends."""
        return self._turned(path, -1.0, self.given_end)

    def aligned(self, path: Points) -> Array:
        """Return a path between the given ends as one between the aligned ends."""
        return self._turned(path, 1.0, self.end)

    def vectors_turned_back(self, vectors: TangentVectors) -> Array:
        """Return tangent vectors along a path between the aligned ends, turned with its points."""
        return vectors @ self._rotations(len(vectors), -1.0) if self.are_moved else vectors

    def _turned(self, path: Points, sign: float, end: Points) -> Array:
        if not self.are_moved:
            return path
        centroids = centroid(path, self.weights)
        times = np.linspace(0.0, 1.0, len(path))[:, None, None]
        turned: Points = (path - centroids) @ self._rotations(len(path), sign)
        turned += centroids + sign * times * self.shift
        turned[0], turned[-1] = path[0], end
        return turned

    def _rotations(self, n_nodes: int, sign: float) -> Array:
        times = np.linspace(0.0, 1.0, n_nodes)[:, None]
        rotations: Array = Rotation.from_rotvec(sign * times * self.turn).as_matrix()
        return rotations


@dataclass(frozen=True)
class AlignedMembers:
    """Points moved onto their average, and with it onto the template; and the way back."""

    points: Points
    # The motion x ↦ x R + b of the point that shows how a mean stands, if points are moved.
    turn: Array | None = None
    shift: Array | None = None

    def aligned(self, point: Points) -> Array:
        """Return a point that stands as the mean should, moved to where the points are."""
        if self.turn is None or self.shift is None:
            return point
        return point @ self.turn + self.shift

    def turned_back(self, point: Points) -> Array:
        if self.turn is None or self.shift is None:
            return point
        return (point - self.shift) @ self.turn.T


def align_members(
    metric: RiemannianMetric, points: Points, weights: Array, model: Array
) -> AlignedMembers:
    """Return points moved where the metric allows it; means then stand as `model` does.

    A basis lies in space as the template does, and so do the points: no member's heading counts.
    """
    if not ignores_rigid_motions(metric):
        return AlignedMembers(points)
    template = surface_space(metric.space).template
    target = template.vertices
    for _ in range(_ROUNDS):
        turns, shifts = least_squares_motions(points, target, template.vertex_areas)
        moved = points @ turns + shifts
        target = np.tensordot(weights, moved, axes=1)
    turns, shifts = least_squares_motions(model[None], target, template.vertex_areas)
    return AlignedMembers(moved, turns[0], shifts[0])


def turn_from_template(metric: RiemannianMetric, ends: AlignedEnds) -> Array:
    """Return the rotation, for row vectors, from how the template stands to how a path's ends do.

    It is the identity if the metric does not ignore it, or if they already stand alike.
    """
    if not ignores_rigid_motions(metric):
        return np.eye(3)
    template = surface_space(metric.space).template
    middle = 0.5 * (ends.start + ends.end)
    turns, _ = least_squares_motions(middle[None], template.vertices, template.vertex_areas)
    turn: Array = turns[0].T
    moved = template.vertices @ (turn - np.eye(3))
    is_still = np.abs(moved).max() <= _STILL * np.ptp(template.vertices, axis=0).max()
    return np.eye(3) if is_still else turn


def end_of_logarithm(metric: RiemannianMetric, start: Points, end: Points) -> Array:
    """Return the end of a path, moved onto the start if it faces away and the metric allows it."""
    aligned = align_ends(metric, start, end)
    return aligned.end if np.linalg.norm(aligned.turn) > _FACES_AWAY else end


def ends_as_given(start: Points, end: Points) -> AlignedEnds:
    """Return the ends of a path that stay where they are."""
    return AlignedEnds(
        start, end, end, are_moved=False, turn=np.zeros(3), shift=np.zeros(3), weights=np.ones(1)
    )


def align_ends(metric: RiemannianMetric, start: Points, end: Points) -> AlignedEnds:
    """Return the ends of a path, the second moved onto the first if the metric allows it."""
    if not ignores_rigid_motions(metric):
        return ends_as_given(start, end)
    weights = surface_space(metric.space).template.vertex_areas
    turns, shifts = rigid_motions(end[None], start, weights, rotations=True)
    moved = end @ turns[0] + shifts[0]
    if np.abs(moved - end).max() <= _STILL * np.ptp(start, axis=0).max():
        return ends_as_given(start, end)
    shift = (centroid(moved, weights) - centroid(end, weights))[0]
    turn = Rotation.from_matrix(turns[0]).as_rotvec()
    return AlignedEnds(start, moved, end, are_moved=True, turn=turn, shift=shift, weights=weights)
