"""Principal components of motions: how performances of one motion vary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.estimator import Estimator
from riemhuman.geometry import ProductManifold, ProductMetric
from riemhuman.motions.frames import Motion
from riemhuman.motions.motion_mean import MotionMean, elastic_metric
from riemhuman.motions.rate_dependent_metric import RateDependentMetric
from riemhuman.protocols import uninterrupted
from riemhuman.solvers.nearest_surface import NearestSurface
from riemhuman.solvers.tangent_pca import TangentPCA


class MotionComponents(Estimator):
    """Tangent principal component analysis of motions at their mean, after re-timing.

    The fields of the aligned motions are points of a product with one factor for every time, where
    exponential and logarithm have closed forms. Differences of timing are not in the components,
    but in ``mean_.times_``.

    Parameters
    ----------
    mean : MotionMean
        Estimator of the mean, which also aligns motions with it.
    n_components : int, optional
        Number of components; by default as many as the motions span.

    Attributes
    ----------
    mean_ : array, shape (n_times, V, 3)
        The mean motion.
    scores_ : array, shape (n, n_components)
        Coordinates of the motions.
    explained_variance_, explained_variance_ratio_ : array, shape (n_components,)
        Variance along each component, and its share of the total.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[:3]
    >>> space = rh.AlignedSurfaces(knees[0].template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    >>> mean = rh.motions.MotionMean(rh.motions.MotionSpace(space, n_times=3), n_iterations=1)
    >>> components = rh.motions.MotionComponents(mean, 1).fit([m[:30:6] for m in knees])
    >>> components.inverse_transform(components.scores_[:1]).shape
    (1, 3, 1202, 3)
    """

    mean_: ndarray
    scores_: ndarray
    explained_variance_: ndarray
    explained_variance_ratio_: ndarray

    def __init__(self, mean: MotionMean, n_components: int | None = None) -> None:
        self.mean = mean
        self.n_components = n_components

    def fit(self, X: Sequence[Motion], y: object = None) -> Self:
        """Find the mean and the components.

        Parameters
        ----------
        X : sequence of motions
            Motions, at least two.
        y : object
            Not used.

        Returns
        -------
        MotionComponents
            The estimator itself.

        Raises
        ------
        ArgumentError
            If a motion is wrong, or there are too few for the components.
        OutsideManifoldError
            If the fields of a motion have no logarithm at those of the mean.
        """
        self.mean.fit(X)
        self.mean_ = self.mean.estimate_
        space = self.mean.space
        self._metric: Any = self.mean.metric or elastic_metric(space)
        space_of_images: Any = self._metric.target_metric.space
        fields = ProductManifold([space_of_images] * space.n_times)
        weights = RateDependentMetric(space, self._metric).time_weights
        fields.equip_with_metric(ProductMetric, weights=weights)
        images = np.stack([self._images(motion) for motion in self.mean.aligned_])
        self._pca = TangentPCA(fields, self.n_components, mean=self._images(self.mean_))
        self.scores_ = self._pca.fit_transform(images)
        self.explained_variance_ = self._pca.explained_variance_
        self.explained_variance_ratio_ = self._pca.explained_variance_ratio_
        return self

    def inverse_transform(self, X: ndarray) -> ndarray:
        """Return the motions with these coordinates: at every time, the nearest surface.

        Parameters
        ----------
        X : array, shape (n, m)
            Coordinates along the first m components; the others are 0.

        Returns
        -------
        array, shape (n, n_times, V, 3)

        Raises
        ------
        ArgumentError
            If there are more coordinates than components.
        """
        scores = real_array(X, "X", ("n", "n_components"), batched=False)
        product: Any = self._pca.space
        solver = self.mean.nearest or NearestSurface()
        motions = np.empty((len(scores), *self.mean_.shape))
        for motion, images in zip(motions, self._pca.inverse_transform(scores), strict=True):
            for t, image in enumerate(product.project_from_product(images)):
                found = solver.solve(self._metric, image[np.newaxis], self.mean_[t])
                motion[t] = uninterrupted(found).point
        return motions

    def _images(self, motion: ndarray) -> ndarray:
        return np.asarray(self._metric.map(motion)).reshape(-1)
