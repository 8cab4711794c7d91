"""Fits of one model as fits of another."""

import numpy as np
import pytest

from riemhuman.bodies import BodyModel, convert_fit
from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.errors import ArgumentError
from riemhuman.measurements import open_measurements


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse")


@pytest.fixture(scope="module")
def fit(bodies):
    return bodies.model.fit(bodies.points[[3, 9]])


def test_from_coarse_to_full_and_back(bodies, fit):
    full, model = load_open_model("full"), bodies.model
    there = open_measurements(model).correspondence_to(full)
    converted = convert_fit(fit, model, to=full, correspondence=there)
    assert converted.betas.shape == fit.betas.shape
    assert converted.mean_distance.max() < 1e-3
    np.testing.assert_allclose(converted.betas, fit.betas, atol=0.2)
    here = open_measurements(full).correspondence_to(model)
    back = convert_fit(converted, full, to=model, correspondence=here)
    # Vertices of the full skin lie up to some millimetres off the coarse triangles.
    assert back.mean_distance.max() < 5e-3
    np.testing.assert_allclose(
        model(back.betas, back.pose, back.trans),
        model(fit.betas, fit.pose, fit.trans),
        atol=0.02,
    )


def test_a_model_of_fewer_joints_says_how_far_off_it_is(bodies, fit):
    """Without its toes and wrists, the model still stands as the other one does."""
    model = bodies.model
    kept = [k for k, name in enumerate(model.joint_names) if not name.endswith(("toes", "wrist"))]
    weights = model.weights.copy()
    for joint in set(range(model.n_joints)) - set(kept):
        weights[:, model.parents[joint]] += weights[:, joint]
    number = {joint: k for k, joint in enumerate(kept)}
    parents = [number.get(int(model.parents[joint]), -1) for joint in kept]
    simple = BodyModel(
        model.template.vertices,
        model.faces,
        model.shapedirs[..., :10],
        model.joint_regressor[kept],
        weights[:, kept],
        [parents, range(len(kept))],
    )
    converted = convert_fit(fit, model, to=simple, correspondence=np.arange(model.n_vertices))
    assert 5e-4 < converted.mean_distance.max() < 0.02
    surfaces = simple(converted.betas, converted.pose, converted.trans)
    gaps = np.linalg.norm(surfaces - model(fit.betas, fit.pose, fit.trans), axis=-1)
    np.testing.assert_allclose(converted.distances, gaps, atol=1e-12)


def test_a_map_that_does_not_fit(bodies, fit):
    with pytest.raises(ArgumentError):
        convert_fit(fit, bodies.model, to=bodies.model, correspondence=np.arange(5))
