"""Random people in random poses."""

import numpy as np
from training_bodies import random_bodies

from riemhuman.datasets import load_open_bodies, load_open_model


def test_no_open_body_is_among_them():
    model = load_open_model("coarse")
    drawn = random_bodies(model, 150, 1, rng=0)
    for variant in ("plain", "natural"):
        bodies = load_open_bodies("coarse", variant)
        nearest = np.linalg.norm(drawn.betas[:, None] - bodies.betas[::10], axis=-1).min()
        assert nearest > 1.0
        turns = np.abs(drawn.poses[:, None] - bodies.pose_vectors).max(axis=(-1, -2))
        assert turns.min() > 0.1
