"""Building the open model, as far as it goes without the packages and tables it is built from."""

import build_open_model
import numpy as np

from riemhuman.datasets import load_open_model


def test_coarse_model_that_ships_comes_from_the_full_one():
    full, coarse = load_open_model("full"), load_open_model("coarse")
    model = build_open_model.build_coarse(full)
    np.testing.assert_array_equal(model.template.vertices, coarse.template.vertices)
    np.testing.assert_array_equal(model.faces, coarse.faces)
    np.testing.assert_array_equal(model.shapedirs, coarse.shapedirs)
    np.testing.assert_array_equal(model.weights, coarse.weights)
    np.testing.assert_array_equal(model.hand_directions, coarse.hand_directions)
    betas = np.random.default_rng(1).standard_normal((10, full.n_betas))
    gaps = np.linalg.norm(coarse.joints(betas) - full.joints(betas), axis=-1)
    assert gaps.max() < 0.02
