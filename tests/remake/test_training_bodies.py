"""Random people in random poses."""

import numpy as np
from training_bodies import random_bodies

from riemhuman.datasets import load_open_bodies, load_open_model


def test_same_seed_same_bodies():
    model = load_open_model("coarse")
    bodies = random_bodies(model, 3, 2, rng=0)
    again = random_bodies(model, 3, 2, rng=0)
    np.testing.assert_array_equal(bodies.points, again.points)
    np.testing.assert_array_equal(bodies.subject, [0, 0, 1, 1, 2, 2])
    assert not np.array_equal(bodies.points, random_bodies(model, 3, 2, rng=1).points)
    np.testing.assert_array_equal(bodies.betas[::2], bodies.betas[1::2])
    np.testing.assert_allclose(bodies.points, model(bodies.betas, bodies.poses))


def test_no_open_body_is_among_them():
    model = load_open_model("coarse")
    drawn = random_bodies(model, 150, 1, rng=0)
    for variant in ("plain", "natural"):
        bodies = load_open_bodies("coarse", variant)
        nearest = np.linalg.norm(drawn.betas[:, None] - bodies.betas[::10], axis=-1).min()
        assert nearest > 1.0
        turns = np.abs(drawn.poses[:, None] - bodies.pose_vectors).max(axis=(-1, -2))
        assert turns.min() > 0.1
