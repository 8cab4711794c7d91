"""ShapeDNA: the eigenvalues of the Laplace–Beltrami operator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import one_of, whole_number
from riemhuman.descriptors.descriptor import Descriptor
from riemhuman.descriptors.spectra import LAPLACIANS, spectrum

_NORMALIZATIONS = ("none", "area", "first")


@dataclass(frozen=True)
class ShapeDNA(Descriptor):
    r"""The first eigenvalues of the Laplace–Beltrami operator, without zero [1]_.

    They depend on lengths within the surface alone, so that bending leaves them as they are. By
    Weyl's law they grow like :math:`\mu_k \approx 4\pi k / A`: divided by k, all count alike.
    The distance is Euclidean.

    Parameters
    ----------
    n_eigenvalues : int
        How many eigenvalues.
    normalization : {"none", "area", "first"}
        "none" keeps 1 / metre², and with it the size of the body; "area" multiplies by the area
        of the surface, "first" divides by the first eigenvalue, which take the size out.
    reweighted : bool
        Whether the k-th eigenvalue is divided by k.
    laplacian : {"cotangent", "robust"}
        Discretisation, see `riemhuman.descriptors.spectra.spectrum`.

    Raises
    ------
    ArgumentTypeError
        If a parameter is of the wrong type.
    ArgumentError
        If there is no such normalisation or Laplacian, or no eigenvalue is asked for.

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

    _in_threads = False

    n_eigenvalues: int = 50
    normalization: str = "none"
    reweighted: bool = True
    laplacian: str = "cotangent"

    def __post_init__(self) -> None:
        whole_number(self.n_eigenvalues, "n_eigenvalues", minimum=1)
        one_of(self.normalization, "normalization", _NORMALIZATIONS)
        one_of(self.laplacian, "laplacian", LAPLACIANS)

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> np.ndarray:
        """Return the eigenvalues of one surface.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres.
        faces : array_like, shape (F, 3)
            Vertex indices of each triangle, counted from 0.

        Returns
        -------
        array, shape (n_eigenvalues,)

        Raises
        ------
        ArgumentTypeError
            If an array does not hold numbers of the right kind.
        ArgumentError
            If the arrays are no mesh, or the mesh has fewer eigenvalues.
        DegenerateSurfaceError
            If a triangle has no area, with the cotangent Laplacian.
        """
        found = spectrum(vertices, faces, self.n_eigenvalues, self.laplacian)
        values = found.eigenvalues
        if self.normalization == "area":
            values = values * found.areas.sum()
        elif self.normalization == "first":
            values = values / values[0]
        return values / np.arange(1, len(values) + 1) if self.reweighted else values
