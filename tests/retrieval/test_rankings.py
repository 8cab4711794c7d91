"""Precision at recall, and who is taken for whom."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.retrieval import scores
from riemhuman.retrieval.scores import confusion, precision_recall

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


def test_every_level_by_its_definition(distances):
    _, precision = precision_recall(distances, LABELS)
    expected = []
    for query in range(12):
        ranked = sorted(set(range(12)) - {query}, key=lambda item: distances[query, item])
        ranks = [1 + rank for rank, item in enumerate(ranked) if LABELS[item] == LABELS[query]]
        expected.append([1 / ranks[0], 2 / ranks[1], 3 / ranks[2]])
    np.testing.assert_allclose(precision, np.mean(expected, axis=0))


def test_classes_of_different_sizes():
    places = np.array([0.0, 0.1, 0.2, 5.0, 5.1, 9.0])
    recall, precision = precision_recall(np.abs(places[:, None] - places), list("aaabbc"))
    np.testing.assert_allclose(recall, [0.5, 1.0])
    np.testing.assert_allclose(precision, [1.0, 1.0])


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


def test_confusion_of_labels_of_any_hashable_kind(distances):
    mixed = [("a",), "1", 1] * 4  # which cannot be sorted
    expected = confusion(distances, [0, 1, 2] * 4)
    for labels in (mixed, "abc" * 4, [("a", 1), ("a", 2), ("b", 1)] * 4):
        np.testing.assert_array_equal(confusion(distances, labels), expected)


@pytest.mark.parametrize("function", [precision_recall, confusion])
def test_the_diagonal_is_not_read(function, distances):
    on_diagonal = distances + np.diag(np.full(12, np.nan))
    np.testing.assert_equal(function(on_diagonal, LABELS), function(distances, LABELS))


def test_nothing_to_find(distances):
    with pytest.raises(ArgumentError, match="12 classes of one item each"):
        precision_recall(distances, np.arange(12))
    with pytest.raises(ArgumentError, match="square matrix"):
        precision_recall(np.ones((0, 0)), [])
