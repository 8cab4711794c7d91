"""Spectral signatures of the points of a surface, pooled into one vector."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import one_of, whole_number
from riemhuman.descriptors.descriptor import pairwise
from riemhuman.descriptors.spectral_descriptor import SpectralDescriptor
from riemhuman.surfaces.spectra import LAPLACIANS, Spectrum, spectrum

_NORMALIZATIONS = ("none", "area")


class KernelSignature(SpectralDescriptor):
    """Spectral signatures Σ_k w_k φ_k(x)² of all points x, pooled over the surface.

    Subclasses are frozen dataclasses of parameters that define `_of`, the signatures of a spectrum.
    The distance of histograms is the sum of absolute differences, that of means is Euclidean.
    """

    pooling: str
    normalization: str
    n_bins: int

    def signatures(self, vertices: ArrayLike, faces: ArrayLike) -> np.ndarray:
        """Return the signatures of every vertex.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres.
        faces : array_like, shape (F, 3)
            Vertex indices of each triangle, counted from 0.

        Returns
        -------
        array, shape (n_scales, V)
            One row for each time or energy. Heat kernel signatures are in 1 / metre², or without
            unit for surfaces scaled to area 1; wave kernel signatures are multiplied by the area
            and have mean 1 over the surface.

        Raises
        ------
        ArgumentTypeError
            If an array does not hold numbers of the right kind.
        ArgumentError
            If the arrays are no mesh, or the mesh has too few eigenvalues.
        DegenerateSurfaceError
            If a triangle has no area, with the cotangent Laplacian.
        """
        return self._of(self._scaled(spectrum(vertices, faces, self.n_eigenvalues, self.laplacian)))

    def distances(self, vectors: ArrayLike) -> np.ndarray:
        return pairwise(vectors, "cityblock" if self.pooling == "histogram" else "euclidean")

    @abstractmethod
    def _of(self, found: Spectrum) -> np.ndarray:
        """Return the signatures, shape (n_scales, V)."""

    def _scaled(self, found: Spectrum) -> Spectrum:
        """Return the part of a spectrum that is used, scaled to area 1 if requested."""
        found = found.first(self.n_eigenvalues)
        return found.of_unit_area() if self.normalization == "area" else found

    def _check_choices(self, poolings: tuple[str, ...]) -> None:
        one_of(self.pooling, "pooling", poolings)
        one_of(self.normalization, "normalization", _NORMALIZATIONS)
        whole_number(self.n_eigenvalues, "n_eigenvalues", minimum=1)
        whole_number(self.n_bins, "n_bins", minimum=2)
        one_of(self.laplacian, "laplacian", LAPLACIANS)
