"""Facts about the open bodies, plain and natural."""

import numpy as np
import pytest

from riemhuman.datasets import joint_rotations, load_open_bodies, load_open_model
from riemhuman.datasets.open_poses import read_table
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval import scores
from riemhuman.surfaces import procrustes

PLAIN_37_100 = (-0.1708051480503, 1.2210649201136, 0.0678733744205)
TRUNK = ("pelvis", "chest", "left_shoulder", "right_shoulder", "left_hip", "right_hip")


def test_ten_subjects_in_ten_poses(bodies):
    assert len(bodies) == 100
    np.testing.assert_array_equal(10 * bodies.subject + bodies.pose, np.arange(100))
    assert sorted(set(bodies.subject)) == sorted(set(bodies.pose)) == list(range(10))
    assert len(set(bodies.subject_names)) == len(set(bodies.pose_names)) == 10
    assert bodies.template is bodies.model.template
    betas = bodies.betas.reshape(10, 10, -1)
    np.testing.assert_array_equal(betas, np.repeat(betas[:, :1], 10, axis=1))
    assert np.abs(betas).max() < 3  # standard deviations
    gaps = np.linalg.norm(betas[:, None, 0] - betas[None, :, 0], axis=-1)
    assert gaps[~np.eye(10, dtype=bool)].min() > 2


def test_volumes_are_those_of_people(bodies):
    corners = bodies.points[:, bodies.template.faces].swapaxes(0, 2)
    cones = np.sum(corners[0] * np.cross(corners[1], corners[2]), axis=-1)
    volumes = cones.sum(axis=0) / 6
    assert volumes.min() > 0.03
    assert volumes.max() < 0.2
    # Noise, and linear blending at bent joints, cost some of a body's volume, not much of it.
    by_subject = volumes.reshape(10, 10)
    assert (by_subject.max(axis=1) / by_subject.min(axis=1)).max() < 1.2


def test_everybody_stands_on_the_ground(bodies):
    np.testing.assert_allclose(bodies.points[..., 1].min(axis=1), 0.0, atol=0.1)


def test_loading_again_gives_the_same_and_is_independent(bodies):
    kept = bodies.points.copy()
    again = load_open_bodies("coarse")
    for name in ("points", "subject", "pose", "betas", "pose_vectors", "translations"):
        np.testing.assert_array_equal(getattr(again, name), getattr(bodies, name))
        getattr(again, name)[...] = 0
    np.testing.assert_array_equal(bodies.points, kept)
    np.testing.assert_array_equal(load_open_bodies("coarse").points, kept)


def test_unknown_names():
    with pytest.raises(ArgumentError, match="resolution must be one of 'full', 'coarse'; found"):
        load_open_bodies("fine")
    with pytest.raises(ArgumentError, match="angles name the joint 'tail'; the model has pelvis"):
        joint_rotations({"tail": ("x", 10)}, load_open_model("coarse"))


@pytest.fixture(scope="module")
def natural():
    return load_open_bodies("coarse", variant="natural")


def joint_numbers(natural, names):
    return [natural.model.joint_names.index(name) for name in names]


def test_ten_people_in_ten_poses(natural, bodies):
    assert natural.pose_names == tuple(read_table("open_poses")["natural"])
    np.testing.assert_array_equal(natural.subject, bodies.subject)
    np.testing.assert_array_equal(natural.pose, bodies.pose)
    assert len(set(natural.subject_names)) == len(set(natural.pose_names)) == 10
    gaps = np.linalg.norm(natural.betas[::10, None] - natural.betas[None, ::10], axis=-1)
    assert gaps[~np.eye(10, dtype=bool)].min() > 1.5  # standard deviations


