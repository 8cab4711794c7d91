"""Shape and pose codes that ship, on people and poses that were no part of training."""

import numpy as np
import pytest
from evaluate_codes import UnseenBodies, mean_error
from open_bodies import coarse_bodies
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist, squareform
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.learned import ShapePoseCodes
from riemhuman.retrieval import scores
from riemhuman.surfaces.template import Template


@pytest.fixture(scope="module")
def codes():
    return ShapePoseCodes.load_pretrained()


@pytest.fixture(scope="module")
def bodies():
    return UnseenBodies("random")


def test_bodies_come_back_and_shape_and_pose_come_apart(codes, bodies):
    found = codes.transform(bodies.points)
    assert mean_error(codes.inverse_transform(found), bodies.points) < 15.0
    people, others, truth = bodies.transfers()
    moved = codes.transfer(bodies.points[people], bodies.points[others])
    assert mean_error(moved, truth) < 20.0
    assert codes.transform(bodies.points[:0]).shape == (0, codes.n_shape + codes.n_pose)
    shape, pose = codes.split(found)
    np.testing.assert_array_equal(np.concatenate([shape, pose], axis=1), found)
    mixed = np.concatenate([shape[people], pose[others]], axis=1)
    np.testing.assert_allclose(codes.inverse_transform(mixed), moved)


def test_codes_do_not_know_place_nor_heading(codes, bodies):
    turn = Rotation.from_rotvec([0.3, 2.0, -0.4]).as_matrix()
    moved = bodies.points[:3] @ turn.T + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(
        codes.transform(moved), codes.transform(bodies.points[:3]), atol=1e-6
    )


def test_refined_template_gives_nearly_the_same_codes_and_its_own_surfaces(codes):
    full = load_open_model("full")
    coarse = coarse_bodies()
    fine = full(coarse.betas[:2], coarse.pose_vectors[:2])
    small = coarse.model(coarse.betas[:2], coarse.pose_vectors[:2])
    on_full = codes.on(full.template)
    found = on_full.transform(fine)
    spread = codes.transform(coarse.points).std(axis=0)
    assert (np.abs(found - codes.transform(small)) / spread).mean() < 0.05
    assert on_full.inverse_transform(found).shape == fine.shape
    assert mean_error(on_full.inverse_transform(found), fine) < 15.0


def test_another_template_with_a_correspondence(codes, bodies):
    # Another person, in another pose, with the vertices in another order.
    order = np.random.default_rng(0).permutation(bodies.points.shape[1])
    template = Template(bodies.points[0][order], np.argsort(order)[codes.template_.faces])
    other = codes.on(template, np.argsort(order))
    points = bodies.points[:3, order]
    np.testing.assert_allclose(
        other.transform(points), codes.transform(bodies.points[:3]), atol=1e-9
    )
    found = other.inverse_transform(other.transform(points))
    assert mean_error(found, points) < 15.0
    assert other.template_ is template


def test_triangles_that_collapse_are_left_out(codes):
    """Vertices that share a place with another make triangles without area."""
    natural = load_open_bodies("coarse", "natural")
    template = natural.template
    places = np.random.default_rng(0).permutation(template.n_vertices)[:600]
    nearest = cKDTree(template.vertices[places]).query(template.vertices)[1]
    collapsed = codes.on(template, places[nearest])
    found = collapsed.transform(natural.points)
    shape, pose = collapsed.split(found)
    assert scores(squareform(pdist(shape)), natural.subject).nn > 95.0
    assert scores(squareform(pdist(pose)), natural.pose).nn > 75.0
    some = slice(None, None, 11)
    assert mean_error(collapsed.inverse_transform(found[some]), natural.points[some]) < 150.0


def test_refuses(codes, bodies):
    with pytest.raises(ArgumentError, match="the template has 1202"):
        codes.transform(np.zeros((2, 7, 3)))
    with pytest.raises(DegenerateSurfaceError):
        codes.transform(0.0 * bodies.points[:1])
    with pytest.raises(ArgumentError, match="millimetres.*unit that the network was trained in"):
        codes.transform(1000.0 * bodies.points[:1])
    with pytest.raises(ArgumentError, match="Z"):
        codes.inverse_transform(np.zeros((2, 7)))
    with pytest.raises(ArgumentError, match="must have the same length"):
        codes.transfer(bodies.points[:2], bodies.points[:1])
