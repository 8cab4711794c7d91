"""Exponentials computed by a solver, with derivatives for autograd."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from autograd.extend import defvjp_argnums, primitive
from numpy import ndarray

from riemhuman.errors import NotDefinedError, OutsideManifoldError
from riemhuman.protocols import DifferentiableExpSolver, ExpSolver


@primitive
def solved_geodesic(
    tangent_vec: ndarray, base_point: ndarray, metric: Any, solver: ExpSolver
) -> ndarray:
    r"""Return the geodesic that a solver finds for an initial velocity, or its end point.

    Parameters
    ----------
    tangent_vec, base_point : array, shape (\*shape,)
        Initial velocity and point, plain or traced by autograd.
    metric : RiemannianMetric
        The metric.
    solver : ExpSolver
        The strategy; derivatives need one with `derivatives`.

    Returns
    -------
    array, shape (n_nodes, \*shape)
        The path if the solver has derivatives; otherwise the end point alone.

    Raises
    ------
    OutsideManifoldError
        If the solver stops where the geodesic leaves the manifold.
    """
    result = solver.solve(metric, tangent_vec, base_point)
    if not getattr(result, "complete", True):
        where = getattr(result, "message", "a point on the way")
        raise OutsideManifoldError(
            f"tangent_vec must be the velocity of a geodesic that {type(solver).__name__} "
            f"can follow for unit time; it stopped at {where}"
        )
    if isinstance(solver, DifferentiableExpSolver):
        return np.asarray(result.path)  # type: ignore[attr-defined]
    return np.asarray(result.end)[None]


def _derivatives(
    argnums: Sequence[int], path: ndarray, args: tuple[Any, ...], kwargs: dict[str, Any]
) -> Callable[[ndarray], tuple[ndarray, ...]]:
    tangent_vec, _, metric, solver = args

    def pull_back(covectors: ndarray) -> tuple[ndarray, ...]:
        if not isinstance(solver, DifferentiableExpSolver):
            raise NotDefinedError(
                f"{type(solver).__name__} has no derivatives of exp; "
                "riemhuman.solvers.DiscreteExponential() has"
            )
        both = solver.derivatives(metric, path, tangent_vec, covectors)
        return tuple(both[number] for number in argnums)

    return pull_back


defvjp_argnums(solved_geodesic, _derivatives)
