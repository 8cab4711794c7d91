"""Bodies of Anny as bodies of the open model; what needs the package runs where it is installed."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.datasets import anny_bodies, anny_parameters, bodies_from_anny

ArgumentError = rh.errors.ArgumentError


def test_the_skin_is_taken_vertex_by_vertex_and_turned_upright():
    model = rh.datasets.load_open_model("full")
    body = model(hands=model.hand_pose("open"))
    z_up = np.stack([body[:, 0], -body[:, 2], body[:, 1]], axis=-1)
    whole = np.concatenate([z_up, np.zeros((370, 3))])
    np.testing.assert_array_equal(bodies_from_anny(whole), body)
    np.testing.assert_array_equal(bodies_from_anny(np.stack([whole] * 2))[1], body)
    with pytest.raises(ArgumentError, match=r"13,718 of Anny.*found 13,348"):
        bodies_from_anny(z_up)


def test_the_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "anny", None)
    with pytest.raises(rh.errors.MissingDependencyError, match=r"\[anny\]"):
        anny_bodies({"height": [0.5]})


@pytest.mark.slow
def test_parameters_go_to_bodies_and_back():
    pytest.importorskip("anny", exc_type=ImportError)
    bodies = anny_bodies({"height": [0.3, 0.8], "gender": [0.0, 1.0], "age": 0.7})
    heights = np.ptp(bodies[..., 1], axis=-1)
    assert 1.3 < heights[0] < heights[1] < 2.3
    volumes = [rh.surfaces.signed_volume(b, rh.datasets.load_open_model().faces) for b in bodies]
    assert min(volumes) > 0.02  # the triangles look outward
    fit = rh.datasets.load_open_model("full").fit(bodies, betas_prior=1e-7)
    assert fit.mean_distance.max() < 0.015
    found = anny_parameters(bodies)
    assert found.distances.mean() < 0.008  # those of Anny's own inverter
    again = anny_bodies(found.phenotypes, found.pose)
    errors = np.linalg.norm(again - bodies, axis=-1).mean(axis=1)
    np.testing.assert_allclose(errors, found.distances.mean(axis=1), atol=1e-4)
    with pytest.raises(ArgumentError, match="phenotypes must be among .*found 'tallness'"):
        anny_bodies({"tallness": 1.0})
