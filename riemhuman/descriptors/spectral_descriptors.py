"""Descriptors from the Laplace–Beltrami spectrum: ShapeDNA, heat and wave kernel signatures."""

from __future__ import annotations

import time
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike
from tqdm import tqdm

from riemhuman.arrays import Array
from riemhuman.checks import checked, choice, flag, instance, positive, real_array, whole
from riemhuman.descriptors.descriptor import (
    Descriptor,
    Surfaces,
    histograms,
    meshes_of,
    pairwise,
    positive_numbers,
)
from riemhuman.errors import ArgumentError, RiemhumanError
from riemhuman.surfaces.spectra import Spectrum, spectrum

# Square metres; in time t heat reaches about √t, which is 0.14 m to 1.4 m.
_TIMES = tuple(np.geomspace(0.02, 2.0, 16).tolist())
_ENERGIES = tuple(np.linspace(1.5, 5.5, 24).tolist())

# Width of the weights of the wave kernel signature as a share of the range of energies.
_WIDTH = 0.07


class SpectralDescriptor(Descriptor):
    """A vector made of the lowest eigenvalues and eigenfunctions of a surface."""

    _in_threads = False

    n_eigenvalues: int

    @abstractmethod
    def of_spectrum(self, modes: Spectrum) -> Array:
        """Return the vector of a surface from at least `n_eigenvalues` of its eigenvalues."""

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        return self.of_spectrum(spectrum(vertices, faces, self.n_eigenvalues))

    @staticmethod
    @checked(progress=flag)
    def describe_together(
        descriptors: Sequence[SpectralDescriptor],
        bodies: Surfaces,
        *,
        progress: bool = False,
    ) -> tuple[list[Array], list[float]]:
        """Return vectors and seconds of several descriptors; spectra are computed once."""
        count, mesh = meshes_of(bodies)
        n_eigenvalues = max(descriptor.n_eigenvalues for descriptor in descriptors)
        vectors: list[list[Array]] = [[] for _ in descriptors]
        seconds = np.zeros(len(descriptors))
        for index in tqdm(range(count), disable=not progress, unit="spectrum"):
            began = time.perf_counter()
            try:
                modes = spectrum(*mesh(index), n_eigenvalues)
            except RiemhumanError as error:
                raise type(error)(f"body {index}: {error}") from error
            seconds += time.perf_counter() - began
            for k, descriptor in enumerate(descriptors):
                began = time.perf_counter()
                vectors[k].append(descriptor.of_spectrum(modes))
                seconds[k] += time.perf_counter() - began
        return [np.stack(rows) for rows in vectors], seconds.tolist()


@checked(n_eigenvalues=whole(minimum=1))
@dataclass(frozen=True)
class ShapeDNA(SpectralDescriptor):
    r"""The first eigenvalues of the Laplace–Beltrami operator, without zero [1]_.

    Bending does not change them. By Weyl's law they grow like :math:`\mu_k \approx 4\pi k / A`;
    divided by k, as here, they have similar sizes. The distance is Euclidean. A vector divided by
    its first entry does not depend on the size of the surface.

    Parameters
    ----------
    n_eigenvalues : int
        Number of eigenvalues.

    References
    ----------
    .. [1] Reuter, Wolter, Peinecke, "Laplace–Beltrami spectra as 'Shape-DNA' of surfaces and
       solids", Computer-Aided Design 38(4), 2006.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.descriptors.ShapeDNA(10).describe(bodies[0], bodies.template.faces).shape
    (10,)
    """

    n_eigenvalues: int = 50

    @checked(modes=instance(Spectrum))
    def of_spectrum(self, modes: Spectrum) -> Array:
        values = modes.eigenvalues[: self.n_eigenvalues]
        return values / np.arange(1, len(values) + 1)


