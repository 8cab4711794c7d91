"""The points that a search can reach, and the search for the best of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from autograd.core import make_vjp
from numpy import ndarray

from riemhuman.geometry import Manifold
from riemhuman.kernels.threads import combine_rows, pair_with_rows, single_threaded_libraries
from riemhuman.solvers._lbfgs import LBFGS, Minimum, Operator


@dataclass(frozen=True)
class Coordinates:
    r"""The points projection(origin + Σ_j x_j D_j) of a manifold; by default all entries are free.

    The origin may be several points, shape (m, \*shape), each with coordinates of its own. The rows
    of `directions` are the D_j.
    """

    space: Manifold
    origin: ndarray
    directions: ndarray | None = None

    def points(self, x: ndarray) -> ndarray:
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.space.projection(self._shifted(x))

    def minimize(
        self,
        minimizer: LBFGS,
        function: Callable[[ndarray], tuple[float, ndarray]],
        inverse_hessian_at: Callable[[ndarray], Operator],
        freeze_at: Callable[[ndarray], Operator] | None = None,
        **settings: Any,
    ) -> Minimum:
        """Return the points of least value, reached from the origin.

        The function returns a value, infinite where points are not allowed, and its gradient at
        points; the operators, formed at points,
        act on gradients in coordinates; the minimiser's callback is called with points.
        """
        shape = self.origin.shape

        def objective(x: ndarray) -> tuple[float, ndarray]:
            with np.errstate(divide="ignore", invalid="ignore"):
                pull_back, points = make_vjp(self.space.projection, self._shifted(x))
            value, gradient = function(points)
            rows = pull_back(gradient.reshape(shape)).reshape(self._n_origins, -1)
            if self.directions is not None:
                rows = pair_with_rows(rows, self.directions)
            return value if np.isfinite(value) else np.inf, rows.ravel()

        def report(iteration: int, value: float, x: ndarray) -> None:
            if minimizer.callback is not None:
                minimizer.callback(iteration, value, self.points(x))

        start = np.zeros(self.origin.size)
        if self.directions is not None:
            start = np.zeros(self._n_origins * len(self.directions))
        with single_threaded_libraries():
            minimum = replace(minimizer, callback=report).minimize(
                objective,
                start,
                lambda x: inverse_hessian_at(self.points(x)),
                freeze_at=None if freeze_at is None else lambda x: freeze_at(self.points(x)),
                **settings,
            )
        return replace(minimum, x=self.points(minimum.x))

    @property
    def _n_origins(self) -> int:
        return self.origin.size // int(np.prod(self.space.shape))

    def _shifted(self, x: ndarray) -> ndarray:
        if self.directions is not None:
            x = combine_rows(x.reshape(self._n_origins, len(self.directions)), self.directions)
        return self.origin + x.reshape(self.origin.shape)
