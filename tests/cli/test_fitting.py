"""The verb fit."""

import json

import numpy as np

from riemhuman.io import save_mesh
from riemhuman.io.arrays import load_arrays


def test_fit_is_that_of_the_library(run, scans, bodies, tmp_path):
    output, picture = tmp_path / "fit.npz", tmp_path / "fit.png"
    options = ("--picture", picture, "--json")
    finished = run("fit", scans / "body_0.ply", scans / "body_20.ply", "-o", output, *options)
    assert finished.code == 0
    arrays = load_arrays(output, ["betas", "pose", "trans", "distances", "names"])
    assert arrays["names"].tolist() == ["body_0.ply", "body_20.ply"]
    model = bodies.model
    shown = model(arrays["betas"], arrays["pose"], arrays["trans"])
    gaps = np.linalg.norm(shown - bodies.points[[0, 20]], axis=-1)
    np.testing.assert_allclose(gaps, arrays["distances"], atol=1e-5)
    means = json.loads(finished.out)["mean_distance_mm"]
    np.testing.assert_allclose(means, 1000 * arrays["distances"].mean(axis=1))
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_fit_asks_for_a_model_that_fits(refused, tmp_path):
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    save_mesh(tmp_path / "other.ply", corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert "--model FILE" in refused("fit", tmp_path / "other.ply", "-o", tmp_path / "fit.npz")
