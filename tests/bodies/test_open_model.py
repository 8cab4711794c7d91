"""Facts about the body model that ships."""

import numpy as np
import pytest
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from riemhuman.datasets import load_open_model

RESOLUTIONS = {"full": (13348, 26692), "coarse": (1202, 2400)}

each_resolution = pytest.mark.parametrize("resolution", RESOLUTIONS)


@each_resolution
def test_closed_oriented_and_connected(resolution):
    template = load_open_model(resolution).template
    faces, n_vertices = template.faces, template.n_vertices
    assert (n_vertices, len(faces)) == RESOLUTIONS[resolution]
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, once = np.unique(directed, axis=0, return_counts=True)
    edges, twice = np.unique(np.sort(directed, axis=1), axis=0, return_counts=True)
    assert set(once) == {1}
    assert set(twice) == {2}
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), shape=(n_vertices, n_vertices))
    assert connected_components(graph, directed=False)[0] == 1
    assert n_vertices - len(edges) + len(faces) == 2  # a sphere


@each_resolution
def test_axes_of_the_model(resolution):
    model = load_open_model(resolution)
    np.testing.assert_allclose(model.template.vertices[:, 1].min(), 0.0, atol=5e-3)
    joints = dict(zip(model.joint_names, model.joints(), strict=True))
    assert joints["left_wrist"][0] > 0.2 > -0.2 > joints["right_wrist"][0]
    assert joints["head"][1] > 1.3 > joints["pelvis"][1] > joints["left_ankle"][1] > 0
    assert joints["left_toes"][2] > joints["left_ankle"][2] + 0.05
    np.testing.assert_allclose(joints["pelvis"][[0, 2]], 0.0, atol=0.02)


def test_hands_open_and_close():
    model = load_open_model("coarse")
    assert model.hand_poses == ("fist", "open", "curled", "loose fist")
    order = ["open", "relaxed", "curled", "loose fist", "fist"]
    for number, side in enumerate(("left", "right")):
        hand = np.split(model.hand_directions, 2, axis=-1)[number].any(axis=(1, 2))
        start = model.joints()[model.joint_names.index(f"{side}_wrist")]
        lengths = []
        for name in order:
            both = (name, "relaxed") if side == "left" else ("relaxed", name)
            surface = model(hands=model.hand_pose(*both))
            np.testing.assert_array_equal(surface[~hand], model()[~hand])
            lengths.append(np.linalg.norm(surface[hand] - start, axis=-1).max())
        assert np.all(np.diff(lengths) < 0)
        assert lengths[-1] < 0.7 * lengths[0]
