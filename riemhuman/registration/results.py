"""The result of a registration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.bodies import ModelFit
from riemhuman.surfaces.nearest_places import SurfacePlaces


@dataclass(frozen=True, eq=False)
class RegisteredScan:
    """A registered scan, and whether to trust it.

    Attributes
    ----------
    points : array, shape (V, 3)
        The registered surface at the place of the scan, metres.
    trusted : bool
        Whether the result passed all checks.
    message : str
        The checks that the result failed.
    likelihood : float
        Mean log-likelihood of the scan points under the fitted body, scaled to an area of 1.8
        square metres; NaN without a body model.
    fit : ModelFit or None
        Betas, pose and trans of the model, and the distances of `points` from it; None without a
        body model.
    distances : array, shape (N,)
        Distance of each point of the scan from the registered surface, metres.
    matched : array of bool, shape (V,)
        Which vertices match points of the scan within 2 cm; the positions of the others follow
        from the model and the elastic metric.
    correspondence : SurfacePlaces
        Triangle and barycentric coordinates of the point on the surface nearest to each point of
        the scan, by which data on the scan are carried over to the body.
    background : array of bool, shape (N,)
        Which points of the scan were classified as floor or strays.
    up : array, shape (3,)
        The direction up in the scan.
    unit : str
        The unit of the scan.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> registration = rh.registration.TemplateRegistration(bodies.template)
    >>> result = registration.solve((bodies[0], bodies.template.faces), start=bodies[0])
    >>> result.trusted, result.points.shape
    (True, (1202, 3))
    """

    points: np.ndarray
    trusted: bool
    message: str
    likelihood: float
    fit: ModelFit | None
    distances: np.ndarray
    matched: np.ndarray
    correspondence: SurfacePlaces
    background: np.ndarray
    up: np.ndarray
    unit: str

    def __repr__(self) -> str:
        share = 100.0 * self.matched.mean()
        body = self.distances[~self.background]
        return (
            f"<RegisteredScan: {'trusted' if self.trusted else 'not trusted'}, "
            f"{1000.0 * np.median(body):.1f} mm median distance, {share:.0f} % of the vertices "
            f"matched{'; ' + self.message if self.message else ''}>"
        )
