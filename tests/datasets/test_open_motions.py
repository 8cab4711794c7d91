"""Facts about the open motions."""

import numpy as np
import pytest

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_bodies, load_open_model, load_open_motions
from riemhuman.datasets.open_poses import read_table
from riemhuman.errors import ArgumentError
from riemhuman.surfaces.deformation_basis import DeformationBasis

NAMES = [
    "chicken_wings",
    "hips",
    "jiggle_on_toes",
    "jumping_jacks",
    "knees",
    "light_hopping_loose",
    "light_hopping_stiff",
    "one_leg_jump",
    "one_leg_loose",
    "punching",
    "running_on_spot",
    "shake_arms",
    "shake_hips",
    "shake_shoulders",
]


@pytest.fixture(scope="module")
def motions():
    return load_open_motions("coarse")


@pytest.fixture
def computed(monkeypatch):
    """Return the list of how many surfaces each call of the model makes."""
    counts = []
    evaluate = BodyModel.__call__

    def counting(model, betas=None, pose=None, trans=None):
        points = evaluate(model, betas, pose, trans)
        counts.append(points[..., 0, 0].size)
        return points

    monkeypatch.setattr(BodyModel, "__call__", counting)
    return counts


def of_one(motions, sequence):
    return next(motion for motion in motions if motion.sequence == sequence)


def joints(motion):
    """Return the joints by name, each over time, shape (n_frames, 3)."""
    places = motion.model.joints(motion.betas, motion.pose_vectors, motion.translations)
    return dict(zip(motion.model.joint_names, np.moveaxis(places, 1, 0), strict=True))


def bend(places, upper, middle, lower):
    """Return the angle between two bones over time, in degrees, 0 where they are in line."""
    first, second = places[middle] - places[upper], places[lower] - places[middle]
    cosine = np.sum(first * second, axis=1)
    cosine /= np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.degrees(np.arccos(cosine))


def test_fourteen_motions_of_ten_other_people(motions):
    assert [motion.sequence for motion in motions] == 10 * NAMES
    own = np.stack([motion.betas for motion in motions[::14]])
    people = np.concatenate([own, load_open_bodies("coarse").betas[::10]])
    gaps = np.linalg.norm(people[:, None] - people, axis=-1)
    assert gaps[~np.eye(20, dtype=bool)].min() > 1  # standard deviations


def test_frame_rate_changes_the_times_alone(motions):
    (slow,) = load_open_motions("coarse", "average man", "knees", frames_per_second=20)
    fast = next(m for m in motions if (m.subject, m.sequence) == ("average man", "knees"))
    assert slow.frames_per_second == 20
    assert len(slow) == (len(fast) + 2) // 3
    np.testing.assert_allclose(slow[:], fast[::3], rtol=0, atol=1e-12)


def test_parameters_reproduce_the_frames(motions):
    motion = of_one(motions, "one_leg_jump")
    model = load_open_model("coarse")
    assert motion.model is model
    assert motion.betas.shape == (model.n_betas,)
    assert motion.pose_vectors.shape == (len(motion), model.n_joints, 3)
    assert motion.translations.shape == (len(motion), 3)
    for number in (0, 33, 100):
        surface = model(motion.betas, motion.pose_vectors[number], motion.translations[number])
        np.testing.assert_allclose(motion[number], surface, rtol=0, atol=1e-13)


def test_unknown_names_and_rates():
    for arguments, message in (
        ({"resolution": "fine"}, "resolution must be one of 'full', 'coarse'; found 'fine'"),
        ({"subjects": "heavy man"}, "subjects .*average woman.*; unknown: 'heavy man'"),
        ({"sequences": ["hips", "flying"]}, "sequences .*chicken_wings.*; unknown: 'flying'"),
        ({"frames_per_second": 0}, "frames_per_second must be a finite number above 0"),
    ):
        with pytest.raises(ArgumentError, match=message):
            load_open_motions(**({"resolution": "coarse"} | arguments))


def test_loading_again_gives_the_same_whatever_is_chosen(motions):
    subject, sequence = "older heavy man", "shake_arms"
    (alone,) = load_open_motions("coarse", [subject], [sequence])
    among = next(m for m in motions if (m.subject, m.sequence) == (subject, sequence))
    assert alone is not among
    for name in ("betas", "pose_vectors", "translations"):
        np.testing.assert_array_equal(getattr(alone, name), getattr(among, name))
    np.testing.assert_array_equal(alone[::30], among[::30])


