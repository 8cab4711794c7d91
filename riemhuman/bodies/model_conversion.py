"""Conversion of fits between body models, through a map between their templates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from riemhuman.bodies.body_model import BodyModel
from riemhuman.bodies.fitting import fit_model
from riemhuman.bodies.model_fit import ModelFit


@dataclass(frozen=True, eq=False)
class ConvertedFit:
    """Parameters of another body model for the same surfaces.

    Attributes
    ----------
    fit : ModelFit
        Betas, pose and trans of the other model.
    distances : array, shape (..., n_points)
        Distance of each vertex of the first model from its place on the other, metres.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fit, model = bodies.model.fit(bodies[0]), bodies.model
    >>> same = rh.bodies.convert(fit, model, to=model, correspondence=np.arange(1202))
    >>> same.distances.shape
    (1202,)
    """

    fit: ModelFit
    distances: np.ndarray

    @property
    def mean_distance(self) -> np.ndarray:
        """Mean distance of the vertices of each surface, metres, shape (...)."""
        return self.distances.mean(axis=-1)

    def __str__(self) -> str:
        return (
            f"converted with a mean distance of {1000.0 * self.distances.mean():.1f} mm, at most "
            f"{1000.0 * self.distances.max():.1f} mm"
        )


def convert(
    fit: ModelFit, model: BodyModel, *, to: BodyModel, correspondence: Any, **options: Any
) -> ConvertedFit:
    """Convert a fit of one body model to a fit of another.

    The other model is fitted to the surfaces of the first model. The correspondence places the
    vertices of the first model on the other.

    Parameters
    ----------
    fit : ModelFit
        Parameters of the first model.
    model : BodyModel
        The first model.
    to : BodyModel
        The other model, for instance SMPL, SMPL-H, SMPL-X or STAR.
    correspondence : array_like of int, pair, or sparse matrix
        Place of each vertex of the first model on the other: numbers of vertices, shape (V,); a
        pair of numbers of triangles, shape (V,), and barycentric coordinates, shape (V, 3); or a
        matrix whose rows sum to one.
    **options
        Further arguments of `fit_model`.

    Returns
    -------
    converted : ConvertedFit
        As text, the mean and the largest distance between the surfaces.

    Raises
    ------
    ArgumentError
        If the correspondence does not match the models.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fit = bodies.model.fit(bodies[0])
    >>> model = bodies.model
    >>> same = rh.bodies.convert(fit, model, to=model, correspondence=np.arange(1202))
    >>> bool(same.mean_distance < 1e-4)
    True
    """
    surfaces = model(fit.betas, fit.pose, fit.trans)
    found = fit_model(to, surfaces, correspondence=correspondence, **options)
    return ConvertedFit(found, found.distances)
