"""Codes whose Euclidean distances approximate the distances of a metric."""

from __future__ import annotations

from typing import Self

import numpy as np
from scipy import sparse

from riemhuman.arrays import Array, ArrayLike
from riemhuman.checks import whole_number
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.projections import in_blocks, principal_components

# Squared differences of bodies below this share of their squares are rounding errors.
_ROUNDING = 1e-12

# Largest number of bodies whose distances give the factor of all codes.
_N_SCALED = 64


class MetricCodes(Estimator):
    r"""Codes of bodies whose Euclidean distances approximate those of a metric.

    Codes consist of principal components of `RiemannianMetric.lower_bound_coordinates` for your own
    bodies, and of random projections [1]_ of the remainder, by which other bodies differ from
    these. A factor makes distances of codes as large, on average, as those of the metric. Comparing
    many bodies by codes takes the time of a matrix product. For exact nearest neighbours, pass the
    bodies with the nearest codes to `NearestNeighbors.kneighbors` as `candidates`.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric; it must have `lower_bound_coordinates`.
    n_codes : int
        Number of entries of a code. The error of random projections is about ``1 / sqrt(n_codes)``
        of the remainder's squared distance.
    n_components : int
        Largest number of principal components among them.
    random_state : int
        Seed of the random projections.

    Attributes
    ----------
    mean_, components_ : array, shape (m,) and (k, m)
        Mean coordinates of the fitted bodies, and principal directions.
    scale_ : float
        The factor of all codes.

    References
    ----------
    .. [1] Achlioptas, "Database-friendly random projections: Johnson-Lindenstrauss with binary
       coins", Journal of Computer and System Sciences 66, 2003.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse", "natural")
    >>> shape = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template), a=1.0, lam=1e-4, c=0.0)
    >>> codes = rh.learned.MetricCodes(shape, n_codes=256).fit(bodies.points[:20])
    >>> codes.transform(bodies.points[20:22]).shape
    (2, 256)
    """

    mean_: Array
    components_: Array
    scale_: float

    def __init__(
        self,
        metric: RiemannianMetric,
        n_codes: int = 1024,
        *,
        n_components: int = 64,
        random_state: int = 0,
    ) -> None:
        self.metric = metric
        self.n_codes = n_codes
        self.n_components = n_components
        self.random_state = random_state

    def fit(self, X: Array, y: object = None) -> Self:
        """Fit the codes to bodies.

        Parameters
        ----------
        X : array, shape (n, V, 3)
            Bodies of the kind to be compared, at least three, or rows (n, 3V).
        y : object
            Not used.
        """
        n_codes = whole_number(self.n_codes, "n_codes", minimum=2)
        n_components = whole_number(self.n_components, "n_components", minimum=1)
        seed = whole_number(self.random_state, "random_state", minimum=0)
        coordinates = self._coordinates(X)
        if len(coordinates) < 3:
            raise ArgumentError(f"X must hold at least three bodies; found {len(coordinates)}")
        if np.sum(np.ptp(coordinates, axis=0) ** 2) <= _ROUNDING * np.sum(coordinates**2):
            raise ArgumentError("X must hold different bodies; all are the same to rounding")
        self.mean_, self.components_ = principal_components(
            coordinates, min(n_components, n_codes - 1)
        )
        n_random = n_codes - len(self.components_)
        self._projection = _random_signs(coordinates.shape[1], n_random, seed)
        self.scale_ = 1.0
        numbers = np.linspace(0, len(coordinates) - 1, min(len(coordinates), _N_SCALED)).astype(int)
        codes = self._encode(coordinates)[numbers]
        distances = self.metric.dist_pairwise(self.metric.check_points(X, "X")[numbers])
        i, j = np.triu_indices(len(numbers), 1)
        of_codes = np.linalg.norm(codes[i] - codes[j], axis=1)
        self.scale_ = float(distances[i, j].sum() / of_codes.sum())
        return self

    def transform(self, X: Array) -> Array:
        """Return the codes of bodies.

        Parameters
        ----------
        X : array, shape (n, V, 3)
            Bodies, or rows (n, 3V).
        """
        self._require_fit("scale_")
        return self._encode(self._coordinates(X))

    def fit_transform(self, X: Array, y: object = None) -> Array:
        """Fit the codes to bodies, and return the codes of the same bodies.

        Parameters
        ----------
        X : array, shape (n, V, 3)
        y : object
            Not used.
        """
        return self.fit(X).transform(X)

    def _encode(self, coordinates: Array) -> Array:
        centered = coordinates - self.mean_
        principal = centered @ self.components_.T
        remainder = centered - principal @ self.components_
        return self.scale_ * np.concatenate([principal, remainder @ self._projection], axis=1)

    def _coordinates(self, X: ArrayLike) -> Array:
        points = self.metric.check_points(X, "X")
        if not len(points):
            return np.empty((0, len(getattr(self, "mean_", ()))))
        return in_blocks(self.metric.lower_bound_coordinates, points)


def _random_signs(n_rows: int, n_columns: int, seed: int) -> sparse.csr_array:
    """Return sparse random signs, by which rows keep their lengths in the mean."""
    rng = np.random.default_rng(seed)
    n_each = max(1, round(np.sqrt(n_columns)))
    columns = rng.integers(n_columns, size=(n_rows, n_each))
    signs = rng.choice([-1.0, 1.0], size=(n_rows, n_each)) / np.sqrt(n_each)
    rows = np.repeat(np.arange(n_rows), n_each)
    shape = (n_rows, n_columns)
    return sparse.csr_array((signs.ravel(), (rows, columns.ravel())), shape=shape)
