r"""The standard pose: a fitted body model, and what of a body's difference from it is the pose's.

The difference of a body from its fit, in the axes of the unposed body, is taken as the sum of two
smooth random fields and noise. The first belongs to the person. The second belongs to the pose:
flesh moves near bent joints in ways that the model lacks, in proportion to the angles. With their
covariances S and P over vertices,

.. math:: P_{vw} = p(v, w) \sum_j \theta_j^2 \, n_j(v) \, n_j(w),

the angles θ from the standard pose and the nearness n of vertices to joints, the parameters of the
model are found by generalized least squares with S + P + σ² I, and of what is left, the second
field is predicted as in kriging and taken away. Ordinary least squares would instead turn joints to
explain flesh.

What a pose changes about the flesh differs from scan to scan, so that the mean of several scans of
one person repeats better than each.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, ArrayLike, Booleans, Integers
from riemhuman.bodies import BodyModel, joints_between
from riemhuman.bodies.skinning import JointMotions, Skeleton, skinning_derivatives
from riemhuman.checks import checked, instance, mask, real_array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.rotations import nearest_rotations
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.solvers import ShapeTransfer

# Weight of the coefficients of hand poses in the fit, square metres. Fists are fitted, too: with
# relaxed hands, they would rotate the wrists.
_HANDS_PRIOR = 1e-6
# Fields of the person and of the pose: standard deviations in metres by the length over which
# vertices are alike, metres. Those of the pose are at a bend of one radian, next to the joint. All
# of these were chosen on simulated people.
_PERSON = {0.07: 0.007, 0.2: 0.015}
_POSE = {0.04: 0.012, 0.08: 0.012}
# How far from a joint its rotation changes the flesh, metres.
_REACH_OF_JOINTS = 0.15
# Noise of vertices, metres.
_NOISE = 0.002
# Inverse variances of how far coefficients of shape and of hands are from their first fit.
_SHAPE_PRECISION, _HANDS_PRECISION = 0.1, 0.05
# How many vertices decide, at most, and how many of these a field at any other follows.
_MOST_VERTICES, _NEIGHBOURS = 1300, 12
# Keeps systems of close neighbours regular, square metres.
_ROUNDING = 4e-9
# Uneven bends of a spine, root of the sum of their squares in radians, that poses can have.
_BENDS_OF_POSES = np.radians(7.0)
# Weight of what a scan did not show, beside what it did: where no scan shows the body, all count.
_UNSEEN = 0.01
# Length over which one scan gives way to the others where it did not show the body, metres.
_SEAM_METRES = 0.03


@checked(definitions=instance(MeasurementSet))
def in_standard_pose(definitions: MeasurementSet, points: Array) -> Array:
    """Return bodies in the standard pose, along the axes of the body model, shape (..., V, 3).

    The body model is fitted to each body, hands included. The difference between the body and its
    fit has two parts: one is the person's, the other is how flesh moves with the pose, above all
    near bent joints. `riemhuman.solvers.ShapeTransfer` transfers the person's part to the fitted
    person in the standard pose, with relaxed hands: triangles stretch by the same amounts, along
    axes that rotate with them. If the fit bends the spine unevenly, forward and back, these bends
    are kept: they belong to the shape of the person, though the model explains them as posture.

    On three sets of simulated people whose flesh moves with the pose, the median measurement of a
    person varies over poses by 5.0 to 5.4 mm, and by 7.0 to 10.5 if the whole difference from an
    ordinary fit is transferred; slopes against the same person made in the standard pose are 0.97
    to 1.00 both ways (tests/benchmarks/test_measurements.py). This flesh moves in proportion to the
    bends of joints nearby, as is assumed here; on real people it was not measured.

    Parameters
    ----------
    definitions : MeasurementSet
        Measurements of a body model, with the standard pose.
    points : array, shape (..., V, 3)
        Bodies, metres.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measurements = rh.measurements.Measurements(bodies.model)
    >>> straight = rh.measurements.in_standard_pose(measurements.definitions, bodies[3])
    >>> straight.shape
    (1202, 3)
    """
    model = definitions.model
    if model is None:
        raise ArgumentError(
            'pose="standard" needs a body model, whose fit removes the pose; found a surface'
        )
    points = real_array(points, "points", (definitions.n_vertices, 3))
    hands_prior = _HANDS_PRIOR if model.hand_directions.shape[-1] else None
    fit = model.fit(points, weights=model.template.vertex_areas, hands_prior=hands_prior)
    standard_pose = definitions.standard_pose_vector
    fields, transfer = _fields(model, tuple(standard_pose.ravel().tolist())), ShapeTransfer()
    straight = np.empty_like(points)
    for index in np.ndindex(points.shape[:-2]):
        shapes = fit.betas[index]
        if fit.hands is not None:
            shapes = np.concatenate([shapes, fit.hands[index]])
        rotations = Rotation.from_rotvec(fit.pose[index])
        flesh = fields.flesh(rotations)
        motions = JointMotions(fields.skeleton, rotations.as_matrix(), shapes)
        motions, trans = fields.refit(motions, fit.trans[index], flesh, points[index])
        fitted, detail = fields.detail_of_person(motions, trans, flesh, points[index])
        pose = Rotation.from_matrix(motions.local).as_rotvec()
        target = model(motions.betas[: model.n_betas], _standard_pose_of(definitions, pose))
        straight[index] = transfer.solve(definitions.space, fitted, fitted + detail, target)
    return straight


@checked(definitions=instance(MeasurementSet))
def person_in_standard_pose(
    definitions: MeasurementSet,
    points: ArrayLike,
    *,
    trusted_vertices: ArrayLike | None = None,
) -> Array:
    """Return the body in the standard pose that several scans of one person have in the mean.

    Each scan is brought into the standard pose alone, by `in_standard_pose`; where a scan does not
    show the body, the others count. What a pose changes about the flesh differs from scan to scan,
    so that it cancels in part. On simulated people whose flesh moves in ways that the body model
    lacks, the median measurement of a person varies by 4.7 mm over poses with one scan, 3.5 with
    two and 2.3 with four, at slopes of 0.95 to 0.97 against the person made in the standard pose;
    on natural simulated people by 2.6, 1.9 and 1.3 mm (tests/benchmarks/test_several_scans.py).
    How much real people gain was not measured.

    One shape of the body model for all scans, with a pose for each, was tried in place of the mean,
    and repeated no better.

    Scans of different visits must not be mixed, because a change would be averaged away:
    `compare_visits` takes the scans of each visit.

    Parameters
    ----------
    definitions : MeasurementSet
        Measurements of a body model, with the standard pose.
    points : array_like, shape (n_scans, V, 3)
        Registered scans of one person at one visit, best in different poses, metres.
    trusted_vertices : array_like of bool, shape (n_scans, V), optional
        What each scan shows, such as `rh.registration.RegisteredScan.trusted_vertices`.

    Returns
    -------
    array, shape (V, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> definitions = rh.measurements.open_measurements(bodies.model)
    >>> rh.measurements.person_in_standard_pose(definitions, bodies.points[:3]).shape
    (1202, 3)
    """
    points = real_array(points, "points", ("n_scans", definitions.n_vertices, 3), batched=False)
    if not len(points):
        raise ArgumentError("points must hold at least one scan; found none")
    straight = in_standard_pose(definitions, points)
    if trusted_vertices is None:
        return np.asarray(straight.mean(axis=0))
    trusted = mask(trusted_vertices, "trusted_vertices", (points.shape[:2],))
    weights = _smooth_weights(definitions, trusted)
    return np.asarray(np.einsum("kv,kvx->vx", weights, straight) / weights.sum(axis=0)[:, None])


def _smooth_weights(definitions: MeasurementSet, trusted: Booleans) -> Array:
    """Return how much each scan counts at each vertex, shape (n_scans, V).

    At the edge of what it shows, a scan gives way to the others gradually: where two scans differ
    by millimetres, a sharp edge would leave a step.
    """
    flow = definitions.surface.vertex_heat.step(_SEAM_METRES**2)
    shown: Array = np.array([flow @ row for row in trusted.astype(float)])
    # Trusted vertices lose weight near the edge, and others gain none.
    weights: Array = np.maximum(np.clip(2.0 * shown - 1.0, 0.0, 1.0), _UNSEEN)
    return weights


@dataclass(frozen=True, eq=False)
class _Flesh:
    """What bent joints do to the flesh: the covariance P, and Cholesky's factor of S + P + σ² I."""

    covariance: Array
    factor: tuple[Array, bool]


class _Fields:
    """The random fields of what bodies differ from a body model by."""

    def __init__(self, model: BodyModel, standard_pose: Array) -> None:
        self.model, self.standard_pose = model, Rotation.from_rotvec(standard_pose)
        self.skeleton = Skeleton(model, with_hands=True)
        rest = model.template.vertices
        self.chosen = _spread_vertices(rest, _MOST_VERTICES)
        places, weights = rest[self.chosen], model.weights[self.chosen]
        to_joints = cdist(places, model.joints())
        # A hand beside the hip does not change when the hip bends.
        has_parent = model.parents >= 0
        follows = weights + np.where(has_parent, weights[:, model.parents], 0.0)
        nearness = np.exp(-0.5 * (to_joints / _REACH_OF_JOINTS) ** 2)
        self.nearness = nearness * np.minimum(2.0 * follows, 1.0) * has_parent
        squares = cdist(places, places, "sqeuclidean")
        person, self.pose = (_covariances(squares, field) for field in (_PERSON, _POSE))
        self.person_and_noise = person + _NOISE**2 * np.eye(len(places))
        # A field at any vertex follows from those at the nearest of the chosen ones.
        gaps, self.nearest = cKDTree(places).query(rest, min(_NEIGHBOURS, len(places)))
        system = person[self.nearest[:, :, np.newaxis], self.nearest[:, np.newaxis]]
        system += _ROUNDING * np.eye(gaps.shape[1])
        to_nearest = _covariances(gaps**2, _PERSON)
        self.shares_of_nearest = np.linalg.solve(system, to_nearest[..., np.newaxis])[..., 0]
        n_hands = self.skeleton.n_betas - model.n_betas
        self.precisions = np.repeat(
            [0.0, _SHAPE_PRECISION, _HANDS_PRECISION, 0.0],
            [3 * model.n_joints, model.n_betas, n_hands, 3],
        )

    def flesh(self, rotations: Rotation) -> _Flesh:
        """Return what bent joints do to the flesh."""
        bends = self.nearness * (self.standard_pose.inv() * rotations).magnitude()
        covariance = self.pose * (bends @ bends.T)
        return _Flesh(covariance, cho_factor(self.person_and_noise + covariance))

    def refit(
        self, motions: JointMotions, trans: Array, flesh: _Flesh, points: Array
    ) -> tuple[JointMotions, Array]:
        """Return motions and translation after one step of generalized least squares."""
        chosen, n_angles = self.chosen, 3 * self.model.n_joints
        weights, directions = self.model.weights[chosen], self.skeleton.directions[chosen]
        shaped, blended, moved = self.skinned(motions, chosen)
        # How pose offsets change in this one step is left out.
        rows = skinning_derivatives(
            motions, shaped, blended, weights, directions, self.skeleton.below
        )
        unposed = np.swapaxes(nearest_rotations(blended), -1, -2)
        gaps = np.einsum("vab,vb->va", unposed, points[chosen] - moved - trans)
        rows = unposed @ rows
        weighted = cho_solve(flesh.factor, rows.reshape(len(chosen), -1)).reshape(rows.shape)
        matrix = np.einsum("vap,vaq->pq", rows, weighted, optimize=True)
        matrix += np.diag(self.precisions)
        # By least squares: a joint that moves nothing stays.
        step = np.linalg.lstsq(matrix, np.einsum("vap,va->p", weighted, gaps), rcond=1e-12)[0]
        # First all rotations about x, then y, then z, each in space.
        turns = Rotation.from_rotvec(step[:n_angles].reshape(3, -1).T).as_matrix()
        local = np.swapaxes(motions.axes, -1, -2) @ turns @ motions.axes @ motions.local
        shapes = motions.betas + step[n_angles:-3]
        return JointMotions(self.skeleton, local, shapes), trans + step[-3:]

    def detail_of_person(
        self, motions: JointMotions, trans: Array, flesh: _Flesh, points: Array
    ) -> tuple[Array, Array]:
        """Return the fitted body, and what of the difference from it is the person's, (V, 3)."""
        _, blended, moved = self.skinned(motions, np.arange(len(points)))
        fitted = moved + trans
        # Where joints turn by half a turn, blends of their rotations are singular.
        turned = nearest_rotations(blended)
        gaps = np.einsum("vba,vb->va", turned, points - fitted)
        pose = flesh.covariance @ cho_solve(flesh.factor, gaps[self.chosen])
        gaps -= np.einsum("vk,vkx->vx", self.shares_of_nearest, pose[self.nearest])
        return fitted, np.einsum("vab,vb->va", turned, gaps)

    def skinned(self, motions: JointMotions, vertices: Integers) -> tuple[Array, Array, Array]:
        """Return `JointMotions.skin` of some vertices."""
        model = self.model
        posedirs = None if model.posedirs is None else model.posedirs[vertices]
        return motions.skin(
            model.template.vertices[vertices],
            self.skeleton.directions[vertices],
            posedirs,
            model.weights[vertices],
        )


@lru_cache(maxsize=4)
def _fields(model: BodyModel, standard_pose: tuple[float, ...]) -> _Fields:
    # Setting them up takes longer than a body, and sets of measurements may share a model.
    return _Fields(model, np.reshape(standard_pose, (-1, 3)))


def _covariances(squares: Array, field: dict[float, float]) -> Array:
    """Return covariances of a field, by squared distances."""
    terms = (std**2 * np.exp(-0.5 * squares / length**2) for length, std in field.items())
    return np.asarray(sum(terms))


def _spread_vertices(vertices: Array, count: int) -> Integers:
    """Return numbers of vertices that are spread evenly: each is the farthest from those before."""
    if len(vertices) <= count:
        return np.arange(len(vertices))
    chosen = np.zeros(count, dtype=np.int64)
    gaps = np.full(len(vertices), np.inf)
    for number in range(1, count):
        from_last = vertices - vertices[chosen[number - 1]]
        gaps = np.minimum(gaps, np.einsum("vx,vx->v", from_last, from_last))
        chosen[number] = gaps.argmax()
    return chosen


def _standard_pose_of(definitions: MeasurementSet, fitted: Array) -> Array:
    """Return the standard pose, with the uneven bends of a fitted spine between upright ends."""
    pose = definitions.standard_pose_vector.copy()
    assert definitions.model is not None
    names = definitions.model.joint_names
    left = definitions.axes[:, 0]
    frame = [names.index(name) for name in definitions.frame if name in names]
    spine = joints_between(definitions.model.parents, *frame[:2])[1:-1] if len(frame) == 4 else []
    if not spine:
        return pose
    bends = fitted[spine] @ left
    bends -= bends.mean()
    # The shrinkage of James and Stein: no bends remain where poses explain them.
    bends *= max(0.0, 1.0 - _BENDS_OF_POSES**2 / max(bends @ bends, np.finfo(float).tiny))
    # The trunk as a whole is upright, and the legs stand as in the standard pose.
    tilt = -np.mean(np.cumsum([0.0, *bends])) * left
    pose[spine] += bends[:, np.newaxis] * left
    pose[frame[0]] += tilt
    hips = Rotation.from_rotvec(-tilt) * Rotation.from_rotvec(pose[frame[2:]])
    pose[frame[2:]] = hips.as_rotvec()
    return pose
