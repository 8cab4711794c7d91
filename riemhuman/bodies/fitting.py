"""Fits of a body model to registered surfaces: shape, pose and translation.

The start has a closed form: the rotation of each joint by Kabsch's solution with the skinning
weights, then betas and translation by linear least squares. The steps from there are those of
Levenberg and Marquardt, on some 1,500 points and then on all. `scipy.optimize.least_squares` would
need the derivatives of all residuals as one matrix, some 40,000 by 90 for a body. The normal
equations need it only patch by patch, and most patches depend on few joints.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeGuard

import numpy as np
from scipy import linalg, sparse
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array, ArrayLike, Integers, Points
from riemhuman.bodies.skinning import JointMotions, Skeleton, skinning_derivatives
from riemhuman.checks import (
    check_resolution,
    check_same_scale,
    checked,
    flag,
    index_array,
    longest_side,
    positive,
    real,
    real_array,
    refuse_type,
    values_of,
    weight_shares,
    whole,
)
from riemhuman.errors import ArgumentError, ConvergenceWarning, warn
from riemhuman.kernels.rotations import nearest_rotations, rotation_derivative, rotation_matrix
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.representation import Record
from riemhuman.surfaces.template import Template, check_body_sizes

if TYPE_CHECKING:
    from riemhuman.bodies.body_model import BodyModel

# The first stage uses about this number of points in all, and at least this number for each joint.
_FEW_POINTS = 1500
_FEWEST_OF_A_JOINT = 20
_CLOSED_FORM_ROUNDS = 2
# A fit from the previous one is dropped if it takes more steps, or is this factor farther.
_WARM_STEPS, _WARM_LOSS = 12, 1.5
# Damping of the steps, as a share of the diagonal: where steps start and go back to, what the first
# step that fails continues from, and where the fit gives up.
_LEAST_DAMPING = 1e-9
_FIRST_DAMPING = 1e-5
_MOST_DAMPING = 1e6
# A short step ends a fit only if its damping is less: with more, all steps are short.
_TRUSTED_DAMPING = 1.0
# A gain below this share of the cost is indistinguishable from rounding.
_ROUNDING = 1e-13

# Number of points in a patch: their derivatives fit in the processor's cache, and most patches
# depend on few joints, so that most columns are left out.
_PATCH = 512
# Weight of the parent's rotation as a share of a joint's spread: enough to determine what the
# points leave open, too little to matter elsewhere.
_PULL = 1e-3

# _CROSS_WITH_AXES[c] @ x is the cross product of the axis c with x.
_CROSS_WITH_AXES = np.cross(np.eye(3)[:, np.newaxis], np.eye(3)).transpose(0, 2, 1)

# Rows of a correspondence sum to one within this; barycentric coordinates in files are rounded.
_SUM_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class ModelFit(Record):
    """Parameters of a body model that were fitted to surfaces.

    Attributes
    ----------
    betas : array, shape (..., B)
        Shape coefficients.
    pose : array, shape (..., J, 3)
        Axis-angle rotation of each joint, radians, by at most half a turn.
    trans : array, shape (..., 3)
        Translation, metres.
    distances : array, shape (..., n_points)
        Distance of each point from its place on the model, metres.
    converged : array of bool, shape (...)
        Whether the fit of each surface converged.
    n_iterations : array of int, shape (...)
        Gauss–Newton steps, both stages together.
    hands : array, shape (..., 2 K), or None
        Coefficients of the hand poses, if they were fitted.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> bool(bodies.model.fit(bodies[0]).converged)
    True
    """

    betas: Array
    pose: Array
    trans: Array
    distances: Array
    converged: Array
    n_iterations: Array
    hands: Array | None = None

    @property
    def mean_distance(self) -> Array:
        """Mean distance of the points of each surface, metres, shape (...)."""
        means: Array = self.distances.mean(axis=-1)
        return means


# More than eight arguments: each setting of the fit is a keyword of the public method `fit`.
@checked(
    betas_prior=real(minimum=0.0),
    hands_prior=real(minimum=0.0),
    tolerance=positive,
    max_iter=whole(minimum=1),
    sequence=flag,
)
def fit_model(
    model: BodyModel,
    points: ArrayLike,
    *,
    correspondence: ArrayLike | sparse.csr_array | None = None,
    weights: ArrayLike | None = None,
    betas_prior: float = 0.0,
    hands_prior: float | None = None,
    tolerance: float = 1e-6,
    max_iter: int = 100,
    sequence: bool = False,
) -> ModelFit:
    """Find the shape, pose and translation of a body model for registered surfaces.

    Minimises Σ_i w_i ‖x_i(β, ω, t, η) − y_i‖² + b ‖β‖² + h ‖η‖² for each surface separately, with
    its points y, the model's points x, the weights w divided by their sum, and the priors b and h.

    Parameters
    ----------
    model : BodyModel
    points : array_like, shape (..., n_points, 3)
        Surfaces, metres. Whole surfaces smaller or larger than any human body raise an error,
        unless the model itself is not a body in metres.
    correspondence : array_like of int, pair, or sparse matrix, optional
        Place of each point on the model, as for `correspondence_matrix`.
    weights : array_like, shape (n_points,), optional
        Weights of the points, for example areas; equal by default.
    betas_prior : float
        Weight b, square metres: with 1e-6, a coefficient of 1 costs as much as 1 mm for all points.
    hands_prior : float, optional
        Weight h, square metres, of the coefficients η of the hand poses; by default, hands are
        relaxed.
    tolerance : float
        Root mean square movement of the points, metres, below which a fit has converged.
    max_iter : int
        Maximum number of steps in each stage of a fit.
    sequence : bool
        Whether the surfaces are consecutive frames of a motion: each fit then starts from the
        previous one.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> bool(bodies.model.fit(bodies[0]).mean_distance < 0.01)
    True
    """
    combine = correspondence_matrix(model, correspondence)
    surfaces = _surfaces_of(model, points, combine, whole=correspondence is None)
    with_hands = hands_prior is not None
    stages = _stages(
        Skeleton(model, with_hands=with_hands),
        combine,
        weight_shares(weights, combine.shape[0]),
        _priors(model, betas_prior, hands_prior),
    )
    lead = surfaces.shape[:-2]
    with single_threaded_libraries():  # the patches are too small to be shared between threads
        fits: list[ModelFit] = []
        for index in np.ndindex(lead):
            before = fits[-1] if sequence and fits and fits[-1].converged else None
            fits.append(_fit_after(stages, combine, surfaces[index], tolerance, max_iter, before))
    failed = [number for number, fit in enumerate(fits) if not fit.converged]
    if failed:
        warn(
            f"{len(failed)} of {len(fits)} fits, the first of surface {failed[0]}, did not "
            f"converge to within {tolerance:g} m in {max_iter} steps",
            ConvergenceWarning,
        )
    hands = None
    if with_hands:
        n_hands = len(model.hand_pose("relaxed"))
        hands = np.array([fit.hands for fit in fits]).reshape((*lead, n_hands))
    return ModelFit(
        betas=np.array([fit.betas for fit in fits]).reshape((*lead, model.n_betas)),
        pose=np.array([fit.pose for fit in fits]).reshape((*lead, model.n_joints, 3)),
        trans=np.array([fit.trans for fit in fits]).reshape((*lead, 3)),
        distances=np.array([fit.distances for fit in fits]).reshape((*lead, combine.shape[0])),
        converged=np.array([fit.converged for fit in fits]).reshape(lead),
        n_iterations=np.array([fit.n_iterations for fit in fits]).reshape(lead),
        hands=hands,
    )


def _surfaces_of(
    model: BodyModel, points: ArrayLike, combine: sparse.csr_array, whole: bool
) -> Array:
    """Return the surfaces to fit, which have the model's unit and, if whole, a body's size."""
    surfaces = real_array(points, "points", ("n_points", 3))
    n_points = combine.shape[0]
    if surfaces.shape[-2] != n_points:
        what = "the model's vertices" if whole else "the rows of correspondence"
        raise ArgumentError(
            f"points must have one point for each of {what}, {n_points}; found {surfaces.shape}"
        )
    check_resolution(surfaces, "points")
    check_same_scale(
        surfaces,
        longest_side(combine @ model.template.vertices),
        "points",
        "the model",
        remedy="a fit needs points in the unit of the model",
    )
    if whole:
        check_body_sizes(surfaces, model.template, "points")
    return surfaces


def _priors(model: BodyModel, betas_prior: float, hands_prior: float | None) -> Array:
    """Return the weight of the prior of each parameter: pose, betas, hands and translation."""
    in_pose = np.zeros(3 * model.n_joints)
    in_betas = np.full(model.n_betas, betas_prior)
    in_hands = np.zeros(0)
    if hands_prior is not None:
        in_hands = np.full(len(model.hand_pose("relaxed")), hands_prior)
    return np.concatenate([in_pose, in_betas, in_hands, np.zeros(3)])


def correspondence_matrix(
    model: BodyModel | Template,
    correspondence: ArrayLike | tuple[ArrayLike, ArrayLike] | sparse.csr_array | None = None,
) -> sparse.csr_array:
    """Return the matrix (n_points, V) from a model's vertices to the points of a correspondence.

    Parameters
    ----------
    model : BodyModel or Template
        The model, or any mesh.
    correspondence : array_like of int, pair, or sparse matrix, optional
        Indices of vertices, shape (n_points,); or a pair of indices of triangles, shape
        (n_points,), and barycentric coordinates, shape (n_points, 3); or a matrix, shape (n_points,
        V), whose rows sum to one. By default every vertex is a point.

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> centres = rh.bodies.correspondence_matrix(model, ([0, 1], [[1 / 3, 1 / 3, 1 / 3]] * 2))
    >>> (centres @ model.template.vertices).shape
    (2, 3)
    """
    if not isinstance(getattr(model, "n_vertices", None), int):
        refuse_type(model, "model", "a BodyModel or a Template")
    n_vertices = model.n_vertices
    if correspondence is None:
        return sparse.eye_array(n_vertices, format="csr")
    if sparse.issparse(correspondence):
        matrix = sparse.csr_array(correspondence)
        matrix = matrix.astype(np.float64)
        if matrix.shape[1] != n_vertices:
            raise ArgumentError(
                f"correspondence must have shape (n_points, {n_vertices}); found {matrix.shape}"
            )
        matrix.sum_duplicates()
        _check_sums(matrix)
        return matrix
    if _is_pair_of_arrays(correspondence):
        triangles, coordinates = correspondence
        matrix = _barycentric_matrix(model, triangles, coordinates)
        _check_sums(matrix)
        return matrix
    vertices = index_array(correspondence, "correspondence", ("n_points",), n_vertices)
    return sparse.csr_array(sparse.eye_array(n_vertices, format="csr")[vertices])


def _is_pair_of_arrays(
    correspondence: ArrayLike | tuple[ArrayLike, ArrayLike],
) -> TypeGuard[tuple[ArrayLike, ArrayLike]]:
    """Return whether a correspondence is two arrays, rather than the numbers of two vertices."""
    if not isinstance(correspondence, Sequence) or len(correspondence) != 2:
        return False
    return values_of(correspondence[0], "correspondence[0]").ndim > 0


def _barycentric_matrix(
    model: BodyModel | Template, triangles: ArrayLike, coordinates: ArrayLike
) -> sparse.csr_array:
    """Return the matrix from vertices to points in triangles, given by barycentric coordinates."""
    name, n_faces = "triangles of correspondence", len(model.faces)
    triangles = index_array(triangles, name, ("n_points",), n_faces)
    n_points = len(triangles)
    coordinates = real_array(
        coordinates, "barycentric coordinates of correspondence", (n_points, 3), batched=False
    )
    rows = np.repeat(np.arange(n_points), 3)
    entries = (coordinates.ravel(), (rows, model.faces[triangles].ravel()))
    return sparse.csr_array(entries, shape=(n_points, model.n_vertices))


def _check_sums(matrix: sparse.csr_array) -> None:
    """Raise an error unless the rows of a correspondence sum to one."""
    sums = matrix.sum(axis=1)
    if not np.isfinite(matrix.data).all() or (np.abs(sums - 1.0) > _SUM_TOLERANCE).any():
        worst = int(np.argmax(np.abs(sums - 1.0)))
        raise ArgumentError(
            f"correspondence must have rows that sum to one; row {worst} sums to {sums[worst]:g}"
        )


def _stages(
    skeleton: Skeleton, combine: sparse.csr_array, shares: Array, prior: Array
) -> list[_Equations]:
    """Return the equations of some of the points, unless that is most, and those of all."""
    # By the joint that moves them most, so that neighbours depend on few joints.
    main = np.where(shares > 0, (combine @ skeleton.model.weights).argmax(axis=1), -1)
    of_joints = [np.flatnonzero(main == joint) for joint in skeleton.order]
    everything = np.concatenate(of_joints)
    few = np.concatenate([_spread_out(numbers, len(everything)) for numbers in of_joints])
    stages = (few, everything) if len(few) < len(everything) else (everything,)
    return [_Equations(skeleton, combine, shares, numbers, prior) for numbers in stages]


def _fit_after(
    stages: list[_Equations],
    combine: sparse.csr_array,
    target: Points,
    tolerance: float,
    max_iter: int,
    before: ModelFit | None,
) -> ModelFit:
    """Return the fit that starts from another one, unless it does not come as near."""
    if before is not None:
        n_steps = min(_WARM_STEPS, max_iter)
        fit = _fit(stages, combine, target, tolerance, n_steps, before)
        if fit.converged and fit.mean_distance < _WARM_LOSS * before.mean_distance:
            return fit
    return _fit(stages, combine, target, tolerance, max_iter)


def _fit(
    stages: list[_Equations],
    combine: sparse.csr_array,
    target: Points,
    tolerance: float,
    max_iter: int,
    before: ModelFit | None = None,
) -> ModelFit:
    """Return the fit to one surface, started from another fit or from the closed form."""
    if before is None:
        parameters = _start(stages[0], target)
    else:
        hands = np.zeros(0) if before.hands is None else before.hands
        parts = (before.pose.ravel(), before.betas, hands, before.trans)
        parameters = np.concatenate(parts)
    n_iterations, converged = 0, False
    for stage in stages:
        parameters, steps, converged = _descend(stage, target, parameters, tolerance, max_iter)
        n_iterations += steps
    model = stages[0].skeleton.model
    ends = np.cumsum([3 * model.n_joints, model.n_betas])
    pose, betas, hands = np.split(parameters[:-3], ends)
    pose, trans = pose.reshape(-1, 3), parameters[-3:]
    gaps = combine @ model(betas, pose, trans, hands if hands.size else None) - target
    return ModelFit(
        betas=betas,
        pose=Rotation.from_rotvec(pose).as_rotvec(),
        trans=trans,
        distances=np.linalg.norm(gaps, axis=-1),
        converged=np.array(converged),
        n_iterations=np.array(n_iterations),
        hands=hands,
    )


def _start(equations: _Equations, target: Points) -> Array:
    """Return the closed-form start of a fit."""
    skeleton = equations.skeleton
    n_angles = 3 * skeleton.n_joints
    parameters = np.zeros(n_angles + skeleton.n_betas + 3)
    for _ in range(_CLOSED_FORM_ROUNDS):
        rotations = equations.closed_form_rotations(target, parameters[n_angles:-3])
        # Relative to the parent joint, and those of the root to nothing.
        is_limb = (skeleton.parents >= 0)[:, np.newaxis, np.newaxis]
        axes = np.where(is_limb, rotations[skeleton.parents], np.eye(3))
        pose = Rotation.from_matrix(axes.transpose(0, 2, 1) @ rotations).as_rotvec()
        parameters[:n_angles] = pose.ravel()
        matrix, right = equations.normal(parameters, target)
        parameters[n_angles:] += _least_squares_step(
            matrix[n_angles:, n_angles:], right[n_angles:], _LEAST_DAMPING
        )
    return parameters


def _descend(
    equations: _Equations,
    target: Points,
    parameters: Array,
    tolerance: float,
    max_iter: int,
) -> tuple[Array, int, bool]:
    """Return the last parameters, the number of steps and whether they have converged."""
    damping = _LEAST_DAMPING
    cost = equations.cost(parameters, target)
    for n_steps in range(1, max_iter + 1):
        matrix, right = equations.normal(parameters, target)
        while True:
            step = _least_squares_step(matrix, right, damping)
            trial = parameters + step
            movement = np.sqrt(step @ matrix @ step)
            has_settled = movement < tolerance or step @ right < _ROUNDING * cost
            if damping < _TRUSTED_DAMPING and has_settled:
                return trial, n_steps, True
            trial_cost = equations.cost(trial, target)
            if trial_cost < cost:
                break
            damping = 10.0 * max(damping, _FIRST_DAMPING)
            if damping > _MOST_DAMPING:
                return parameters, n_steps, False
        parameters, cost = trial, trial_cost
        damping = max(damping / 10.0, _LEAST_DAMPING)
    return parameters, max_iter, False


def _spread_out(numbers: Integers, n_points: int) -> Integers:
    """Return a joint's share of the points of the first stage."""
    wanted = max(_FEWEST_OF_A_JOINT, len(numbers) * _FEW_POINTS // max(n_points, 1))
    if wanted >= len(numbers):
        return numbers
    return numbers[np.linspace(0, len(numbers) - 1, wanted).astype(np.int64)]


class _Patch:
    """Some points, the vertices that they combine, and the joints on which these depend."""

    def __init__(self, skeleton: Skeleton, combine: sparse.csr_array, numbers: Integers) -> None:
        model, rows = skeleton.model, combine[numbers]
        vertices = np.unique(rows.indices)
        self.points, self.combine = numbers, rows[:, vertices]
        # Where the points are vertices, as they are by default, nothing is combined.
        if len(vertices) == rows.nnz == len(numbers) and np.all(rows.data == 1.0):
            vertices, self.combine = rows.indices, None
        self.rest = model.template.vertices[vertices]
        self.shapedirs = skeleton.directions[vertices]
        self.posedirs = None if model.posedirs is None else model.posedirs[vertices]
        weights = model.weights[vertices]
        self.bones = np.flatnonzero(weights.any(axis=0))  # joints with weight here
        self.weights = weights[:, self.bones]
        below = skeleton.below[self.bones]
        # Joints that move something here; with pose offsets, all do.
        moves = below.any(axis=0) | (self.posedirs is not None)
        self.active = np.flatnonzero(moves)
        # Whether the bone moves with the joint, shape (bones, active).
        self.below = below[:, self.active]
        # The parameters on which the points depend: angles of active joints, betas, translation.
        n_angles = 3 * skeleton.n_joints
        angles = 3 * self.active + np.arange(3)[:, np.newaxis]
        others = np.arange(n_angles, n_angles + skeleton.n_betas + 3)
        self.columns = np.concatenate([angles.ravel(), others])

    def combined(self, values: Array) -> Array:
        """Map values at vertices, (n_vertices, ...), to values at points."""
        if self.combine is None:
            return values
        flat: Array = self.combine @ values.reshape(len(values), -1)
        return flat.reshape(-1, *values.shape[1:])

    def surface(self, motions: JointMotions) -> tuple[Array, Array, Array]:
        """Return the shaped vertices, their blended rotations and the moved vertices."""
        return motions.skin(self.rest, self.shapedirs, self.posedirs, self.weights, self.bones)

    def derivatives(self, motions: JointMotions, shaped: Array, rotations: Array) -> Array:
        """Return derivatives (n, 3, c) of the points by rotations in space, betas and trans."""
        rows = skinning_derivatives(
            motions,
            shaped,
            rotations,
            self.weights,
            self.shapedirs,
            self.below,
            self.bones,
            self.active,
        )
        if self.posedirs is not None:
            limbs = motions.skeleton.limbs
            # Derivatives Aᵀ [c]× G of the entries of R = Aᵀ G by small rotations about the axes c,
            # for each joint j.
            products = np.einsum(
                "jyx,cyz,jzw->cjxw", motions.axes[limbs], _CROSS_WITH_AXES, motions.rotations[limbs]
            ).reshape(3, len(limbs), 9)
            of_features = self.posedirs.reshape(*shaped.shape, -1, 9)
            # Sums over the nine entries k, for each vertex n and coordinate x.
            offsets = np.einsum("nxjk,cjk->nxcj", of_features, products, optimize=True)
            offsets = np.matmul(rotations, offsets.reshape(*shaped.shape, -1))
            # With pose offsets, all joints are active, in the order of the tree's table.
            columns = motions.skeleton.n_joints * np.arange(3)[:, np.newaxis] + limbs
            rows[..., columns.ravel()] += offsets
        return self.combined(rows)


class _Equations:
    """Least-squares equations for the points `combine[numbers]` of a model's surface."""

    def __init__(
        self,
        skeleton: Skeleton,
        combine: sparse.csr_array,
        shares: Array,
        numbers: Integers,
        prior: Array,
    ) -> None:
        self.skeleton, self._prior = skeleton, prior
        self._shares = shares / shares[numbers].sum()
        self._patches = [
            _Patch(skeleton, combine, numbers[first : first + _PATCH])
            for first in range(0, len(numbers), _PATCH)
        ]
        self._numbers = numbers
        self._weights = (combine @ skeleton.model.weights)[numbers]

    def _motions(self, parameters: Array) -> JointMotions:
        """Return the motions for parameters: axis-angle vectors of the joints, betas, trans."""
        pose, betas = np.split(parameters[:-3], [3 * self.skeleton.n_joints])
        return JointMotions(self.skeleton, rotation_matrix(pose.reshape(-1, 3)), betas)

    def cost(self, parameters: Array, target: Points) -> float:
        """Return the mean squared distance from the points to their targets, and the prior."""
        motions = self._motions(parameters)
        parts = [patch.combined(patch.surface(motions)[2]) for patch in self._patches]
        trans = parameters[-3:]
        gaps = target[self._numbers] - np.concatenate(parts) - trans
        squares = np.sum(gaps**2, axis=-1)
        return float(self._shares[self._numbers] @ squares + self._prior @ parameters**2)

    def normal(self, parameters: Array, target: Points) -> tuple[Array, Array]:
        """Return the normal equations: the matrix, and half the negative gradient of the cost."""
        motions = self._motions(parameters)
        n_angles, n_columns = 3 * self.skeleton.n_joints, len(parameters)
        matrix, right = np.zeros((n_columns, n_columns)), np.zeros(n_columns)
        trans = parameters[-3:]
        for patch in self._patches:
            shaped, rotations, moved = patch.surface(motions)
            gaps = target[patch.points] - patch.combined(moved) - trans
            factors = np.sqrt(self._shares[patch.points])
            rows = patch.derivatives(motions, shaped, rotations)
            rows *= factors[:, np.newaxis, np.newaxis]
            rows = rows.reshape(-1, rows.shape[-1])
            matrix[np.ix_(patch.columns, patch.columns)] += rows.T @ rows
            right[patch.columns] += rows.T @ (factors[:, np.newaxis] * gaps).ravel()
        # From changes of axis-angle vectors to rotations in space.
        of_pose = motions.axes @ rotation_derivative(parameters[:n_angles].reshape(-1, 3))
        change, angles = np.eye(n_columns), np.arange(n_angles).reshape(-1, 3)
        change[angles[:, :, np.newaxis], angles[:, np.newaxis]] = of_pose
        matrix, right = change.T @ matrix @ change, change.T @ right
        return matrix + np.diag(self._prior), right - self._prior * parameters

    def closed_form_rotations(self, target: Points, betas: Array) -> Array:
        """Return each joint's rotation in space by Kabsch's solution with the skinning weights."""
        shaped = [patch.combined(patch.rest + patch.shapedirs @ betas) for patch in self._patches]
        points, goal = np.concatenate(shaped), target[self._numbers]
        weights = self._weights * self._shares[self._numbers, np.newaxis]
        mass = np.maximum(weights.sum(axis=0), np.finfo(float).tiny)[:, np.newaxis]
        products = (goal[:, :, np.newaxis] * points[:, np.newaxis]).reshape(-1, 9)
        centres, goals = weights.T @ points / mass, weights.T @ goal / mass
        spread = (weights.T @ products / mass).reshape(-1, 3, 3)
        spread -= goals[:, :, np.newaxis] * centres[:, np.newaxis]
        size = weights.T @ np.sum(points**2, axis=-1) / mass[:, 0] - np.sum(centres**2, axis=-1)
        rotations: Array = np.empty_like(spread)
        for joint in self.skeleton.order:
            parent = self.skeleton.parents[joint]
            # The rotation of the parent, where the points do not determine the joint's own.
            known = rotations[parent] if parent >= 0 else np.eye(3)
            pull = _PULL * max(size[joint], 0.0) + np.finfo(float).eps
            rotations[joint] = nearest_rotations(spread[joint] + pull * known)
        return rotations


def _least_squares_step(matrix: Array, right: Array, damping: float) -> Array:
    """Return the step that solves damped normal equations."""
    scale = np.sqrt(np.diag(matrix))
    # A parameter without effect on the points does not change.
    scale[scale <= np.finfo(float).eps * scale.max(initial=0.0)] = np.inf
    system = matrix / np.outer(scale, scale) + np.diag(np.full(len(right), damping))
    system[np.isinf(scale), np.isinf(scale)] = 1.0
    step: Array = linalg.solve(system, right / scale, assume_a="pos")
    return step / scale
