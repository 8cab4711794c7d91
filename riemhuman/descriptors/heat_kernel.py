"""The heat kernel signature, pooled over a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.checks import real_array
from riemhuman.descriptors.kernel_signature import KernelSignature
from riemhuman.descriptors.pooling import area_histograms
from riemhuman.errors import ArgumentError
from riemhuman.surfaces.spectra import Spectrum

_POOLINGS = ("histogram", "mean", "vertex mean")
_TIMES = tuple(np.geomspace(0.02, 2.0, 16).tolist())
# Range of log₁₀(4πt h), which is 0 where the surface is flat within a distance of √t.
_LOWER, _UPPER = -0.5, 1.5


@dataclass(frozen=True)
class HeatKernelSignature(KernelSignature):
    r"""The heat kernel signature, pooled over the surface [1]_.

    The signature of a point x is :math:`h_t(x) = \sum_k e^{-\mu_k t} \varphi_k(x)^2`, including the
    eigenvalue zero. The descriptor uses :math:`\log_{10}(4\pi t\,h_t)`, which is 0 at points of a
    plane. Since distributions of signatures distinguish surfaces [2]_, the default is a histogram
    for each time, weighted by area; the distance of histograms is the sum of absolute differences.
    The distance of means is Euclidean; the mean weighted by area is the heat trace
    :math:`\sum_k e^{-\mu_k t} / A`, which depends on the eigenvalues alone.

    Parameters
    ----------
    times : sequence of float
        Times t > 0, in square metres, or in units of the surface's area; see `normalization`.
    pooling : {"histogram", "mean", "vertex mean"}
        "mean" is weighted by area. "vertex mean" is not: it depends on the distribution of the
        vertices over the surface, and is meaningful only for registered surfaces.
    normalization : {"none", "area"}
        Whether surfaces are compared at their size, or scaled to area 1.
    n_eigenvalues : int
        Number of eigenvalues in the sum, not counting zero.
    n_bins : int
        Number of bins of a histogram.
    laplacian : {"cotangent", "robust"}
        Discretisation, see `riemhuman.surfaces.spectrum`.

    Raises
    ------
    ArgumentTypeError
        If a parameter is of the wrong type.
    ArgumentError
        If a time is not positive, or a choice is unknown.

    References
    ----------
    .. [1] Sun, Ovsjanikov, Guibas, "A Concise and Provably Informative Multi-Scale Signature
       Based on Heat Diffusion", SGP 2009.
    .. [2] Bronstein, Bronstein, Guibas, Ovsjanikov, "Shape Google: Geometric Words and Expressions
       for Invariant Shape Retrieval", ACM Transactions on Graphics 30(1), 2011.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> descriptor = rh.descriptors.HeatKernelSignature()
    >>> first, second = (descriptor.describe(f, bodies.template.faces) for f in bodies.points[:2])
    >>> bool(descriptor.distances([first, second])[0, 1] > 0)
    True
    """

    times: tuple[float, ...] = _TIMES
    pooling: str = "histogram"
    normalization: str = "none"
    n_eigenvalues: int = 60
    n_bins: int = 16
    laplacian: str = "cotangent"

    def __post_init__(self) -> None:
        times = real_array(self.times, "times", ("n_times",), batched=False)
        if times.size == 0 or times.min() <= 0:
            raise ArgumentError(f"times must be positive numbers; found {times.tolist()}")
        object.__setattr__(self, "times", tuple(times.tolist()))
        self._check_choices(_POOLINGS)

    def of_spectrum(self, found: Spectrum) -> np.ndarray:
        """Return the pooled signatures of a surface.

        Returns
        -------
        array, shape (n_times * n_bins,), or (n_times,) for a mean
        """
        found = self._scaled(found)
        used = found.areas > 0
        areas = found.areas[used]
        excess = 4 * np.pi * np.array(self.times)[:, np.newaxis] * self._of(found)[:, used]
        if self.pooling == "histogram":
            return area_histograms(np.log10(excess), areas, _LOWER, _UPPER, self.n_bins)
        weights = areas if self.pooling == "mean" else None
        return np.log10(np.average(excess, axis=1, weights=weights))

    def _of(self, found: Spectrum) -> np.ndarray:
        decay = np.exp(-np.outer(self.times, found.eigenvalues))
        return decay @ found.functions**2 + found.constants
