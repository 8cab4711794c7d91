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


# Places of vertex 100 of the average man, a third of the way, with the people of ANSUR II.
WRITTEN = {
    "jumping_jacks": (153, [-0.1497618909, 1.6284446029, 0.0158889162]),
    "knees": (160, [-0.1799267063, 1.4555711299, 0.0065606316]),
    "one_leg_jump": (140, [-0.0552748187, 1.3420366499, -0.0634503630]),
    "running_on_spot": (155, [-0.1738019942, 1.4345714124, 0.0923471102]),
    "shake_hips": (145, [-0.0596184474, 1.4613164766, -0.0351375952]),
}


def test_numbers_are_those_written_down():
    for motion in load_open_motions("coarse", "average man", list(WRITTEN)):
        n_frames, place = WRITTEN[motion.sequence]
        assert len(motion) == n_frames
        np.testing.assert_allclose(motion[n_frames // 3][100], place, atol=1e-9)
