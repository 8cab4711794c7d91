"""The lowest eigenfunctions of the cotangent Laplacian of a template."""

from __future__ import annotations

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from riemhuman.checks import whole_number
from riemhuman.errors import ArgumentError
from riemhuman.kernels.laplacian import cotangent_laplacian
from riemhuman.surfaces.template import Template

# Shift of the spectrum, in units of the mean spacing 4π / area of Weyl's law, that makes the
# singular operator positive definite.
_SHIFT = 0.01


def harmonics(template: Template, n_harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest eigenfunctions of the Laplacian with positive eigenvalues.

    Solves L h = μ A h, with the vertex areas A as lumped masses. Functions that are constant on
    every connected component have μ = 0 and are left out. Vertices that no triangle uses have the
    value 0.

    Parameters
    ----------
    template : Template
        The mesh.
    n_harmonics : int
        Number of eigenfunctions.

    Returns
    -------
    eigenvalues : array, shape (n_harmonics,)
        Eigenvalues μ > 0 in increasing order, in 1 / metre².
    functions : array, shape (n_harmonics, V)
        Eigenfunctions, orthonormal with respect to the vertex areas. The entry of the largest
        magnitude in each is positive.

    Raises
    ------
    ArgumentError
        If the mesh has fewer such eigenfunctions.
    """
    n_harmonics = whole_number(n_harmonics, "n_harmonics", minimum=1)
    used = np.flatnonzero(template.vertex_areas)
    n_constant = _n_components(template) - (template.n_vertices - len(used))
    if n_harmonics > len(used) - n_constant:
        raise ArgumentError(
            f"n_harmonics={n_harmonics} exceeds the {len(used) - n_constant} harmonics of a mesh "
            f"with {len(used)} vertices in {n_constant} connected components"
        )
    laplacian = cotangent_laplacian(template.vertices, template.faces)[used][:, used]
    areas = template.vertex_areas[used]
    values, vectors = lowest_eigenpairs(laplacian, areas, n_constant + n_harmonics)
    functions = np.zeros((n_harmonics, template.n_vertices))
    functions[:, used] = vectors[:, n_constant:].T
    peaks = np.abs(functions).argmax(axis=1)
    functions *= np.sign(functions[np.arange(n_harmonics), peaks])[:, np.newaxis]
    return values[n_constant:], functions


def _n_components(template: Template) -> int:
    """Count connected components; a vertex that no triangle uses is one by itself."""
    first, second = template.edges.T
    graph = sparse.csr_array(
        (np.ones(len(first)), (first, second)), shape=(template.n_vertices,) * 2
    )
    return int(sparse.csgraph.connected_components(graph, directed=False, return_labels=False))


def lowest_eigenpairs(
    laplacian: sparse.csr_array, areas: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest eigenvalues and eigenvectors of L h = μ A h.

    Parameters
    ----------
    laplacian : sparse array, shape (V, V)
        Symmetric positive semi-definite matrix L.
    areas : array, shape (V,)
        Positive masses A.
    count : int
        Number of eigenvalues, those of μ = 0 included.

    Returns
    -------
    eigenvalues : array, shape (count,)
        In increasing order.
    vectors : array, shape (V, count)
        Eigenvectors, orthonormal with respect to the masses.
    """
    n_vertices = len(areas)
    if 2 * count >= n_vertices:  # Lanczos iterations need room; a small mesh has none
        return linalg.eigh(
            laplacian.toarray(), np.diag(areas), subset_by_index=(0, count - 1), check_finite=False
        )
    shift = _SHIFT * 4 * np.pi / areas.sum()
    roots = np.sqrt(areas)
    factor = _factor(laplacian, areas, -shift)
    start = np.random.default_rng(0).normal(size=n_vertices)

    def more(n_more: int, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        def inverse(vector: np.ndarray) -> np.ndarray:
            image = roots * factor.solve(roots * vector.ravel())
            return image - known @ (known.T @ image)

        operator = LinearOperator((n_vertices, n_vertices), matvec=inverse, dtype=np.float64)
        # More Lanczos vectors need fewer restarts, but more orthogonalisation.
        n_lanczos = min(n_vertices, max(20, 3 * n_more // 2))
        inverses, vectors = eigsh(
            operator, n_more, which="LA", v0=start - known @ (known.T @ start), ncv=n_lanczos
        )
        return 1 / inverses - shift, vectors

    values, vectors = more(count, np.zeros((n_vertices, 0)))
    # Lanczos iterations may miss copies of an eigenvalue that symmetry makes multiple.
    limit = values.max() * (1 - 1e-8)
    while (n_missing := _n_below(laplacian, areas, limit) - int(np.sum(values < limit))) > 0:
        new_values, new_vectors = more(n_missing, vectors)
        if new_values.min() >= limit:
            break
        values = np.concatenate([values, new_values])
        vectors = np.concatenate([vectors, new_vectors], axis=1)
    order = np.argsort(values)[:count]
    return values[order], vectors[:, order] / roots[:, np.newaxis]


def _n_below(laplacian: sparse.csr_array, areas: np.ndarray, limit: float) -> int:
    """Count the eigenvalues below a limit by Sylvester's law of inertia."""
    return int(np.sum(_factor(laplacian, areas, limit).U.diagonal() < 0))


def _factor(laplacian: sparse.csr_array, areas: np.ndarray, shift: float) -> SuperLU:
    """Factorise L - shift A without pivoting, so that the factors are symmetric."""
    return splu(
        sparse.csc_array(laplacian - shift * sparse.diags_array(areas)),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
