"""Embeddings of distance matrices in the plane."""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import Rng, generator, one_of, real_array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.optional import import_optional

METHODS = ("t-sne", "mds")

# Perplexity of t-SNE: about the number of bodies in a class.
_PERPLEXITY = 10.0


def embed(distances: ArrayLike, method: str = "t-sne", rng: Rng = 0) -> ndarray:
    """Embed items in the plane by their distances.

    Parameters
    ----------
    distances : array_like, shape (n, n)
        Symmetric distances.
    method : {"t-sne", "mds"}
        t-distributed stochastic neighbour embedding [1]_, which preserves neighbourhoods, or
        classical multidimensional scaling, which approximates distances.
    rng : int or numpy.random.Generator
        Seed of t-SNE.

    Returns
    -------
    array, shape (n, 2)

    Raises
    ------
    ArgumentError
        If the matrix is not square, symmetric, non-negative and of at least three items, or the
        method is unknown.
    MissingDependencyError
        If scikit-learn, which provides t-SNE, is not installed.

    References
    ----------
    .. [1] van der Maaten, Hinton, "Visualizing data using t-SNE", JMLR 2008.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> D = space.metric.dist_pairwise(bodies.points[:30])
    >>> rh.plots.embed(D, method="mds").shape
    (30, 2)
    """
    matrix = real_array(distances, "distances", ("n", "n"), batched=False)
    one_of(method, "method", METHODS)
    n_items = len(matrix)
    if matrix.shape != (n_items, n_items) or n_items < 3:
        raise ArgumentError(
            f"distances must be a square matrix of at least 3 items; found shape {matrix.shape}"
        )
    if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=0) or matrix.min() < 0:
        raise ArgumentError("distances must be symmetric and not negative")
    start = classical_scaling(matrix)
    if method == "mds":
        return start
    manifold = import_optional("sklearn.manifold", "report")
    # The recommended scale of initial positions for t-SNE.
    start = start / max(float(start[:, 0].std()), 1e-30) * 1e-4
    seed = int(generator(rng).integers(2**31))
    estimator = manifold.TSNE(
        metric="precomputed",
        init=start,
        perplexity=min(_PERPLEXITY, (n_items - 1) / 3),
        learning_rate="auto",
        random_state=seed,
    )
    with single_threaded_libraries():  # threads do not pay for so few points
        return np.asarray(estimator.fit_transform(matrix), dtype=np.float64)


def classical_scaling(distances: ndarray) -> ndarray:
    """Return positions in the plane by classical multidimensional scaling.

    They are the two leading eigenvectors of −½ J D² J, with the squared distances D² and the
    centring matrix J, each times the square root of its eigenvalue (Torgerson, 1952).

    Parameters
    ----------
    distances : array, shape (n, n)
        Symmetric distances.

    Returns
    -------
    array, shape (n, 2)
        Centred, with the wider axis first; the farthest item along each axis has a positive
        coordinate.
    """
    squared = distances**2
    means = squared.mean(axis=0)
    products = -0.5 * (squared - means - means[:, None] + means.mean())
    values, vectors = np.linalg.eigh(products)
    positions = vectors[:, [-1, -2]] * np.sqrt(np.maximum(values[[-1, -2]], 0.0))
    farthest = positions[np.abs(positions).argmax(axis=0), [0, 1]]
    return positions * np.where(farthest < 0, -1.0, 1.0)


def stress(distances: ndarray, positions: ndarray) -> float:
    r"""Return Kruskal's stress √(Σ (d_ij − δ_ij)² / Σ d_ij²) of an embedding, over all pairs.

    Parameters
    ----------
    distances : array, shape (n, n)
        Distances d between the items.
    positions : array, shape (n, 2)
        Embedded items, with distances δ.

    Returns
    -------
    float
        0 if the embedding preserves all distances.
    """
    on_map = np.linalg.norm(positions[:, None] - positions[None], axis=-1)
    return float(np.sqrt(((distances - on_map) ** 2).sum() / (distances**2).sum()))