def test_everybody_performs_a_little_differently(motions):
    same = [motion for motion in motions if motion.sequence == "knees"]
    assert len({motion.n_frames for motion in same}) > 4
    first = np.stack([motion.pose_vectors[0] for motion in same])
    gaps = np.abs(first[:, None] - first).max(axis=(-2, -1))
    assert np.degrees(gaps[~np.eye(10, dtype=bool)].min()) > 1


@pytest.mark.sampled(5)
@pytest.mark.parametrize("sequence", NAMES)
def test_smooth_on_the_ground_and_not_inside_out(motions, sequence):
    for motion in motions:
        if motion.sequence != sequence:
            continue
        frames = motion[:]
        speeds = np.linalg.norm(np.diff(frames, axis=0), axis=-1)
        assert 0.005 < speeds.max() < 0.2  # metres a frame
        corners = np.moveaxis(frames[::20][:, motion.faces], 2, 0)
        cones = np.sum(corners[0] * np.cross(corners[1], corners[2]), axis=-1)
        volumes = cones.sum(axis=1) / 6
        assert volumes.min() > 0.03
        assert volumes.max() < 1.1 * volumes.min()
        lowest = frames[..., 1].min(axis=1)
        assert lowest.min() > -0.06
        assert lowest.max() < 0.12


@pytest.mark.parametrize("sequence", NAMES)
def test_no_jumps(sequence):
    # Four times as many frames make steps a quarter as long; a jump would stay as it is.
    def longest_step(rate):
        (motion,) = load_open_motions("coarse", "average man", sequence, rate)
        places = np.stack(list(joints(motion).values()))
        return np.linalg.norm(np.diff(places, axis=1), axis=-1).max()

    assert longest_step(240) < 0.27 * longest_step(60)


def test_a_foot_that_stands_keeps_its_place(motions):
    for motion in motions[:28]:
        feet = read_table("open_motions")["motions"][motion.sequence]["standing_on"]
        if not feet:
            continue
        places = joints(motion)
        ankles = np.mean([places[f"{side}_ankle"] for side in feet], axis=0)
        assert np.ptp(ankles[:, [0, 2]], axis=0).max() < 1e-12


def test_joints_reach_what_the_motions_ask_for(motions):
    for subject in range(10):
        placed = {motion.sequence: joints(motion) for motion in motions[14 * subject :][:14]}

        def most(sequence, *names, placed=placed):
            return [
                bend(placed[sequence], *(f"{side}_{name}" for name in names)).max()
                for side in ("left", "right")
            ]

        for sequence in ("chicken_wings", "punching"):
            assert min(most(sequence, "shoulder", "elbow", "wrist")) > 100
        assert min(most("knees", "hip", "knee", "ankle")) > 90
        for sequence in ("chicken_wings", "jumping_jacks"):
            for side in ("left", "right"):
                above = placed[sequence][f"{side}_wrist"] - placed[sequence]["head"]
                assert above[:, 1].max() > 0.2
                assert above[:, 1].min() < -0.4
        punch = placed["punching"]
        reach = punch["left_wrist"] - punch["left_shoulder"]
        assert (reach[:, 2] / np.linalg.norm(reach, axis=1)).max() > 0.6  # forward
        raised = placed["knees"]
        assert (raised["left_knee"] - raised["left_hip"])[:, 1].max() > -0.05


def test_a_deformation_basis_is_learnt_from_every_tenth_frame(computed):
    motions = load_open_motions("coarse", ["average woman", "average man"])
    basis = DeformationBasis.from_motions(motions, n_components=20, step=10)
    assert basis.vectors.shape == (20, 1202, 3)
    inner = np.einsum("kvi,lvi->kl", basis.vectors, basis.vectors)
    np.testing.assert_allclose(inner, np.eye(20), rtol=0, atol=1e-8)
    assert set(computed) == {1}
    assert len(computed) == sum(len(range(0, len(motion), 10)) for motion in motions)
    assert (np.diff(basis.explained_variance) <= 0).all()
    assert basis.explained_variance_ratio.sum() > 0.9
