"""Retrieval scores: by hand, against a recount, and against every order of tied results."""

import itertools

import numpy as np
import pytest

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.retrieval import retrieval_table, scores
from riemhuman.retrieval.scores import confusion, precision_recall


def recount(order, labels, query):
    """Score one ranking by its definition: NN, first tier, second tier, average precision."""
    hits = [labels[item] == labels[query] for item in order]
    n_relevant = sum(hits)
    precisions = [sum(hits[: rank + 1]) / (rank + 1) for rank, hit in enumerate(hits) if hit]
    return np.array(
        [
            hits[0],
            sum(hits[:n_relevant]) / n_relevant,
            sum(hits[: 2 * n_relevant]) / n_relevant,
            sum(precisions) / n_relevant,
        ]
    )


def recount_over_all_orders(distances, labels):
    """Average the recount over every order of the results that respects their distances."""
    totals = []
    for query in range(len(labels)):
        others = [item for item in range(len(labels)) if item != query]
        if not any(labels[item] == labels[query] for item in others):
            continue
        values = [distances[query][item] for item in others]
        orders = [
            order
            for order in itertools.permutations(others)
            if [distances[query][item] for item in order] == sorted(values)
        ]
        totals.append(np.mean([recount(order, labels, query) for order in orders], axis=0))
    return 100 * np.mean(totals, axis=0), len(totals)


def as_array(result):
    return np.array(
        [result.nn, result.first_tier, result.second_tier, result.mean_average_precision]
    )


@pytest.mark.parametrize("n_values", [1, 2, 3])
@pytest.mark.parametrize("labels", ["aabbbb", "aaaaab", "aabbc"])
def test_ties_score_their_expectation_over_all_orders(labels, n_values):
    rng = np.random.default_rng(len(labels) + n_values)
    for _ in range(4):
        distances = rng.integers(0, n_values, size=(len(labels),) * 2).astype(float)
        expected, n_queries = recount_over_all_orders(distances.tolist(), labels)
        result = scores(distances, labels)
        np.testing.assert_allclose(as_array(result), expected, rtol=1e-13)
        assert result.n_queries == n_queries


SQUARE = np.ones((4, 4))


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("distances", "labels", "error", "message"),
    [
        (np.where(np.eye(4, k=1), np.nan, 1), "aabb", ArgumentError, r"distances\[0, 1\] is nan"),
        (np.where(np.eye(4, k=3), -0.5, 1), "aabb", ArgumentError, r"\[0, 3\] is -0.5"),
        (SQUARE, "abcd", ArgumentError, "found none among 4 items"),
        (SQUARE, [[0], [0], [1], [1]], ArgumentTypeError, "labels .*unhashable"),
    ],
)
def test_bad_arguments_are_refused_by_name(distances, labels, error, message):
    with pytest.raises(error, match=message):
        scores(distances, labels)


def test_bodies_of_the_group_of_a_query_are_left_out():
    rng = np.random.default_rng(5)
    points = rng.normal(size=(24, 3))
    distances = np.linalg.norm(points[:, None] - points, axis=-1)
    labels, people = np.arange(24) % 4, np.repeat(np.arange(6), 4)
    totals = []
    for query in range(24):
        others = np.flatnonzero(people != people[query])
        order = others[np.argsort(distances[query, others])]
        totals.append(recount(order, labels, query))
    among_others = scores(distances, labels, groups=people)
    np.testing.assert_allclose(as_array(among_others), 100 * np.mean(totals, axis=0))
    table = retrieval_table({"toy": distances}, labels, groups=people)
    assert table == {"toy": among_others}
    assert among_others != scores(distances, labels)


# Precision at recall, and who is taken for whom.

LABELS = np.repeat(["b", "a", "c"], 4)


@pytest.fixture
def distances():
    """Return random symmetric distances, all different."""
    matrix = np.random.default_rng(3).uniform(size=(12, 12))
    matrix += matrix.T
    np.fill_diagonal(matrix, 0.0)
    return matrix


def test_the_mean_of_the_curve_is_the_mean_average_precision(distances):
    recall, precision = precision_recall(distances, LABELS)
    np.testing.assert_allclose(recall, [1 / 3, 2 / 3, 1])
    expected = scores(distances, LABELS).mean_average_precision
    assert 100 * precision.mean() == pytest.approx(expected, rel=1e-12)


def test_confusion_counts_nearest_neighbours(distances):
    counts = confusion(distances, LABELS)
    assert counts.sum() == 12
    np.testing.assert_array_equal(counts.sum(axis=1), [4, 4, 4])
    share = 100 * np.trace(counts) / 12
    assert share == pytest.approx(scores(distances, LABELS).nn)
    # Rows in the order of the sorted labels.
    nearest = (distances + 9 * np.eye(12)).argmin(axis=1)
    assert counts[0, 1] == sum(LABELS[nearest[i]] == "b" for i in range(12) if LABELS[i] == "a")


@pytest.mark.parametrize("n_values", [1, 2, 3])
def test_confusion_treats_ties_as_scores_do(n_values):
    """The diagonal is the NN of the scores, and no order of the items changes the counts."""
    rng = np.random.default_rng(n_values)
    matrix = rng.integers(0, n_values, size=(12, 12)).astype(float)
    counts = confusion(matrix, LABELS)
    np.testing.assert_allclose(counts.sum(axis=1), [4, 4, 4])
    assert 100 * np.trace(counts) / 12 == pytest.approx(scores(matrix, LABELS).nn)
    order = rng.permutation(12)
    again = confusion(matrix[np.ix_(order, order)], LABELS[order])
    np.testing.assert_allclose(again, counts)


@pytest.mark.parametrize("function", [scores, precision_recall, confusion])
def test_the_diagonal_is_not_read(function, distances):
    on_diagonal = distances + np.diag(np.full(12, np.nan))
    np.testing.assert_equal(function(on_diagonal, LABELS), function(distances, LABELS))


def test_nothing_to_find(distances):
    with pytest.raises(ArgumentError, match="12 classes of one item each"):
        precision_recall(distances, np.arange(12))
    with pytest.raises(ArgumentError, match="square matrix"):
        precision_recall(np.ones((0, 0)), [])
