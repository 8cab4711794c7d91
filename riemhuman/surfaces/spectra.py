"""Spectra of the Laplace–Beltrami operator, which bending does not change, and mesh harmonics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, eigsh

from riemhuman.arrays import Array
from riemhuman.checks import checked, whole
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.kernels.elimination import symmetric_factor
from riemhuman.kernels.projections import with_positive_peaks
from riemhuman.representation import Record
from riemhuman.surfaces.measures import vertex_components
from riemhuman.surfaces.template import Template


@dataclass(frozen=True, eq=False, repr=False)
class Spectrum(Record):
    """Eigenvalues and eigenfunctions of a surface's Laplacian.

    Attributes
    ----------
    eigenvalues : array, shape (K,)
        Positive eigenvalues μ in increasing order, in 1 / metre², without zero.
    functions : array, shape (K, V)
        Eigenfunctions φ, orthonormal with respect to the vertex areas.
    constants : array, shape (V,)
        Sum of φ² over the eigenfunctions with μ = 0: one over the area of the vertex's component.
    areas : array, shape (V,)
        Vertex areas, in square metres; 0 at a vertex that no triangle uses.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> spectrum = rh.surfaces.spectrum(bodies[0], bodies.template.faces, 4)
    >>> spectrum.functions.shape
    (4, 1202)
    """

    eigenvalues: Array
    functions: Array
    constants: Array
    areas: Array

    def first(self, n_eigenvalues: int) -> Spectrum:
        """Return the lowest part of the spectrum.

        Parameters
        ----------
        n_eigenvalues : int
        """
        return replace(
            self,
            eigenvalues=self.eigenvalues[:n_eigenvalues],
            functions=self.functions[:n_eigenvalues],
        )


@checked(n_eigenvalues=whole(minimum=1))
def spectrum(vertices: ArrayLike, faces: ArrayLike, n_eigenvalues: int) -> Spectrum:
    """Return the lowest part of a surface's spectrum, without zero.

    Parameters
    ----------
    vertices : array_like, shape (V, 3), in metres
    faces : array_like, shape (F, 3)
        Vertex indices of each triangle, counted from 0. The mesh may be open. Vertices duplicated
        along a seam share their value.
    n_eigenvalues : int

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> spectrum = rh.surfaces.spectrum(bodies[0], bodies.template.faces, 4)
    >>> spectrum.eigenvalues.shape, bool((spectrum.eigenvalues > 0).all())
    ((4,), True)
    """
    mesh = Template(*check_mesh(vertices, faces))
    values, functions = harmonics(mesh, n_eigenvalues, "n_eigenvalues")
    components = vertex_components(mesh.joined_faces, mesh.n_vertices)
    if mesh.seams:
        components = components[mesh.seams.first_copies]
    sizes = np.bincount(components, mesh.vertex_areas)
    constants = np.divide(1.0, sizes, where=sizes > 0, out=np.zeros_like(sizes))[components]
    return Spectrum(values, functions, constants, mesh.vertex_areas)


# Shift of the spectrum, in units of the mean spacing 4π / area of Weyl's law, that makes the
# singular operator positive definite.
_SHIFT = 0.01

# Eigenvalues that differ by less than this share are copies of one.
_ROUNDING = 1e-8

# Meshes with up to this many vertices are solved densely.
_SMALL = 64


def harmonics(
    template: Template, n_harmonics: int, name: str = "n_harmonics"
) -> tuple[Array, Array]:
    """Return the lowest solutions of L h = μ A h with μ > 0, A the vertex areas, 0 where unused.

    Copies of vertices along seams have equal values, those of the joined mesh.
    """
    heat = template.vertex_heat
    areas, used = heat.masses, np.flatnonzero(heat.masses)
    components = vertex_components(template.joined_faces, len(areas))
    n_parts = len(np.unique(components[used]))
    if n_harmonics > len(used) - n_parts:
        raise ArgumentError(
            f"{name}={n_harmonics} exceeds the {len(used) - n_parts} of a mesh with {len(used)} "
            f"vertices in {n_parts} connected components"
        )
    # The lowest are constant on each connected part.
    values, vectors = lowest_eigenpairs(
        heat.laplacian[used][:, used], areas[used], n_parts + n_harmonics
    )
    functions = np.zeros((n_harmonics, len(areas)))
    functions[:, used] = vectors[:, n_parts:].T
    functions = with_positive_peaks(functions)
    copies = template.seams.first_copies if template.seams else slice(None)
    return values[n_parts:], functions[:, copies]


def lowest_eigenpairs(laplacian: sparse.csr_array, areas: Array, count: int) -> tuple[Array, Array]:
    """Return the lowest eigenvalues and eigenvectors of L h = μ A h."""
    n_vertices = len(areas)
    # Lanczos iterations need room; a small mesh has none.
    if n_vertices <= max(2 * count, _SMALL):
        values, vectors = linalg.eigh(
            laplacian.toarray(), np.diag(areas), subset_by_index=(0, count - 1), check_finite=False
        )
        return values, vectors
    shift = _SHIFT * 4 * np.pi / areas.sum()
    roots = np.sqrt(areas)
    masses = sparse.diags_array(areas)
    factor = symmetric_factor(laplacian + shift * masses)
    start = np.random.default_rng(0).normal(size=n_vertices)

    def more(n_more: int, known: Array) -> tuple[Array, Array]:
        def inverse(vector: Array) -> Array:
            image = roots * factor.solve(roots * vector.ravel())
            projected: Array = image - known @ (known.T @ image)
            return projected

        operator = LinearOperator((n_vertices, n_vertices), matvec=inverse, dtype=np.float64)
        # More Lanczos vectors need fewer restarts, but more orthogonalisation.
        n_lanczos = min(n_vertices, max(20, 3 * n_more // 2))
        inverses, vectors = eigsh(
            operator, n_more, which="LA", v0=start - known @ (known.T @ start), ncv=n_lanczos
        )
        return 1 / inverses - shift, vectors

    values, vectors = more(count, np.zeros((n_vertices, 0)))
    # Lanczos iterations may miss copies of an eigenvalue that symmetry makes multiple.
    limit = values.max() * (1 - _ROUNDING)
    # By Sylvester's law of inertia, as many are below the limit as pivots are negative.
    n_below = int(np.sum(symmetric_factor(laplacian - limit * masses).U.diagonal() < 0))
    n_missing = n_below - int(np.sum(values < limit))
    while n_missing > 0:
        new_values, new_vectors = more(n_missing, vectors)
        if new_values.min() >= limit:
            break
        values = np.concatenate([values, new_values])
        vectors = np.concatenate([vectors, new_vectors], axis=1)
        n_missing = n_below - int(np.sum(values < limit))
    order = np.argsort(values)[:count]
    return values[order], vectors[:, order] / roots[:, np.newaxis]
