"""Weights (a, λ, c) of the elastic metric, fitted to labels."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_array, real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.statistics.triplets import Triplets

Score = Callable[[ndarray, ndarray], float]


class MetricWeights(Estimator):
    r"""Weights (a, λ, c) of `ElasticMetric` that separate labels best, scored on held-out groups.

    The squared distance is :math:`a\,d_\lambda^2 + c\,d_n^2`, so for every λ two matrices hold the
    distances of all a and c. Only the ratio of the two matters, and the best one is found exactly:
    the share of triplets (a body, one of its class, one of another) in the right order changes at
    finitely many ratios. With another score, ratios on a grid are tried.

    The held-out score comes from cross-validation over groups: the bodies of one fold of the groups
    are held out, λ and the ratio are chosen with the others alone, and the held-out bodies are
    scored. Triplets then have a held-out query and any items; another score sees the distances
    among the held-out bodies.

    Parameters
    ----------
    space : AlignedSurfaces
        Surfaces over a template; its own metric is not used.
    lams : sequence of float
        Values of λ to try.
    scoring : callable, optional
        Maps distances (n, n) and labels (n,) to a score, the higher the better, such as ``lambda
        distances, labels: scores(distances, labels).first_tier``. By default the share of triplets
        in the right order.
    tolerance : float
        Shares of triplets this close to the best count as equal. Among them, a single term is
        preferred to two; otherwise the middle of their widest interval is taken.
    n_folds : int
        Number of folds.
    n_ratios : int
        Number of ratios tried with `scoring`, the two pure metrics included.
    max_triplets : int
        Approximate largest number of triplets, chosen at random.
    rng : int or numpy.random.Generator
        Seed of folds and triplets, or the generator to draw from.
    n_jobs : int, optional
        Number of threads for distances.

    Attributes
    ----------
    a_, lam_, c_ : float
        The weights; the larger of a and c is 1, and λ is 0 where a is 0.
    metric_ : ElasticMetric
        The metric with these weights.
    fit_score_ : float
        Score on all bodies, to which it was fitted.
    held_out_score_ : float
        Mean score on held-out bodies.
    held_out_scores_ : array, shape (n_folds,)
        Score of each fold.
    fold_weights_ : list of tuple of float
        (a, λ, c) chosen without each fold.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> weights = rh.MetricWeights(space, lams=(1e-4, 1.0))
    >>> fitted = weights.fit(bodies.points[:30], bodies.subject[:30])
    >>> type(fitted.metric_).__name__
    'ElasticMetric'
    """

    a_: float
    lam_: float
    c_: float
    metric_: ElasticMetric
    fit_score_: float
    held_out_score_: float
    held_out_scores_: ndarray
    fold_weights_: list[tuple[float, float, float]]

    def __init__(
        self,
        space: AlignedSurfaces,
        lams: Sequence[float] = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0),
        *,
        scoring: Score | None = None,
        tolerance: float = 1e-4,
        n_folds: int = 5,
        n_ratios: int = 41,
        max_triplets: int = 1_000_000,
        rng: Rng = 0,
        n_jobs: int | None = None,
    ) -> None:
        self.space = space
        self.lams = lams
        self.scoring = scoring
        self.tolerance = tolerance
        self.n_folds = n_folds
        self.n_ratios = n_ratios
        self.max_triplets = max_triplets
        self.rng = rng
        self.n_jobs = n_jobs

    def fit(self, X: ndarray, y: Sequence[Hashable] | ndarray, groups: Any = None) -> Self:
        """Find the weights, and the held-out scores.

        Parameters
        ----------
        X : array, shape (n, V, 3)
            Surfaces.
        y : sequence of hashable, length n
            Label of each, such as who it is or which pose it holds.
        groups : sequence of hashable, length n, optional
            Group of each surface, such as the person, which is never on both sides of a split; by
            default every surface is a group.

        Returns
        -------
        MetricWeights
            The estimator itself.

        Raises
        ------
        ArgumentError
            If there are fewer groups than folds, all labels are the same, or no two surfaces share
            a label.
        """
        lams = [real_number(lam, "lams", minimum=0.0, strict=True) for lam in self.lams]
        if not lams:
            raise ArgumentError("lams must hold at least one value of λ; found none")
        real_number(self.tolerance, "tolerance", minimum=0.0)
        whole_number(self.n_folds, "n_folds", minimum=2)
        whole_number(self.n_ratios, "n_ratios", minimum=2)
        whole_number(self.max_triplets, "max_triplets", minimum=1)
        points = real_array(X, "X", ("n", *self.space.shape), batched=False)
        labels = _Labels.of(y, len(points))
        if labels.classes.max() == 0:
            raise ArgumentError(f"y must name at least two classes; all labels are {y[0]!r}")
        rng = generator(self.rng)
        folds = self._folds(groups, len(points), rng)

        squares = _Squares(
            {lam: self._squared(points, 1.0, lam, 0.0) for lam in lams},
            self._squared(points, 0.0, 0.0, 1.0),
        )
        everyone = np.arange(len(points))
        scores = []
        self.fold_weights_ = []
        for fold in range(self.n_folds):
            held_out, kept = everyone[folds == fold], everyone[folds != fold]
            weights, _ = self._choose(squares, labels, kept, rng)
            self.fold_weights_.append(weights)
            scores.append(self._score(squares.mixed(*weights), labels, held_out, everyone, rng))
        self.held_out_scores_ = np.array(scores)
        self.held_out_score_ = float(self.held_out_scores_.mean())
        weights, self.fit_score_ = self._choose(squares, labels, everyone, rng)
        self.a_, self.lam_, self.c_ = weights
        self.metric_ = ElasticMetric(self.space, *weights)
        return self

    def score(self, X: ndarray, y: Sequence[Hashable] | ndarray) -> float:
        """Return the score of the fitted metric on surfaces.

        Parameters
        ----------
        X : array, shape (n, V, 3)
            Surfaces.
        y : sequence of hashable, length n
            Their labels.

        Returns
        -------
        float
        """
        self._require_fit("metric_")
        points = real_array(X, "X", ("n", *self.space.shape), batched=False)
        labels = _Labels.of(y, len(points))
        squared = self._squared(points, self.a_, self.lam_, self.c_)
        everyone = np.arange(len(points))
        return self._score(squared, labels, everyone, everyone, generator(self.rng))

    def _squared(self, points: ndarray, a: float, lam: float, c: float) -> ndarray:
        metric = ElasticMetric(self.space, a, lam, c)
        return metric.dist_pairwise(points, n_jobs=self.n_jobs) ** 2

    def _folds(self, groups: Any, n_points: int, rng: np.random.Generator) -> ndarray:
        """Return the fold of every surface."""
        members = np.arange(n_points)
        if groups is not None:
            members = _numbers(groups, "groups", n_points)
        n_groups = int(members.max()) + 1
        if n_groups < self.n_folds:
            raise ArgumentError(
                f"groups holds {n_groups} groups; n_folds={self.n_folds} folds need as many"
            )
        return (rng.permutation(n_groups) % self.n_folds)[members]

    def _choose(
        self, squares: _Squares, labels: _Labels, items: ndarray, rng: np.random.Generator
    ) -> tuple[tuple[float, float, float], float]:
        """Return the best weights and their score, as far as these items tell."""
        of_normals, unit_of_normals = squares.in_units(squares.of_normals, items)
        triplets = None
        if self.scoring is None:
            triplets = Triplets.of_labels(labels.classes, items, items, self.max_triplets, rng)
        best, chosen = -np.inf, (0.0, 0.0, 1.0)
        for lam, squared in squares.of_metrics.items():
            of_metrics, unit_of_metrics = squares.in_units(squared, items)
            if triplets is not None:
                mixture, score = triplets.best_mixture(of_metrics, of_normals, self.tolerance)
            else:
                mixture, score = self._search(of_metrics, of_normals, labels, items)
            if score > best:
                best = score
                a, c = (1.0 - mixture) / unit_of_metrics, mixture / unit_of_normals
                larger = max(a, c)
                chosen = (a / larger, lam if a else 0.0, c / larger)
        return chosen, best

    def _search(
        self, first: ndarray, second: ndarray, labels: _Labels, items: ndarray
    ) -> tuple[float, float]:
        """Return the best mixture on the grid: a pure one if it is, else the middle of the best."""
        mixtures = np.linspace(0.0, 1.0, self.n_ratios)
        scores = np.array(
            [self._call((1.0 - b) * first + b * second, labels, items) for b in mixtures]
        )
        best = np.flatnonzero(scores == scores.max())
        for end in (0, len(mixtures) - 1):
            if end in best:
                return float(mixtures[end]), float(scores[end])
        runs = np.split(best, np.flatnonzero(np.diff(best) > 1) + 1)
        longest = max(runs, key=len)
        middle = longest[len(longest) // 2]
        return float(mixtures[middle]), float(scores[middle])

    def _score(
        self,
        squared: ndarray,
        labels: _Labels,
        queries: ndarray,
        items: ndarray,
        rng: np.random.Generator,
    ) -> float:
        if self.scoring is not None:
            return self._call(squared, labels, queries)
        return Triplets.of_labels(labels.classes, queries, items, self.max_triplets, rng).share(
            squared
        )

    def _call(self, squared: ndarray, labels: _Labels, items: ndarray) -> float:
        assert self.scoring is not None
        return float(self.scoring(np.sqrt(squared[np.ix_(items, items)]), labels.values[items]))


@dataclass(frozen=True)
class _Labels:
    """Labels as they came, and numbered."""

    values: ndarray
    classes: ndarray

    @classmethod
    def of(cls, y: Sequence[Hashable] | ndarray, count: int) -> _Labels:
        classes = _numbers(y, "y", count)
        if isinstance(y, np.ndarray):
            return cls(y, classes)
        values = np.empty(count, dtype=object)
        values[:] = y
        return cls(values, classes)


class _Squares:
    """Squared distances of the parts of the metric."""

    def __init__(self, of_metrics: dict[float, ndarray], of_normals: ndarray) -> None:
        self.of_metrics = of_metrics
        self.of_normals = of_normals

    def mixed(self, a: float, lam: float, c: float) -> ndarray:
        """Return the squared distances with these weights."""
        of_metrics = a * self.of_metrics[lam] if a else 0.0
        return of_metrics + c * self.of_normals

    @staticmethod
    def in_units(squared: ndarray, items: ndarray) -> tuple[ndarray, float]:
        """Return squared distances divided by their mean over pairs of items, and that mean."""
        n = len(items)
        unit = float(squared[np.ix_(items, items)].sum()) / max(1, n * (n - 1)) or 1.0
        return squared / unit, unit


def _numbers(labels: Any, name: str, count: int) -> ndarray:
    """Number labels of any hashable type from 0, in the order they come."""
    names = list(labels.tolist() if isinstance(labels, np.ndarray) else labels)
    if len(names) != count:
        raise ArgumentError(f"{name} holds {len(names)} labels; X holds {count} surfaces")
    numbers = {label: number for number, label in enumerate(dict.fromkeys(names))}
    return np.array([numbers[label] for label in names], dtype=np.int64)
