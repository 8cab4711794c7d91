r"""Least squares of functions with kinks, by a bundle of their linearisations.

A Gauss–Newton step across a kink ends on its other side, where the cost may be no smaller; a search
that only shortens the step stops beside the kink, although the cost falls along it. The bundle
keeps the gradients :math:`g_j` of the cost f at points :math:`z_j` of both sides. With the matrix
:math:`H = J^\top J` of the last accepted point z, the step p minimises

.. math:: \max_j (G_j \cdot p - e_j) + \tfrac12 p^\top H p, \qquad G_j = g_j + H (z - z_j), \qquad
          e_j = |f(z) - f(z_j) - g_j \cdot (z - z_j) - \tfrac12 (z - z_j)^\top H (z - z_j)|

(Bonnans et al., Numerical Optimization, 2nd ed., section 10.3). Its dual is a quadratic programme
over the weights of the gradients, which are positive and sum to one.

The cost is not convex: the linearisation at a distant point may exceed f at z, with a negative
error. Its gradient would then count as one at z itself, and the search would stop where the cost
still falls. So errors count by their absolute value, and at least as the squared distance from z:
the locality measures of Kiwiel (Methods of Descent for Nondifferentiable Optimization, 1985). Where
the residuals are curved, the whole step leads too far; so no step is longer than a radius that
follows from the steps before.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from riemhuman.arrays import Array, Booleans

# The search ends when the model predicts a gain below this, in the unit of half a sum of squares of
# residuals with unit variance, or below this share of the cost.
_LEAST_GAIN = 1e-4
_LEAST_SHARE = 3e-7
# A step is accepted if it gains this share of the prediction. Other steps halve the radius; if a
# step gains more than the larger share, the next one may be twice as long.
_ACCEPTED = 0.1
_GOOD = 0.5
_SHORTER = 0.5
_LONGER = 2.0
_MOST_GRADIENTS = 20
# Weights of gradients have this precision, and change at most this often per gradient.
_EXACT = 1e-12
_MOST_CHANGES = 10


def least_squares_with_kinks(
    linearisation: Callable[[Array], tuple[Array, Array]], start: Array, max_steps: int
) -> tuple[Array, float, bool]:
    """Return where half the sum of squares is least, that sum, and whether the search converged.

    The linearisation is the residuals at a point, NaN where there are none, and their derivatives;
    at the start there must be residuals. A search may end at a jump of the residuals, but has not
    converged where there are none further on.
    """
    z = start
    cost, gradient, matrix = _quadratic(*linearisation(z))
    root = cholesky(matrix)
    others: list[tuple[Array, float, Array]] = []
    radius, is_blocked = np.inf, False
    for n_steps in range(max_steps + 1):
        step, gain = _step([*others, (z, cost, gradient)], matrix, root)
        length = float(np.linalg.norm(step))
        share = min(1.0, radius / length) if length > 0.0 else 1.0
        length *= share
        gain *= share * (2.0 - share)
        if gain < max(_LEAST_GAIN, _LEAST_SHARE * cost):
            return z, cost, share == 1.0 or not is_blocked
        if n_steps == max_steps:
            break
        trial = z + share * step
        values, rows = linearisation(trial)
        if not np.isfinite(values).all():
            radius, is_blocked = _SHORTER * length, True
            continue
        trial_cost, trial_gradient, trial_matrix = _quadratic(values, rows)
        gained = (cost - trial_cost) / gain
        others = others[1 - _MOST_GRADIENTS :]
        if gained < _ACCEPTED:
            others.append((trial, trial_cost, trial_gradient))
            radius = _SHORTER * length
            continue
        is_blocked = False
        others.append((z, cost, gradient))
        if gained > _GOOD:
            radius = max(radius, _LONGER * length)
        z = trial
        cost = trial_cost
        gradient = trial_gradient
        matrix = trial_matrix
        root = cholesky(matrix)
    return z, cost, False


def _quadratic(values: Array, rows: Array) -> tuple[float, Array, Array]:
    """Return half the sum of squares, its gradient, and the Gauss–Newton matrix."""
    return 0.5 * float(values @ values), rows.T @ values, rows.T @ rows


def _step(
    bundle: list[tuple[Array, float, Array]], matrix: Array, root: Array
) -> tuple[Array, float]:
    """Return the best step from the last point that the bundle predicts, and its gain."""
    z, cost, _ = bundle[-1]
    points = np.array([point for point, _, _ in bundle])
    costs = np.array([point_cost for _, point_cost, _ in bundle])
    gradients = np.array([gradient for _, _, gradient in bundle])
    away = z - points
    bent = away @ matrix
    errors = cost - costs - np.sum(away * (gradients + 0.5 * bent), axis=1)
    errors = np.maximum(np.abs(errors), np.sum(away**2, axis=1))
    # With H = Rᵀ R, the columns are R⁻ᵀ G.
    columns = solve_triangular(root, (gradients + bent).T, trans="T")
    weights = _weights_of_least_gain(columns.T @ columns, errors)
    mean = columns @ weights
    return -solve_triangular(root, mean), 0.5 * float(mean @ mean) + float(errors @ weights)


def _weights_of_least_gain(products: Array, errors: Array) -> Array:
    """Return positive weights w with sum one for which wᵀ Q w / 2 + e·w is least.

    The method of active sets, as of Lawson and Hanson for least squares: weights become free one by
    one, and are zero again where the best free ones were negative.
    """
    size = len(errors)
    tolerance = _EXACT * float(np.abs(products).max())
    first = int(np.argmin(0.5 * np.diag(products) + errors))
    weights, free = np.eye(size)[first], np.arange(size) == first
    for _ in range(_MOST_CHANGES * size):
        best, level = _best_free(products, errors, free)
        falling = free & (best < 0.0)
        if falling.any():
            share = np.min(weights[falling] / (weights[falling] - best[falling]))
            weights = weights + share * (best - weights)
            free &= weights > _EXACT
            weights[~free] = 0.0
            continue
        weights = best
        slopes = np.where(free, np.inf, products @ weights + errors - level)
        if slopes.min() > -tolerance:
            break
        free[slopes.argmin()] = True
    sum_to_one: Array = weights / weights.sum()
    return sum_to_one


def _best_free(products: Array, errors: Array, free: Booleans) -> tuple[Array, float]:
    """Return the best weights of any sign with sum one, zero where not free, and their slope."""
    n_free = int(free.sum())
    scale = float(np.abs(products[free][:, free]).max()) or 1.0
    system = np.zeros((n_free + 1, n_free + 1))
    # Gradients may be linearly dependent and still have a best sum.
    system[:-1, :-1] = products[np.ix_(free, free)] / scale + _EXACT * np.eye(n_free)
    system[-1, :-1] = system[:-1, -1] = 1.0
    solution = np.linalg.solve(system, np.append(-errors[free] / scale, 1.0))
    weights = np.zeros(len(errors))
    weights[free] = solution[:-1]
    return weights, -scale * float(solution[-1])
