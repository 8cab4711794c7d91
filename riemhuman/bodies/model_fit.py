"""The result of a fit of a body model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.representation import Record
from riemhuman.solvers.model_path import ModelParameters


@dataclass(frozen=True, eq=False, repr=False)
class ModelFit(Record):
    """Parameters of a body model that were fitted to surfaces, with the remaining distances.

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

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fit = bodies.model.fit(bodies[0])
    >>> bool(fit.converged), float(fit.distances.mean() < 0.01)
    (True, 1.0)
    """

    betas: np.ndarray
    pose: np.ndarray
    trans: np.ndarray
    distances: np.ndarray
    converged: np.ndarray
    n_iterations: np.ndarray

    @property
    def mean_distance(self) -> np.ndarray:
        """Mean distance of the points of each surface, metres, shape (...)."""
        return self.distances.mean(axis=-1)

    @property
    def mean_distance_mm(self) -> np.ndarray:
        """Mean distance of the points of each surface, millimetres, shape (...)."""
        return 1000.0 * self.mean_distance

    @property
    def parameters(self) -> ModelParameters:
        """Betas, pose and trans as an argument of `ModelPath`."""
        return ModelParameters(self.betas, self.pose, self.trans)
