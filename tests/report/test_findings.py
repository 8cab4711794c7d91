"""Sentences about results: they say what the numbers say, on shuffled labels too."""

import numpy as np
import pytest

from riemhuman.report import _body_sections as sections
from riemhuman.report._path_sections import normal_shares
from riemhuman.retrieval import scores

RNG = np.random.default_rng(0)
LABELS = np.repeat(np.arange(5), 4)


def rows_of(distances, labels):
    found = scores(distances, labels)
    return [{"representation": "pose", "first_tier": found.first_tier}]


def far_from_one_another():
    """Return distances under which the others of a class come last."""
    return np.where(LABELS[:, None] == LABELS, 2.0, 1.0) * (1 - np.eye(20))


def test_below_chance_is_said_where_it_is_so():
    distances = far_from_one_another()
    assert "more than the 0.0 % of the pose" in sections.below_chance(
        rows_of(distances, LABELS), "pose", LABELS
    )
    assert sections.below_chance(rows_of(3 - distances, LABELS), "pose", LABELS) == ""


def test_chance_is_what_random_orders_give():
    labels = RNG.permutation(LABELS)
    found = []
    for _ in range(300):
        distances = RNG.uniform(size=(20, 20))
        distances = distances + distances.T
        np.fill_diagonal(distances, 0)
        found.append(scores(distances, labels).first_tier)
    assert np.mean(found) == pytest.approx(sections.chance_of_tier(labels), abs=1.5)


def test_best_weights_are_those_of_the_rows():
    rows = [
        {"a": 1.0, "lam": lam, "c": c, "shape_mean_average_precision": s,
         "pose_mean_average_precision": p}
        for (lam, c), s, p in zip(
            [(1e-4, 0.0), (1e-4, 1.0), (None, 1.0)], [20.0, 70.0, 30.0], [50.0, 50.0, 40.0],
            strict=True,
        )
    ]  # fmt: skip
    said = sections.best_weights(rows)
    assert "people with a = 1, λ = 0.0001, c = 1: mAP 70.0 %" in said
    assert "poses with a = 1, λ = 0.0001, c = 0 (and 1 other choice): mAP 50.0 %" in said
    alone = [{key: row[key] for key in row if "pose" not in key} for row in rows]
    assert "poses" not in sections.best_weights(alone)


def test_neighbours_of_a_map():
    positions = np.stack([LABELS, 0.01 * np.arange(20)], axis=1).astype(float)
    assert sections.kept_neighbours(positions, LABELS) == 100
    assert sections.kept_neighbours(positions, np.arange(20) % 2) < 100


def test_shares_are_those_of_the_rows():
    rows = [{"pair": "one person", "normal_part": 3.0, "squared_distance": 4.0}]
    assert normal_shares(rows) == "The normal part is 75 % for one person."
    assert normal_shares([rows[0] | {"squared_distance": 0.0}]) == ""
