"""Triplets in the right order: how often a body is nearer to its own class than to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError


@dataclass(frozen=True)
class Triplets:
    """Triplets of a query, an item of its class and one of another class.

    Every query has the same weight, whatever the number of its triplets; the share of triplets in
    the right order is then the mean over queries of the area under the ROC curve.

    Attributes
    ----------
    query, same, other : array of int, shape (m,)
        Indices of the items.
    weight : array, shape (m,)
        Weights, of sum 1.
    """

    query: ndarray
    same: ndarray
    other: ndarray
    weight: ndarray

    @classmethod
    def of_labels(
        cls,
        classes: ndarray,
        queries: ndarray,
        items: ndarray,
        max_triplets: int,
        rng: np.random.Generator,
    ) -> Triplets:
        """Return all triplets, or a random subset of them.

        Parameters
        ----------
        classes : array of int, shape (n,)
            Class of every item.
        queries, items : array of int
            Indices of the queries, and of the items they are compared with; no query is its own
            item.
        max_triplets : int
            Approximate largest number of triplets.
        rng : numpy.random.Generator
            Generator for the random subset.

        Returns
        -------
        Triplets

        Raises
        ------
        ArgumentError
            If no query has an item of its class and one of another.
        """
        per_query = max(1, max_triplets // max(1, len(queries)))
        parts = []
        for query in queries:
            others = items[items != query]
            relevant = classes[others] == classes[query]
            same, other = others[relevant], others[~relevant]
            count = len(same) * len(other)
            if not count:
                continue
            chosen = np.arange(count)
            if count > per_query:
                chosen = rng.choice(count, per_query, replace=False)
            first, second = np.divmod(chosen, len(other))
            weights = np.full(len(chosen), 1.0 / len(chosen))
            parts.append((np.full(len(chosen), query), same[first], other[second], weights))
        if not parts:
            raise ArgumentError(
                "labels must give a query an item of its class and one of another; none has both"
            )
        query, same, other, weight = (np.concatenate(part) for part in zip(*parts, strict=True))
        return cls(query, same, other, weight / len(parts))

    def margins(self, squared: ndarray) -> ndarray:
        """Return by how much the item of another class is farther, shape (m,).

        Parameters
        ----------
        squared : array, shape (n, n)
            Squared distances.

        Returns
        -------
        array, shape (m,)
        """
        return squared[self.query, self.other] - squared[self.query, self.same]

    def share(self, squared: ndarray) -> float:
        """Return the share of triplets in the right order, ties counted half.

        Parameters
        ----------
        squared : array, shape (n, n)
            Squared distances.

        Returns
        -------
        float
        """
        return float(self.weight @ _right(self.margins(squared)))

    def best_mixture(
        self, first: ndarray, second: ndarray, tolerance: float = 1e-12
    ) -> tuple[float, float]:
        """Return the β in [0, 1] whose (1 − β) · first + β · second has the best share, exactly.

        The margin of every triplet is linear in β, so the share changes only where one of them is
        0. If one metric alone does as well, β is 0 or 1; otherwise it is the middle of the widest
        of the best intervals.

        Parameters
        ----------
        first, second : array, shape (n, n)
            Squared distances under two metrics.
        tolerance : float
            Shares this close to the best count as equal.

        Returns
        -------
        mixture, share : float
            β and its share of triplets in the right order.
        """
        start, end = self.margins(first), self.margins(second)
        turns = start * end < 0
        places = start[turns] / (start[turns] - end[turns])
        order = np.argsort(places)
        changes = (np.sign(end[turns]) * self.weight[turns])[order]
        ends = np.concatenate([[0.0], places[order], [1.0]])
        # Inside the interval a margin is 0 only where it is at both ends.
        inside = np.where(start == 0, end, start)
        shares = float(self.weight @ _right(inside)) + np.concatenate([[0.0], np.cumsum(changes)])
        shares[np.diff(ends) <= 0] = -np.inf

        best = shares.max()
        for mixture, squared in ((0.0, first), (1.0, second)):
            if self.share(squared) >= best - tolerance:
                return mixture, self.share(squared)
        # Neighbouring intervals that are as good are one, empty ones between them or not.
        good = (shares >= best - tolerance) | (np.diff(ends) <= 0)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]])))
        lows, highs = ends[edges[::2]], ends[edges[1::2]]
        widest = np.argmax(highs - lows)
        mixture = float(0.5 * (lows[widest] + highs[widest]))
        return mixture, self.share((1.0 - mixture) * first + mixture * second)


def _right(margins: ndarray) -> ndarray:
    return 0.5 * (1.0 + np.sign(margins))