def test_hands_are_centimetres_apart_in_the_same_pose(natural):
    # On the mean body, so that builds do not matter, and with the trunk in place.
    joints = natural.model.joints(pose=natural.pose_vectors)
    trunk = joint_numbers(natural, TRUNK)
    reference = joints[0, trunk] - joints[0, trunk].mean(axis=0)
    centred = joints - joints[:, trunk].mean(axis=1, keepdims=True)
    left, _, right = np.linalg.svd(np.swapaxes(centred[:, trunk], -1, -2) @ reference)
    hands = joint_numbers(natural, ("left_wrist", "right_wrist"))
    places = (centred @ (left @ right))[:, hands].reshape(10, 10, 2, 3)
    spreads = np.sqrt(2 * places.var(axis=0, ddof=1).sum(axis=-1).mean(axis=-1))
    assert 0.05 < np.sqrt(np.mean(spreads**2)) < 0.07
    assert spreads.min() > 0.04
    assert spreads.max() < 0.09


def test_two_poses_differ_by_a_tilted_head_alone(natural):
    aligned = procrustes(natural.points, to=natural.template.vertices).reshape(10, 10, -1, 3)
    gaps = np.linalg.norm(aligned[:, :, None] - aligned[:, None], axis=-1).mean(axis=(0, -1))
    stance, tilted = (natural.pose_names.index(name) for name in ("a_stance", "head_tilted"))
    assert gaps[stance, tilted] < 0.03
    others = gaps[~np.eye(10, dtype=bool)]
    assert np.sort(others)[2] > 2 * gaps[stance, tilted]


def test_poses_of_one_person_are_confused(natural, bodies):
    def errors(of):
        space = AlignedSurfaces(of.template)
        distances = ElasticMetric(space, a=0.0, lam=0.0, c=1.0).dist_pairwise(of.points)
        np.fill_diagonal(distances, np.inf)
        nearest = distances.argmin(axis=1)
        wrong = of.pose[nearest] != of.pose
        return wrong, of.subject[nearest] == of.subject

    wrong, same_person = errors(natural)
    assert 10 <= wrong.sum() <= 20  # of a hundred, as on real registered bodies
    assert same_person[wrong].all()
    assert not errors(bodies)[0].any()


def test_people_are_distinguished(natural):
    metric = ElasticMetric(AlignedSurfaces(natural.template), a=1.0, lam=1e-4, c=0.0)
    assert scores(metric.dist_pairwise(natural.points), natural.subject).nn == 100


def test_flesh_moves_with_the_pose_as_the_model_cannot(natural, bodies):
    def unexplained(of):
        fitted = of.model(of.betas, of.pose_vectors, of.translations)
        lengths = np.linalg.norm(of.points - fitted, axis=-1)
        return np.sqrt(np.mean(lengths**2, axis=-1)).reshape(10, 10)

    upright, bent = (natural.pose_names.index(name) for name in ("a_stance", "squat"))
    person = unexplained(natural)
    assert (person[:, bent] > 1.2 * person[:, upright]).all()
    assert person[:, bent].std() > 0.1 * person[:, bent].mean()  # more in some people than others
    fits = [of.model.fit(of.points[9::40]).distances for of in (natural, bodies)]
    rough, smooth = (np.sqrt(np.mean(gaps**2)) for gaps in fits)
    assert rough > 1.3 * smooth


def test_the_same_people_come_again_and_others_with_another_seed(natural, bodies):
    np.testing.assert_array_equal(natural.betas, bodies.betas)
    assert natural.subject_names == bodies.subject_names
    others, again = (load_open_bodies("coarse", "natural", people=2) for _ in range(2))
    np.testing.assert_array_equal(again.points, others.points)
    gaps = np.linalg.norm(others.betas[::10, None] - bodies.betas[None, ::10], axis=-1)
    assert gaps.min() > 1


def test_numbers_are_those_written_down_and_wrong_names_are_refused(bodies):
    # Written down with the people of ANSUR II.
    np.testing.assert_allclose(bodies.points[37, 100], PLAIN_37_100, rtol=0, atol=1e-9)
    for wrong in ({"variant": "real"}, {"people": -1}):
        with pytest.raises(ArgumentError, match=next(iter(wrong))):
            load_open_bodies("coarse", **wrong)
