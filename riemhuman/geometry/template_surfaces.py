"""The space that metrics on surfaces need: surfaces over a template."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any

from numpy import ndarray

from riemhuman.geometry.space import Space

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


class TemplateSurfaces(Space):
    """A space of surfaces over a template.

    `riemhuman.AlignedSurfaces` adds a metric and fields to it; metrics ask for no more than this.
    """

    template: Template

    @abstractmethod
    def check_tangent_vec(self, tangent_vec: Any, name: str = "tangent_vec") -> ndarray:
        """Return deformations as float64 arrays after checking them.

        Parameters
        ----------
        tangent_vec : array_like, shape (..., V, 3)
            Deformations, of any size.
        name : str
            Name of the argument, for messages.

        Returns
        -------
        array, shape (..., V, 3)

        Raises
        ------
        ArgumentError
            If the number of vertices is not the template's, an entry is not finite, or areas
            would leave the range of double precision.
        """

    @abstractmethod
    def check_immersed(self, f: Any, name: str = "f") -> ndarray:
        """Return surfaces as float64 arrays, refusing those with triangles without area.

        Parameters
        ----------
        f : array_like, shape (..., V, 3)
            Surfaces.
        name : str
            Name of the argument, for messages.

        Returns
        -------
        array, shape (..., V, 3)

        Raises
        ------
        DegenerateSurfaceError
            If a triangle has no area, so that g is not invertible there and has no normal.
        """
