"""The wave kernel signature, pooled over a surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.checks import real_array, real_number
from riemhuman.descriptors.kernel_signature import KernelSignature
from riemhuman.descriptors.pooling import area_histograms
from riemhuman.errors import ArgumentError
from riemhuman.surfaces.spectra import Spectrum

_POOLINGS = ("histogram", "vertex mean")
_ENERGIES = tuple(np.linspace(1.5, 5.5, 24).tolist())
# Range of the signature times the area, whose mean over any surface is 1.
_LOWER, _UPPER = 0.0, 4.0


@dataclass(frozen=True)
class WaveKernelSignature(KernelSignature):
    r"""The wave kernel signature, pooled over the surface [1]_.

    The signature of a point x is the average of :math:`\varphi_k(x)^2` over the eigenfunctions
    with weights :math:`\exp(-(e - \log\mu_k)^2 / 2\sigma^2)`, here multiplied by the area of the
    surface. Its mean weighted by area is then 1 at every energy; therefore `pooling` does not offer
    that mean. The default is a histogram for each energy, weighted by area; the distance of
    histograms is the sum of absolute differences.

    Parameters
    ----------
    energies : sequence of float
        Energies e = log μ, with μ in 1 / metre², or without unit for surfaces scaled to area 1, see
        `normalization`.
    sigma : float, optional
        Width σ > 0 of the weights; by default seven hundredths of the range of energies, as in the
        paper.
    pooling : {"histogram", "vertex mean"}
        "vertex mean" is the mean over vertices: it depends on their distribution over the surface,
        and is meaningful only for registered surfaces.
    normalization : {"none", "area"}
        Whether surfaces are compared at their size, or scaled to area 1.
    n_eigenvalues : int
        Number of eigenfunctions in the average.
    n_bins : int
        Number of bins of a histogram.
    laplacian : {"cotangent", "robust"}
        Discretisation, see `riemhuman.surfaces.spectrum`.

    Raises
    ------
    ArgumentTypeError
        If a parameter is of the wrong type.
    ArgumentError
        If a number is out of range, or a choice is unknown.

    References
    ----------
    .. [1] Aubry, Schlickewei, Cremers, "The wave kernel signature: A quantum mechanical approach
       to shape analysis", ICCV Workshops 2011.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> descriptor = rh.descriptors.WaveKernelSignature()
    >>> first, second = (descriptor.describe(f, bodies.template.faces) for f in bodies.points[:2])
    >>> bool(descriptor.distances([first, second])[0, 1] > 0)
    True
    """

    energies: tuple[float, ...] = _ENERGIES
    sigma: float | None = None
    pooling: str = "histogram"
    normalization: str = "none"
    n_eigenvalues: int = 60
    n_bins: int = 32
    laplacian: str = "cotangent"

    def __post_init__(self) -> None:
        energies = real_array(self.energies, "energies", ("n_energies",), batched=False)
        object.__setattr__(self, "energies", tuple(energies.tolist()))
        if energies.size == 0:
            raise ArgumentError("energies is empty; at least one is needed")
        if self.sigma is not None:
            real_number(self.sigma, "sigma", minimum=0.0, strict=True)
        elif np.ptp(energies) == 0:
            raise ArgumentError(
                "energies must hold at least two different numbers, or sigma be given; found "
                f"{self.energies}"
            )
        self._check_choices(_POOLINGS)

    def of_spectrum(self, found: Spectrum) -> np.ndarray:
        """Return the pooled signatures of a surface.

        Returns
        -------
        array, shape (n_energies * n_bins,), or (n_energies,) for a mean
        """
        found = self._scaled(found)
        used = found.areas > 0
        values = self._of(found)[:, used]
        if self.pooling == "histogram":
            return area_histograms(values, found.areas[used], _LOWER, _UPPER, self.n_bins)
        return values.mean(axis=1)

    def _of(self, found: Spectrum) -> np.ndarray:
        gaps = np.array(self.energies)[:, np.newaxis] - np.log(found.eigenvalues)
        sigma = 0.07 * np.ptp(self.energies) if self.sigma is None else self.sigma
        exponents = -(gaps**2) / (2 * sigma**2)
        # The largest weight is scaled to 1, so that it cannot underflow far from all eigenvalues.
        weights = np.exp(exponents - exponents.max(axis=1, keepdims=True))
        weights /= weights.sum(axis=1, keepdims=True)
        return found.areas.sum() * (weights @ found.functions**2)
