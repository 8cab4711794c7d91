"""Lighter triangulations."""

import numpy as np
import trimesh

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.plots.reduction import lighter_mesh
from riemhuman.surfaces.distortion import is_closed, signed_volume


def test_small_meshes_stay():
    ball = trimesh.creation.icosphere(1)
    kept, faces = lighter_mesh(ball.vertices, ball.faces, 100)
    np.testing.assert_array_equal(kept, np.arange(len(ball.vertices)))
    np.testing.assert_array_equal(faces, ball.faces)


def test_a_sphere_stays_a_closed_sphere_of_its_own_vertices():
    ball = trimesh.creation.icosphere(4)
    kept, faces = lighter_mesh(ball.vertices, ball.faces, 1000)
    assert 200 < len(kept) <= 1000
    assert (np.diff(kept) > 0).all()
    assert is_closed(faces)
    assert len(faces) == 2 * len(kept) - 4  # Euler
    assert 0.95 < signed_volume(ball.vertices[kept], faces) / ball.volume < 1


def test_bodies_keep_their_shape_in_every_pose():
    performances, model = load_open_bodies("coarse"), load_open_model("full")
    some = [3, 16, 49, 98]
    points = model(performances.betas[some], performances.pose_vectors[some])
    kept, faces = lighter_mesh(model.template.vertices, model.template.faces, 7000)
    assert 3000 < len(kept) <= 7000
    assert is_closed(faces)
    light, whole = signed_volume(points[:, kept], faces), signed_volume(points, model.faces)
    np.testing.assert_allclose(light, whole, rtol=0.06)
