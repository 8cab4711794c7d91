"""ShapeDNA: the eigenvalues of the Laplace–Beltrami operator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from riemhuman.checks import one_of, whole_number
from riemhuman.descriptors.spectral_descriptor import SpectralDescriptor
from riemhuman.surfaces.spectra import LAPLACIANS, Spectrum

_NORMALIZATIONS = ("none", "area", "first")


@dataclass(frozen=True)
class ShapeDNA(SpectralDescriptor):
    r"""The first eigenvalues of the Laplace–Beltrami operator, without zero [1]_.

    They depend only on lengths within the surface, so bending does not change them. By Weyl's law
    they grow like :math:`\mu_k \approx 4\pi k / A`; divided by k, they have similar sizes. The
    distance is Euclidean.

    Parameters
    ----------
    n_eigenvalues : int
        Number of eigenvalues.
    normalization : {"none", "area", "first"}
        "none" keeps eigenvalues in 1 / metre², which depend on the size of the body. "area"
        multiplies them by the area of the surface, and "first" divides them by the first one; both
        remove the size.
    reweighted : bool
        Whether to divide the k-th eigenvalue by k.
    laplacian : {"cotangent", "robust"}
        Discretisation, see `riemhuman.surfaces.spectrum`.

    Raises
    ------
    ArgumentTypeError
        If a parameter is of the wrong type.
    ArgumentError
        If the normalisation or Laplacian is unknown, or `n_eigenvalues` is less than one.

    References
    ----------
    .. [1] Reuter, Wolter, Peinecke, "Laplace–Beltrami spectra as 'Shape-DNA' of surfaces and
       solids", Computer-Aided Design 38(4), 2006.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> descriptor = rh.descriptors.ShapeDNA(n_eigenvalues=10)
    >>> first, second = (descriptor.describe(f, bodies.template.faces) for f in bodies.points[:2])
    >>> bool(descriptor.distances([first, second])[0, 1] > 0)
    True
    """

    n_eigenvalues: int = 50
    normalization: str = "none"
    reweighted: bool = True
    laplacian: str = "cotangent"

    def __post_init__(self) -> None:
        whole_number(self.n_eigenvalues, "n_eigenvalues", minimum=1)
        one_of(self.normalization, "normalization", _NORMALIZATIONS)
        one_of(self.laplacian, "laplacian", LAPLACIANS)

    def of_spectrum(self, found: Spectrum) -> np.ndarray:
        """Return the eigenvalues of a surface.

        Returns
        -------
        array, shape (n_eigenvalues,)
        """
        values = found.eigenvalues[: self.n_eigenvalues]
        if self.normalization == "area":
            values = values * found.areas.sum()
        elif self.normalization == "first":
            values = values / values[0]
        return values / np.arange(1, len(values) + 1) if self.reweighted else values
