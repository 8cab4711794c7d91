"""Descriptors from the spectrum of a surface, which several of them can share."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.descriptors.descriptor import Descriptor, meshes_of
from riemhuman.errors import RiemhumanError
from riemhuman.progress import ProgressBar
from riemhuman.surfaces.spectra import Spectrum, spectrum


class SpectralDescriptor(Descriptor):
    """A vector made of the lowest eigenvalues and eigenfunctions of a surface.

    Subclasses are frozen dataclasses of parameters that define `of_spectrum`.
    """

    _in_threads = False

    n_eigenvalues: int
    laplacian: str

    @abstractmethod
    def of_spectrum(self, found: Spectrum) -> np.ndarray:
        """Return the vector of a surface from its spectrum.

        Parameters
        ----------
        found : Spectrum
            The spectrum, with at least `n_eigenvalues` eigenvalues.

        Returns
        -------
        array, shape (d,)
        """

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> np.ndarray:
        """Return the vector of one surface.

        Raises
        ------
        ArgumentTypeError
            If an array does not hold numbers of the right kind.
        ArgumentError
            If the arrays are no mesh, or the mesh has too few eigenvalues.
        DegenerateSurfaceError
            If a triangle has no area, with the cotangent Laplacian.
        """
        return self.of_spectrum(spectrum(vertices, faces, self.n_eigenvalues, self.laplacian))

    @staticmethod
    def describe_together(
        descriptors: Sequence[SpectralDescriptor], bodies: Any, *, progress: bool = False
    ) -> tuple[list[np.ndarray], list[float]]:
        """Return the vectors of several descriptors; each surface's spectrum is computed once.

        Parameters
        ----------
        descriptors : sequence of SpectralDescriptor
            The descriptors.
        bodies : object or iterable of (vertices, faces)
            Surfaces, as for `describe_all`.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        vectors : list of array, each of shape (n, d)
            Vectors of each descriptor.
        seconds : list of float
            Wall-clock time that each descriptor would take alone.

        Raises
        ------
        RiemhumanError
            If a surface cannot be described; the message gives its number.
        """
        count, mesh = meshes_of(bodies)
        needed: dict[str, int] = {}
        for one in descriptors:
            needed[one.laplacian] = max(one.n_eigenvalues, needed.get(one.laplacian, 0))
        vectors: list[list[np.ndarray]] = [[] for _ in descriptors]
        seconds = np.zeros(len(descriptors))
        for index in ProgressBar(range(count), disable=not progress, unit="spectrum"):
            for laplacian, n_eigenvalues in needed.items():
                began = time.perf_counter()
                try:
                    found = spectrum(*mesh(index), n_eigenvalues, laplacian)
                except RiemhumanError as error:
                    raise type(error)(f"body {index}: {error}") from error
                shared = time.perf_counter() - began
                for k, one in enumerate(descriptors):
                    if one.laplacian == laplacian:
                        began = time.perf_counter()
                        vectors[k].append(one.of_spectrum(found))
                        seconds[k] += shared + time.perf_counter() - began
        return [np.stack(rows) for rows in vectors], seconds.tolist()
