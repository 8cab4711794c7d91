"""Facts about the natural open bodies: what they have in common with real ones."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from riemhuman.datasets import load_open_bodies
from riemhuman.datasets.open_poses import read_table
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.retrieval import scores
from riemhuman.surfaces.procrustes import procrustes

PLAIN_37_100 = (-0.1708051480503, 1.2210649201136, 0.0678733744205)
TRUNK = ("pelvis", "chest", "left_shoulder", "right_shoulder", "left_hip", "right_hip")


@pytest.fixture(scope="module", params=[None, 2], ids=["the ten", "others"])
def people(request):
    return request.param


@pytest.fixture(scope="module")
def bodies(people):
    return load_open_bodies("coarse", variant="natural", people=people)


@pytest.fixture(scope="module")
def plain():
    return load_open_bodies("coarse")


def joint_numbers(bodies, names):
    return [bodies.model.joint_names.index(name) for name in names]


def test_ten_people_in_ten_poses(bodies, plain):
    assert bodies.pose_names == tuple(read_table("open_poses")["natural"])
    np.testing.assert_array_equal(bodies.subject, plain.subject)
    np.testing.assert_array_equal(bodies.pose, plain.pose)
    assert len(set(bodies.subject_names)) == len(set(bodies.pose_names)) == 10
    gaps = np.linalg.norm(bodies.betas[::10, None] - bodies.betas[None, ::10], axis=-1)
    assert gaps[~np.eye(10, dtype=bool)].min() > 1.5  # standard deviations


def test_hands_are_centimetres_apart_in_the_same_pose(bodies):
    # On the mean body, so that builds do not matter, and with the trunk in place.
    joints = bodies.model.joints(pose=bodies.pose_vectors)
    trunk = joint_numbers(bodies, TRUNK)
    reference = joints[0, trunk] - joints[0, trunk].mean(axis=0)
    centred = joints - joints[:, trunk].mean(axis=1, keepdims=True)
    left, _, right = np.linalg.svd(np.swapaxes(centred[:, trunk], -1, -2) @ reference)
    hands = joint_numbers(bodies, ("left_wrist", "right_wrist"))
    places = (centred @ (left @ right))[:, hands].reshape(10, 10, 2, 3)
    spreads = np.sqrt(2 * places.var(axis=0, ddof=1).sum(axis=-1).mean(axis=-1))
    assert 0.05 < np.sqrt(np.mean(spreads**2)) < 0.07
    assert spreads.min() > 0.04
    assert spreads.max() < 0.09


def test_two_poses_differ_by_a_tilted_head_alone(bodies):
    aligned = procrustes(bodies.points, to=bodies.template.vertices).reshape(10, 10, -1, 3)
    gaps = np.linalg.norm(aligned[:, :, None] - aligned[:, None], axis=-1).mean(axis=(0, -1))
    stance, tilted = (bodies.pose_names.index(name) for name in ("a_stance", "head_tilted"))
    assert gaps[stance, tilted] < 0.03
    others = gaps[~np.eye(10, dtype=bool)]
    assert np.sort(others)[2] > 2 * gaps[stance, tilted]


def test_poses_of_one_person_are_confused(bodies, plain):
    def errors(bodies):
        space = AlignedSurfaces(bodies.template)
        distances = ElasticMetric(space, a=0.0, lam=0.0, c=1.0).dist_pairwise(bodies.points)
        np.fill_diagonal(distances, np.inf)
        nearest = distances.argmin(axis=1)
        wrong = bodies.pose[nearest] != bodies.pose
        return wrong, bodies.subject[nearest] == bodies.subject

    wrong, same_person = errors(bodies)
    assert 10 <= wrong.sum() <= 20  # of a hundred, as on real registered bodies
    assert same_person[wrong].all()
    assert not errors(plain)[0].any()


def test_people_are_distinguished(bodies):
    metric = ElasticMetric(AlignedSurfaces(bodies.template), a=1.0, lam=1e-4, c=0.0)
    assert scores(metric.dist_pairwise(bodies.points), bodies.subject).nn == 100


@pytest.mark.sampled(2, "full bodies")
def test_hands_touch_hips_and_head():
    bodies = load_open_bodies("full", "natural")
    arms = [n for n in bodies.model.joint_names if n.endswith(("shoulder", "elbow", "wrist"))]
    elsewhere = bodies.model.weights[:, joint_numbers(bodies, arms)].sum(axis=1) < 0.01
    for name, places in read_table("open_poses")["touched"].items():
        shown = bodies.points[bodies.pose == bodies.pose_names.index(name)]
        for side in places:
            hand = bodies.model.weights[:, joint_numbers(bodies, [f"{side}_wrist"])[0]] > 0.9
            gaps = [cKDTree(points[elsewhere]).query(points[hand])[0].min() for points in shown]
            assert max(gaps) < 0.02
            assert np.median(gaps) < 0.01


def test_flesh_moves_with_the_pose_as_the_model_cannot(bodies, plain):
    def unexplained(bodies):
        fitted = bodies.model(bodies.betas, bodies.pose_vectors, bodies.translations)
        lengths = np.linalg.norm(bodies.points - fitted, axis=-1)
        return np.sqrt(np.mean(lengths**2, axis=-1)).reshape(10, 10)

    upright, bent = (bodies.pose_names.index(name) for name in ("a_stance", "squat"))
    person = unexplained(bodies)
    assert (person[:, bent] > 1.2 * person[:, upright]).all()
    assert person[:, bent].std() > 0.1 * person[:, bent].mean()  # more in some people than others
    fits = [of.model.fit(of.points[9::40]).distances for of in (bodies, plain)]
    natural, smooth = (np.sqrt(np.mean(gaps**2)) for gaps in fits)
    assert natural > 1.3 * smooth


def test_the_same_people_come_again_and_others_with_another_seed(bodies, plain, people):
    again = load_open_bodies("coarse", "natural", people=people)
    np.testing.assert_array_equal(again.points, bodies.points)
    if people is None:
        np.testing.assert_array_equal(bodies.betas, plain.betas)
        assert bodies.subject_names == plain.subject_names
    else:
        gaps = np.linalg.norm(bodies.betas[::10, None] - plain.betas[None, ::10], axis=-1)
        assert gaps.min() > 1


def test_numbers_are_those_written_down_and_wrong_names_are_refused(plain):
    # Written down with the people of ANSUR II.
    np.testing.assert_allclose(plain.points[37, 100], PLAIN_37_100, rtol=0, atol=1e-9)
    for wrong in ({"variant": "real"}, {"people": -1}):
        with pytest.raises(ArgumentError, match=next(iter(wrong))):
            load_open_bodies("coarse", **wrong)
