"""Facts about the open motions."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies, load_open_motions
from riemhuman.datasets.open_poses import read_table
from riemhuman.errors import ArgumentError

NAMES = list(read_table("open_motions")["motions"])


@pytest.fixture(scope="module")
def motions():
    return load_open_motions("coarse")


def joints(motion):
    """Return the joints by name, each over time, shape (n_frames, 3)."""
    places = motion.model.joints(motion.betas, motion.pose_vectors, motion.translations)
    return dict(zip(motion.model.joint_names, np.moveaxis(places, 1, 0), strict=True))


def test_fourteen_motions_of_ten_other_people(motions):
    assert [motion.sequence for motion in motions] == 10 * NAMES
    betas_of_people = np.stack([motion.betas for motion in motions[::14]])
    people = np.concatenate([betas_of_people, load_open_bodies("coarse").betas[::10]])
    gaps = np.linalg.norm(people[:, None] - people, axis=-1)
    assert gaps[~np.eye(20, dtype=bool)].min() > 1  # standard deviations


def test_frame_rate_changes_the_times_alone(motions):
    (slow,) = load_open_motions("coarse", "average man", "knees", frames_per_second=20)
    fast = next(m for m in motions if (m.subject, m.sequence) == ("average man", "knees"))
    assert slow.frames_per_second == 20
    assert len(slow) == (len(fast) + 2) // 3
    np.testing.assert_allclose(slow[:], fast[::3], rtol=0, atol=1e-12)


def test_unknown_names_and_rates():
    for arguments, message in (
        ({"resolution": "fine"}, "resolution must be one of 'full', 'coarse'; found 'fine'"),
        ({"subjects": "heavy man"}, "subjects .*average woman.*; unknown: 'heavy man'"),
        ({"sequences": ["hips", "flying"]}, "sequences .*chicken_wings.*; unknown: 'flying'"),
        ({"frames_per_second": 0}, "frames_per_second must be a finite number"),
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
    # Written down with the people of ANSUR II.
    written = [-0.1695313594745, 1.4892543423268, 0.0160499289858]
    np.testing.assert_allclose(alone[30][100], written, atol=1e-9)


def test_everybody_performs_a_little_differently(motions):
    same = [motion for motion in motions if motion.sequence == "knees"]
    assert len({motion.n_frames for motion in same}) > 4
    first = np.stack([motion.pose_vectors[0] for motion in same])
    gaps = np.abs(first[:, None] - first).max(axis=(-2, -1))
    assert np.degrees(gaps[~np.eye(10, dtype=bool)].min()) > 1


@pytest.mark.parametrize("sequence", ["jiggle_on_toes", "one_leg_jump", "shake_hips"])
def test_smooth_on_the_ground_and_not_inside_out(motions, sequence):
    for motion in [motion for motion in motions if motion.sequence == sequence][::3]:
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


@pytest.mark.parametrize("sequence", NAMES[::5])
def test_no_jumps(sequence):
    # Four times as many frames make steps a quarter as long; a jump would stay as it is.
    def longest_step(rate):
        (motion,) = load_open_motions("coarse", "average man", sequence, rate)
        places = np.stack(list(joints(motion).values()))
        return np.linalg.norm(np.diff(places, axis=1), axis=-1).max()

    assert longest_step(240) < 0.27 * longest_step(60)


def test_a_foot_that_stands_keeps_its_place(motions):
    for motion in motions[:14]:
        feet = read_table("open_motions")["motions"][motion.sequence]["standing_on"]
        if not feet:
            continue
        places = joints(motion)
        ankles = np.mean([places[f"{side}_ankle"] for side in feet], axis=0)
        assert np.ptp(ankles[:, [0, 2]], axis=0).max() < 1e-12
