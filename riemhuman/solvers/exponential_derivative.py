r"""Derivatives of discrete geodesics with respect to initial velocity and point: adjoint method.

For every three neighbours x, y, z on a discrete geodesic, y makes E = d²(x, y) + d²(y, z)
stationary, see `riemhuman.solvers.middle_equation`. Derivatives of a function with respect to z are
passed on to x and y, from the end to the start, by solving one linear equation with the second
derivatives of E for each point.
"""

from __future__ import annotations

from collections.abc import Callable

import autograd.numpy as np
from autograd import grad
from numpy import ndarray
from scipy.sparse.linalg import LinearOperator, lsmr

from riemhuman.errors import ConvergenceWarning, warn
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.solvers.preconditioner import CholeskyFactor
from riemhuman.solvers.spatial_factors import spatial_factor

_TOLERANCE = 1e-9
_MAX_ITER = 1000
_OUT_OF_ITERATIONS = 7  # as SciPy counts reasons to stop

# Which of the three points a shift moves: the last one, or both sides of the start.
_LAST = np.array([0.0, 0.0, 1.0])
_SIDES = np.array([1.0, 0.0, 1.0])


def derivatives_of_exponential(
    metric: RiemannianMetric, path: ndarray, velocity: ndarray, covectors: ndarray
) -> tuple[ndarray, ndarray]:
    r"""Return the derivatives of a function of a discrete geodesic, see the module.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on an open set of a vector space, such as surfaces.
    path : array, shape (n_nodes, \*shape)
        Discrete geodesic over unit time, with all coordinates free.
    velocity : array, shape (\*shape,)
        The initial velocity it was found for.
    covectors : array, shape (n_nodes, \*shape)
        Derivatives of the function with respect to the points.

    Returns
    -------
    by_velocity, by_start : array, shape (\*shape,)

    Warns
    -----
    ConvergenceWarning
        If a linear equation was not solved within the tolerance.
    """
    covectors = np.array(covectors)
    for last in range(len(path) - 1, 1, -1):
        # z = 2y − x + s.
        points = path[last - 2 : last + 1]
        by_x, by_y, by_z = _without_shift(metric, points, covectors[last], _LAST)
        covectors[last - 2] += by_x - by_z
        covectors[last - 1] += by_y + 2.0 * by_z
    displacement = velocity / (len(path) - 1)
    start, first = path[:2]
    # x = y − d + s and z = y + d + s.
    points = np.stack([first - 2.0 * displacement, start, first])
    by_x, by_y, by_z = _without_shift(metric, points, covectors[1], _SIDES)
    by_velocity = (by_z - by_x) / (len(path) - 1)
    return by_velocity, covectors[0] + by_x + by_y + by_z


def _without_shift(
    metric: RiemannianMetric, points: ndarray, covector: ndarray, moved: ndarray
) -> ndarray:
    """Return derivatives by x, y and z of a function of z, where s solves the equation.

    With the equation's multiplier μ the function g(z) − μ ∂E/∂y does not depend on s to first
    order.
    """
    shape = points.shape
    along = _second_derivatives(metric, points)

    def middle(vector: ndarray) -> ndarray:
        return np.stack([np.zeros(shape[1:]), vector, np.zeros(shape[1:])])

    def by_shift(multiplier: ndarray) -> ndarray:
        return np.tensordot(moved, along(middle(multiplier)), axes=1)

    def along_shift(shift: ndarray) -> ndarray:
        return along(np.tensordot(moved, shift, axes=0))[1]

    factor = spatial_factor(metric, points[1][None], 1.0)
    multiplier = _solved(factor, by_shift, along_shift, covector)
    found = -along(middle(multiplier))
    found[2] += covector
    return found


def _second_derivatives(metric: RiemannianMetric, points: ndarray) -> Callable[[ndarray], ndarray]:
    slopes = grad(metric.energy)

    def along(direction: ndarray) -> ndarray:
        return grad(lambda x: np.sum(slopes(x) * direction))(points)

    return along


def _solved(
    factor: CholeskyFactor,
    matrix: Callable[[ndarray], ndarray],
    transposed: Callable[[ndarray], ndarray],
    right: ndarray,
) -> ndarray:
    """Return the shortest least-squares solution of A x = b, in variables of the factor.

    Motions that the metric does not see are in the kernels of A and of its transpose.
    """
    shape, size = right.shape, right.size

    def preconditioned(apply: Callable[[ndarray], ndarray]) -> Callable[[ndarray], ndarray]:
        def product(variables: ndarray) -> ndarray:
            vector = factor.solve_transposed(variables.reshape(size, 1)).reshape(shape)
            return factor.solve(apply(vector).reshape(size, 1)).ravel()

        return product

    operator = LinearOperator(
        (size, size), preconditioned(matrix), preconditioned(transposed), dtype=np.float64
    )
    variables, reason, *_ = lsmr(
        operator,
        factor.solve(right.reshape(size, 1)).ravel(),
        atol=_TOLERANCE,
        btol=_TOLERANCE,
        conlim=0.0,
        maxiter=_MAX_ITER,
    )
    if reason == _OUT_OF_ITERATIONS:
        warn(
            f"the derivative of the exponential is not exact: {_MAX_ITER} iterations do not solve "
            "its equation",
            ConvergenceWarning,
        )
    return factor.solve_transposed(variables[:, None]).reshape(shape)