class KernelSignature(SpectralDescriptor):
    """Spectral signatures Σ_k w_k φ_k(x)² of all points x, pooled over the surface."""

    n_bins: int
    pooling: str = "histogram"

    _RANGE: ClassVar[tuple[float, float]]

    def signatures(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        """Return the signatures (n_scales, V) of every vertex: a row for each time or energy.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
        faces : array_like, shape (F, 3)
        """
        return self._of(spectrum(vertices, faces, self.n_eigenvalues))

    def distances(self, vectors: ArrayLike) -> Array:
        return pairwise(vectors, "cityblock" if self.pooling == "histogram" else "euclidean")

    @checked(modes=instance(Spectrum))
    def of_spectrum(self, modes: Spectrum) -> Array:
        modes = modes.first(self.n_eigenvalues)
        used = modes.areas > 0
        values = self._pooled(self._of(modes)[:, used])
        if self.pooling == "vertex mean":
            means: Array = values.mean(axis=1)
            return means
        shares = modes.areas[used] / modes.areas.sum()
        return histograms(values, shares, self._RANGE, self.n_bins)

    @abstractmethod
    def _of(self, modes: Spectrum) -> Array:
        """Return the signatures, shape (n_scales, V)."""

    def _pooled(self, signatures: Array) -> Array:
        return signatures


@checked(times=positive_numbers, n_eigenvalues=whole(minimum=1), n_bins=whole(minimum=2))
@dataclass(frozen=True)
class HeatKernelSignature(KernelSignature):
    r"""The heat kernel signature, pooled over the surface [1]_.

    The signature of a point x is :math:`h_t(x) = \sum_k e^{-\mu_k t} \varphi_k(x)^2`, including the
    eigenvalue zero. The descriptor has a histogram of :math:`\log_{10}(4\pi t\,h_t)`, which is 0 at
    points of a plane, for each time, weighted by area [2]_; the distance of histograms is the sum
    of absolute differences.

    Parameters
    ----------
    times : sequence of float
        Times t > 0, in square metres.
    n_eigenvalues : int
        Number of eigenvalues in the sum, not counting zero.
    n_bins : int
        Number of bins of a histogram.

    References
    ----------
    .. [1] Sun, Ovsjanikov, Guibas, "A Concise and Provably Informative Multi-Scale Signature
       Based on Heat Diffusion", SGP 2009.
    .. [2] Bronstein, Bronstein, Guibas, Ovsjanikov, "Shape Google: Geometric Words and Expressions
       for Invariant Shape Retrieval", ACM Transactions on Graphics 30(1), 2011.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.descriptors.HeatKernelSignature().describe_all(bodies[:1]).shape
    (1, 256)
    """

    times: tuple[float, ...] = _TIMES
    n_eigenvalues: int = 60
    n_bins: int = 16

    # Of log₁₀(4πt h), which is 0 where the surface is flat within a distance of √t.
    _RANGE = -0.5, 1.5

    def _pooled(self, signatures: Array) -> Array:
        return np.log10(4 * np.pi * np.array(self.times)[:, np.newaxis] * signatures)

    def _of(self, modes: Spectrum) -> Array:
        decay = np.exp(-np.outer(self.times, modes.eigenvalues))
        traces: Array = decay @ modes.functions**2 + modes.constants
        return traces


def _numbers(values: ArrayLike, name: str) -> tuple[float, ...]:
    """Return one number or more as a tuple."""
    numbers = real_array(values, name, (f"n_{name}",), batched=False)
    return tuple(numbers.tolist())


@checked(
    energies=_numbers,
    sigma=positive,
    pooling=choice("histogram", "vertex mean"),
    n_eigenvalues=whole(minimum=1),
    n_bins=whole(minimum=2),
)
@dataclass(frozen=True)
class WaveKernelSignature(KernelSignature):
    r"""The wave kernel signature, pooled over the surface [1]_.

    The signature of a point x is the average of :math:`\varphi_k(x)^2` over the eigenfunctions
    with weights :math:`\exp(-(e - \log\mu_k)^2 / 2\sigma^2)`, here multiplied by the area of the
    surface. The default is a histogram for each energy, weighted by area; the distance of
    histograms is the sum of absolute differences, that of means is Euclidean.

    Parameters
    ----------
    energies : sequence of float
        Energies e = log μ, with μ in 1 / metre².
    sigma : float, optional
        Width σ > 0 of the weights; by default 0.07 times the range of energies, as in the paper.
    pooling : {"histogram", "vertex mean"}
        "vertex mean" is the mean over vertices, for registered surfaces.
    n_eigenvalues, n_bins
        As for `HeatKernelSignature`.

    References
    ----------
    .. [1] Aubry, Schlickewei, Cremers, "The wave kernel signature: A quantum mechanical approach
       to shape analysis", ICCV Workshops 2011.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.descriptors.WaveKernelSignature().describe_all(bodies[:1]).shape
    (1, 768)
    """

    energies: tuple[float, ...] = _ENERGIES
    sigma: float | None = None
    pooling: str = "histogram"
    n_eigenvalues: int = 60
    n_bins: int = 32

    # Of the signature times the area, whose mean over any surface is 1.
    _RANGE = 0.0, 4.0

    def __post_init__(self) -> None:
        if not self.energies or (self.sigma is None and np.ptp(self.energies) == 0):
            raise ArgumentError(
                "energies must hold at least two different numbers, or one if sigma is given; "
                f"found {self.energies}"
            )

    def _of(self, modes: Spectrum) -> Array:
        gaps = np.array(self.energies)[:, np.newaxis] - np.log(modes.eigenvalues)
        sigma = self.sigma
        if sigma is None:
            sigma = _WIDTH * np.ptp(self.energies)
        exponents = -(gaps**2) / (2 * sigma**2)
        # The largest weight is scaled to 1, so that it cannot underflow far from all eigenvalues.
        weights = np.exp(exponents - exponents.max(axis=1, keepdims=True))
        weights /= weights.sum(axis=1, keepdims=True)
        signatures: Array = modes.areas.sum() * (weights @ modes.functions**2)
        return signatures
