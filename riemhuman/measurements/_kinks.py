r"""Least squares of functions with kinks, by a bundle of their linearisations.

A Gauss–Newton step across a kink ends on its other side, where the cost may be no smaller; a search
that only shortens the step stops beside the kink, although the cost falls along it. The bundle
keeps the gradients :math:`g_j` of the cost f at points :math:`z_j` of both sides. With the matrix
:math:`H = J^\top J` of the last accepted point z, the step p minimises

.. math:: \max_j (G_j \cdot p - e_j) + \tfrac12 p^\top H p, \qquad G_j = g_j + H (z - z_j), \qquad
          e_j = f(z) - f(z_j) - g_j \cdot (z - z_j) - \tfrac12 (z - z_j)^\top H (z - z_j)

(Bonnans et al., Numerical Optimization, 2nd ed., section 10.3). Its dual is a quadratic programme
over the weights of the gradients, which are positive and sum to one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy import ndarray
from scipy.linalg import cholesky, solve_triangular

# The search ends when the model predicts a gain below this, in the unit of half a sum of squares of
# residuals with unit variance.
_LEAST_GAIN = 1e-4
# A step is accepted if it gains this share of the prediction.
_ACCEPTED = 0.1
_MOST_GRADIENTS = 20

_MOST_HALVINGS = 12


def least_squares_with_kinks(
    linearisation: Callable[[ndarray], tuple[ndarray, ndarray]], start: ndarray, max_steps: int
) -> tuple[ndarray, float, bool]:
    """Return where half the sum of squares is least, that sum, and whether the search converged.

    The linearisation is the residuals at a point, NaN where there are none, and their derivatives.
    """
    z = start
    cost, gradient, matrix = _quadratic(*linearisation(z))
    root = cholesky(matrix)
    bundle = [(z, cost, gradient)]
    for n_steps in range(max_steps + 1):
        step, gain = _step(bundle, z, cost, matrix, root)
        if gain < _LEAST_GAIN:
            return z, cost, True
        if n_steps == max_steps:
            break
        for halvings in range(_MOST_HALVINGS):
            trial = z + 0.5**halvings * step
            values, rows = linearisation(trial)
            if np.isfinite(values).all():
                break
        else:
            break
        trial_cost, gradient, trial_matrix = _quadratic(values, rows)
        bundle = [*bundle[1 - _MOST_GRADIENTS :], (trial, trial_cost, gradient)]
        if trial_cost < cost - _ACCEPTED * gain:
            z, cost, matrix = trial, trial_cost, trial_matrix
            root = cholesky(matrix)
    return z, cost, False


def _quadratic(values: ndarray, rows: ndarray) -> tuple[float, ndarray, ndarray]:
    """Return half the sum of squares, its gradient, and the matrix of Gauss and Newton."""
    return 0.5 * float(values @ values), rows.T @ values, rows.T @ rows


def _step(
    bundle: list[tuple[ndarray, float, ndarray]],
    z: ndarray,
    cost: float,
    matrix: ndarray,
    root: ndarray,
) -> tuple[ndarray, float]:
    """Return the step that the bundle predicts to be the best, and its gain."""
    points, costs, gradients = (np.array(column) for column in zip(*bundle, strict=True))
    away = z - points
    bent = away @ matrix
    errors = cost - costs - np.sum(away * (gradients + 0.5 * bent), axis=1)
    errors = np.maximum(errors, 0.0)
    # With H = Rᵀ R, the columns are R⁻ᵀ G.
    columns = solve_triangular(root, (gradients + bent).T, trans="T")
    weights = _weights_of_least_gain(columns.T @ columns, errors)
    mean = columns @ weights
    return -solve_triangular(root, mean), 0.5 * float(mean @ mean) + float(errors @ weights)


def _weights_of_least_gain(products: ndarray, errors: ndarray) -> ndarray:
    """Return positive weights w with sum one for which wᵀ Q w / 2 + e·w is least."""
    size = len(errors)
    if size == 1:
        return np.ones(1)
    scale = 1.0 / max(float(np.abs(products).max()), np.finfo(float).tiny)

    from scipy.optimize import minimize  # takes long to import

    def gain(w: ndarray) -> tuple[float, ndarray]:
        slope = products @ w
        return scale * float(0.5 * w @ slope + errors @ w), scale * (slope + errors)

    minimum = minimize(
        gain,
        np.full(size, 1.0 / size),
        jac=True,
        method="SLSQP",
        bounds=[(0.0, 1.0)] * size,
        constraints={"type": "eq", "fun": lambda w: w.sum() - 1.0, "jac": np.ones_like},
        options={"ftol": 1e-12, "maxiter": 200},
    )
    weights: ndarray = minimum.x
    return weights
