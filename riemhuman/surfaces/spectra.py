"""Spectra of the Laplace–Beltrami operator, which bending does not change."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from riemhuman.checks import one_of, whole_number
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.optional import import_optional
from riemhuman.representation import Record
from riemhuman.surfaces.laplacian import harmonics, lowest_eigenpairs
from riemhuman.surfaces.template import Template

LAPLACIANS = ("cotangent", "robust")


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Record):
    """Eigenvalues and eigenfunctions of a surface's Laplacian.

    Attributes
    ----------
    eigenvalues : array, shape (K,)
        Positive eigenvalues μ in increasing order, in 1 / metre². Zero, the eigenvalue of functions
        that are constant on each connected component, is left out.
    functions : array, shape (K, V)
        Eigenfunctions φ, orthonormal with respect to the vertex areas.
    constants : array, shape (V,)
        Sum of φ² over the eigenfunctions with μ = 0: one over the area of the vertex's component.
    areas : array, shape (V,)
        Vertex areas, in square metres; 0 at a vertex that no triangle uses.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> found = rh.surfaces.spectrum(bodies[0], bodies.template.faces, 4)
    >>> found.eigenvalues.shape, bool((found.eigenvalues > 0).all())
    ((4,), True)
    """

    eigenvalues: np.ndarray
    functions: np.ndarray
    constants: np.ndarray
    areas: np.ndarray

    def first(self, n_eigenvalues: int) -> Spectrum:
        """Return the lowest part of the spectrum.

        Parameters
        ----------
        n_eigenvalues : int
            Number of eigenvalues to keep.

        Returns
        -------
        Spectrum
        """
        return replace(
            self,
            eigenvalues=self.eigenvalues[:n_eigenvalues],
            functions=self.functions[:n_eigenvalues],
        )

    def of_unit_area(self) -> Spectrum:
        """Return the spectrum of the surface scaled to area 1.

        Returns
        -------
        Spectrum
        """
        area = self.areas.sum()
        return Spectrum(
            area * self.eigenvalues,
            np.sqrt(area) * self.functions,
            area * self.constants,
            self.areas / area,
        )


def spectrum(
    vertices: ArrayLike, faces: ArrayLike, n_eigenvalues: int, laplacian: str = "cotangent"
) -> Spectrum:
    """Return the lowest part of a surface's spectrum, without zero.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        Vertex positions, in metres.
    faces : array_like, shape (F, 3)
        Vertex indices of each triangle, counted from 0. The mesh may be open.
    n_eigenvalues : int
        Number of eigenvalues.
    laplacian : {"cotangent", "robust"}
        The cotangent Laplacian, see `riemhuman.kernels.laplacian.cotangent_laplacian`, or the
        intrinsic Delaunay Laplacian of Sharp and Crane, "A Laplacian for Nonmanifold Triangle
        Meshes", SGP 2020, which also works for slivers, triangles without area and edges with more
        than two triangles. The second needs the package robust_laplacian.

    Returns
    -------
    Spectrum

    Raises
    ------
    ArgumentTypeError
        If an array does not hold numbers of the right kind.
    ArgumentError
        If the arrays are no mesh, or the mesh has fewer eigenvalues.
    DegenerateSurfaceError
        If a triangle has no area, with the cotangent Laplacian.
    MissingDependencyError
        If robust_laplacian is requested and not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> found = rh.surfaces.spectrum(bodies[0], bodies.template.faces, 4)
    >>> found.eigenvalues.shape, bool((found.eigenvalues > 0).all())
    ((4,), True)
    """
    n_eigenvalues = whole_number(n_eigenvalues, "n_eigenvalues", minimum=1)
    if one_of(laplacian, "laplacian", LAPLACIANS) == "robust":
        return _robust_spectrum(*check_mesh(vertices, faces), n_eigenvalues)
    try:
        mesh = Template(vertices, faces)
    except DegenerateSurfaceError as error:
        raise DegenerateSurfaceError(
            f"{str(error).replace('the template', 'the mesh').split(';')[0]}; the cotangent "
            'Laplacian needs triangles with area; laplacian="robust" does not'
        ) from error
    _refuse_too_many(n_eigenvalues, mesh.faces, mesh.n_vertices)
    values, functions = harmonics(mesh, n_eigenvalues)
    constants = _constants(mesh.faces, mesh.vertex_areas)
    return Spectrum(values, functions, constants, mesh.vertex_areas)


def _robust_spectrum(vertices: np.ndarray, faces: np.ndarray, n_eigenvalues: int) -> Spectrum:
    robust_laplacian = import_optional("robust_laplacian", "spectra")
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    used, compact = np.unique(faces, return_inverse=True)
    compact = compact.reshape(faces.shape)
    n_components = _refuse_too_many(n_eigenvalues, faces, len(vertices))
    stiffness, mass = robust_laplacian.mesh_laplacian(vertices[used], compact)
    areas = np.zeros(len(vertices))
    areas[used] = mass.diagonal()
    values, vectors = lowest_eigenpairs(
        sparse.csr_array(stiffness), areas[used], n_components + n_eigenvalues
    )
    functions = np.zeros((n_eigenvalues, len(vertices)))
    functions[:, used] = vectors[:, n_components:].T
    return Spectrum(values[n_components:], functions, _constants(faces, areas), areas)


def _refuse_too_many(n_eigenvalues: int, faces: np.ndarray, n_vertices: int) -> int:
    """Return the number of connected components; refuse more eigenvalues than there are."""
    n_used = len(np.unique(faces))
    n_components = int(_components(faces, n_vertices).max()) + 1 - (n_vertices - n_used)
    if n_eigenvalues > n_used - n_components:
        raise ArgumentError(
            f"n_eigenvalues={n_eigenvalues} exceeds the {n_used - n_components} of a mesh with "
            f"{n_used} vertices in {n_components} connected components"
        )
    return n_components


def _components(faces: np.ndarray, n_vertices: int) -> np.ndarray:
    """Return the connected component of every vertex."""
    first, second = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    links = sparse.coo_array((np.ones(len(first)), (first, second)), shape=(n_vertices,) * 2)
    return connected_components(links, directed=False)[1]


def _constants(faces: np.ndarray, areas: np.ndarray) -> np.ndarray:
    components = _components(faces, len(areas))
    sizes = np.bincount(components, areas)
    return np.divide(1.0, sizes, where=sizes > 0, out=np.zeros_like(sizes))[components]
