"""Weights fitted to labels: exact on triplets, and the part that made the labels is found."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval import scores
from riemhuman.statistics import MetricWeights
from riemhuman.statistics.triplets import Triplets


def random_squares(n_items, seed):
    squared = np.random.default_rng(seed).uniform(0.0, 1.0, (n_items, n_items)) ** 2
    return squared + squared.T


def triplets_of(classes, max_triplets=10**6):
    items = np.arange(len(classes))
    return Triplets.of_labels(classes, items, items, max_triplets, np.random.default_rng(1))


def share_by_counting(squared, classes):
    """Return the mean over queries of the share of pairs in the right order."""
    shares = []
    for i in range(len(classes)):
        same = [j for j in range(len(classes)) if j != i and classes[j] == classes[i]]
        other = [k for k in range(len(classes)) if classes[k] != classes[i]]
        if same and other:
            signs = [np.sign(squared[i, k] - squared[i, j]) for j in same for k in other]
            shares.append(0.5 * (1.0 + np.mean(signs)))
    return np.mean(shares)


CLASSES = np.array([0, 1, 0, 2, 1, 1, 0, 3])


def test_share_by_counting():
    squared = random_squares(8, 2)
    assert triplets_of(CLASSES).share(squared) == pytest.approx(share_by_counting(squared, CLASSES))
    squared[0, 1] = squared[0, 2]
    assert triplets_of(CLASSES).share(squared) == pytest.approx(share_by_counting(squared, CLASSES))
    assert triplets_of(CLASSES).weight.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(8))
def test_no_mixture_is_better(seed):
    first, second = random_squares(8, seed), random_squares(8, seed + 50)
    triplets = triplets_of(CLASSES)
    mixture, share = triplets.best_mixture(first, second)
    assert share == pytest.approx(triplets.share((1 - mixture) * first + mixture * second))
    grid = np.linspace(0.0, 1.0, 2001)
    shares = [triplets.share((1 - b) * first + b * second) for b in grid]
    assert share >= max(shares) - 1e-12


def test_one_metric_alone_is_preferred_and_else_the_middle():
    classes = np.array([0, 0, 1])
    triplets = triplets_of(classes)
    right = np.array([[0, 1.0, 2], [1, 0, 2], [2, 2, 0]])
    wrong = np.array([[0, 4.0, 1], [4, 0, 1], [1, 1, 0]])
    assert triplets.best_mixture(right, wrong) == (0.0, 1.0)
    assert triplets.best_mixture(wrong, right) == (1.0, 1.0)
    # One metric is right about the first query, the other about the second; together they are
    # right about both where (1 − β) < 2β and 3(1 − β) > β.
    first = np.array([[0, 2.0, 1], [2, 0, 5], [1, 5, 0]])
    second = np.array([[0, 2.0, 4], [2, 0, 1], [4, 1, 0]])
    mixture, share = triplets.best_mixture(first, second)
    assert share == 1.0
    assert mixture == pytest.approx(0.5 * (1 / 3 + 3 / 4))
    assert triplets.best_mixture(first, second, tolerance=0.6) == (0.0, 0.5)


def test_too_many_triplets_are_sampled():
    classes = np.repeat([0, 1, 2], 10)
    squared = random_squares(30, 4)
    few = triplets_of(classes, 1500)
    assert len(few.query) == 1500
    assert len(np.unique(np.stack([few.query, few.same, few.other]), axis=1).T) == 1500
    assert few.share(squared) == pytest.approx(triplets_of(classes).share(squared), abs=0.1)


BODIES = load_open_bodies("coarse")
SPACE = AlignedSurfaces(BODIES.template, equip=False)
CHOSEN = (BODIES.subject < 6) & (BODIES.pose < 5)
POINTS, SUBJECT, POSE = (getattr(BODIES, name)[CHOSEN] for name in ("points", "subject", "pose"))


def test_labels_find_the_part_that_tells_them():
    identity = MetricWeights(SPACE, (1e-4, 1.0), n_folds=3).fit(POINTS, SUBJECT, groups=SUBJECT)
    assert (identity.a_, identity.lam_) == (1.0, 1e-4)
    assert identity.c_ < 1e-4
    pose = MetricWeights(SPACE, (1e-4, 1.0), n_folds=3).fit(POINTS, POSE, groups=SUBJECT)
    assert (pose.a_, pose.lam_, pose.c_) == (0.0, 0.0, 1.0)
    for fitted, labels in ((identity, SUBJECT), (pose, POSE)):
        assert fitted.held_out_score_ > 0.98
        assert fitted.held_out_score_ == pytest.approx(fitted.held_out_scores_.mean())
        assert len(fitted.held_out_scores_) == len(fitted.fold_weights_) == 3
        assert fitted.score(POINTS, labels) == pytest.approx(fitted.fit_score_, abs=1e-3)
        assert (fitted.metric_.a, fitted.metric_.c) == (fitted.a_, fitted.c_)


def test_labels_without_meaning_have_no_score_on_what_was_held_out():
    shuffled = np.random.default_rng(3).permutation(POSE)
    fitted = MetricWeights(SPACE, (1e-2, 1.0), n_folds=6).fit(POINTS, shuffled, groups=SUBJECT)
    assert fitted.fit_score_ >= fitted.held_out_score_ - 0.02
    assert abs(fitted.held_out_score_ - 0.5) < 0.1


def test_a_score_of_ones_own():
    def first_tier(distances, labels):
        return scores(distances, labels).first_tier

    fitted = MetricWeights(SPACE, (1.0,), scoring=first_tier, n_folds=2, n_ratios=5)
    fitted.fit(POINTS, POSE, groups=SUBJECT)
    assert (fitted.a_, fitted.lam_, fitted.c_) == (0.0, 0.0, 1.0)
    found = scores(fitted.metric_.dist_pairwise(POINTS), POSE)
    assert fitted.fit_score_ == pytest.approx(found.first_tier)
    assert fitted.score(POINTS, POSE) == pytest.approx(found.first_tier)


def test_a_score_that_needs_both_parts():
    labels = [(int(person), int(stance)) for person, stance in zip(SUBJECT, POSE, strict=True)]

    def worse_of_two(distances, pairs):
        """Return the lower of the shares of triplets by person and by pose."""
        columns = (np.array([pair[k] for pair in pairs]) for k in (0, 1))
        return min(triplets_of(column).share(distances**2) for column in columns)

    fitted = MetricWeights(SPACE, (1e-4, 1.0), scoring=worse_of_two, n_folds=3, n_ratios=11)
    fitted.fit(POINTS, labels, groups=SUBJECT)
    assert fitted.a_ > 0
    assert fitted.c_ > 0
    for a, lam, c in ((1.0, 1e-4, 0.0), (1.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        metric = ElasticMetric(SPACE, a, lam, c)
        pure = worse_of_two(metric.dist_pairwise(POINTS), labels)
        assert fitted.fit_score_ > pure + 0.1


def test_weights_are_chosen_without_what_they_are_scored_on():
    seen = []

    def remember(distances, names):
        assert distances.shape == (len(names), len(names))
        seen.append(frozenset(names.tolist()))
        return 0.0

    n_folds, n_ratios, lams = 3, 2, (0.5, 1.0)
    fitted = MetricWeights(SPACE, lams, scoring=remember, n_folds=n_folds, n_ratios=n_ratios)
    fitted.fit(POINTS, np.arange(30), groups=SUBJECT)
    everyone, a_fold = frozenset(range(30)), n_ratios * len(lams) + 1
    assert len(seen) == n_folds * a_fold + a_fold - 1
    assert set(seen[n_folds * a_fold :]) == {everyone}
    tested = []
    for fold in range(n_folds):
        *chosen_on, scored_on = seen[fold * a_fold : (fold + 1) * a_fold]
        assert set(chosen_on) == {everyone - scored_on}
        assert not set(SUBJECT[list(scored_on)]) & set(SUBJECT[list(everyone - scored_on)])
        tested += scored_on
    assert sorted(tested) == list(range(30))


def test_same_seed_same_folds():
    first, second = (
        MetricWeights(SPACE, (1.0,), n_folds=3, rng=seed).fit(POINTS, POSE, groups=SUBJECT)
        for seed in (4, 4)
    )
    np.testing.assert_array_equal(first.held_out_scores_, second.held_out_scores_)


def test_refusals():
    with pytest.raises(ArgumentError, match="at least two classes"):
        MetricWeights(SPACE).fit(POINTS, np.zeros(30))
    with pytest.raises(ArgumentError, match="an item of its class"):
        MetricWeights(SPACE).fit(POINTS, np.arange(30))
    with pytest.raises(ArgumentError, match="y holds 3 labels; X holds 30"):
        MetricWeights(SPACE).fit(POINTS, [1, 2, 3])
    with pytest.raises(ArgumentError, match="groups holds 6 groups; n_folds=7"):
        MetricWeights(SPACE, n_folds=7).fit(POINTS, POSE, groups=SUBJECT)
    with pytest.raises(ArgumentError, match="n_folds"):
        MetricWeights(SPACE, n_folds=1).fit(POINTS, POSE)
    with pytest.raises(ArgumentError, match="at least one value"):
        MetricWeights(SPACE, ()).fit(POINTS, POSE)
    with pytest.raises(ArgumentError, match="lams"):
        MetricWeights(SPACE, (0.0,)).fit(POINTS, POSE)
    with pytest.raises(ArgumentError, match="tolerance"):
        MetricWeights(SPACE, tolerance=-1.0).fit(POINTS, POSE)
    with pytest.raises(ArgumentError, match="MetricWeights must be fitted"):
        MetricWeights(SPACE).score(POINTS, POSE)
