"""The record of a motion, on one whose frames hold their own number."""

import numpy as np
import pytest

from riemhuman.datasets import Motion
from riemhuman.datasets.motions import choose_names
from riemhuman.errors import ArgumentError, ArgumentTypeError, FrameIndexError

FACES = np.array([[0, 1, 2], [0, 2, 3]])
N_FRAMES = 37


class Counted(Motion):
    """A motion of four points; it remembers which frames were asked for."""

    def __init__(self):
        super().__init__("anna", "waving", 25.0, N_FRAMES, FACES)
        self.asked = []

    def _frames(self, numbers):
        self.asked.append(list(numbers))
        return np.multiply.outer(np.array(numbers, dtype=float), np.ones((4, 3)))


@pytest.fixture
def motion():
    return Counted()


def shown(frames):
    return frames[:, 0, 0].tolist()


def test_what_a_motion_says_of_itself(motion):
    assert (motion.subject, motion.sequence) == ("anna", "waving")
    assert motion.frames_per_second == 25
    assert motion.n_frames == len(motion) == N_FRAMES
    assert motion.faces is FACES
    assert repr(motion) == "<Counted 'waving' of 'anna', 37 frames at 25 a second>"
    assert motion.asked == []


@pytest.mark.parametrize("index", [0, 5, 36, -1, -37, np.int64(7), np.uint8(9)])
def test_one_frame_asks_for_it_alone(motion, index):
    frame = motion[index]
    assert frame.shape == (4, 3)
    assert motion.asked == [[int(index) % N_FRAMES]]
    np.testing.assert_array_equal(frame, int(index) % N_FRAMES)


@pytest.mark.parametrize(
    "part",
    [
        slice(None),
        slice(3, 9),
        slice(None, None, 10),
        slice(None, None, -1),
        slice(30, 2, -7),
        slice(-4, None),
        slice(20, 1000),
        slice(9, 9),
    ],
)
def test_slices_are_those_of_a_list(motion, part):
    expected = list(range(N_FRAMES))[part]
    frames = motion[part]
    assert frames.shape == (len(expected), 4, 3)
    assert shown(frames) == expected
    assert motion.asked == [expected]


def test_iteration_gives_every_frame_once_and_asks_for_few_at_a_time(motion):
    frames = iter(motion)
    assert next(frames).shape == (4, 3)
    assert sum(map(len, motion.asked)) < N_FRAMES
    np.testing.assert_array_equal([frame[0, 0] for frame in frames], range(1, N_FRAMES))
    assert [number for run in motion.asked for number in run] == list(range(N_FRAMES))


@pytest.mark.parametrize("number", [37, -38, 10**9])
def test_frames_there_are_not(motion, number):
    with pytest.raises(FrameIndexError, match=rf"'waving' of 'anna'.* has no frame {number}$"):
        motion[number]
    assert issubclass(FrameIndexError, IndexError)
    assert motion.asked == []


@pytest.mark.parametrize("index", [1.0, "0", None, (0, 1), [0]])
def test_indices_of_another_type(motion, index):
    with pytest.raises(ArgumentTypeError, match="indexed by a whole number or a slice; found"):
        motion[index]


def test_a_motion_without_frames_to_make_cannot_be_built():
    with pytest.raises(TypeError, match="abstract"):
        Motion("anna", "waving", 25.0, 3, FACES)


def test_names_chosen():
    known = ("run", "walk", "jump")
    assert choose_names(None, "sequences", known) == known
    assert choose_names("walk", "sequences", known) == ("walk",)
    assert choose_names(["jump", "run"], "sequences", known) == ("jump", "run")
    assert choose_names((name for name in ["jump"]), "sequences", known) == ("jump",)


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ("fly", r"out of run, walk in file; unknown: 'fly'$"),
        (["fly", "run", "swim"], r"unknown: 'fly', 'swim'$"),
        (["run", "run"], r"sequences must be different names.*found \['run', 'run'\]"),
        ([], r"at least one.*found \[\]"),
        ([[]], r"unknown: \[\]"),
        ("", r"unknown: ''"),
    ],
)
def test_names_refused(wanted, message):
    with pytest.raises(ArgumentError, match=message):
        choose_names(wanted, "sequences", ("run", "walk"), " in file")


def test_names_of_another_type():
    with pytest.raises(ArgumentTypeError, match="sequences must be a list of names; found 3"):
        choose_names(3, "sequences", ("run", "walk"))
