"""The record of a motion, on one whose frames hold their own number."""

import numpy as np
import pytest

from riemhuman.datasets import Motion
from riemhuman.errors import ArgumentTypeError, FrameIndexError

FACES = np.array([[0, 1, 2], [0, 2, 3]])
N_FRAMES = 37


class Counted(Motion):
    """A motion of four points; it remembers which frames were asked for."""

    def __init__(self, subject="anna", sequence="waving"):
        super().__init__(subject, sequence, 25.0, N_FRAMES, FACES)
        self.asked = []

    def _frames(self, numbers):
        self.asked.append(list(numbers))
        return np.multiply.outer(np.array(numbers, dtype=float), np.ones((4, 3)))


@pytest.fixture
def motion():
    return Counted()


def test_slices_are_those_of_a_list(motion):
    for text in (":", "3:9", "::10", "::-1", "30:2:-7", "-4:", "20:1000", "9:9"):
        part = slice(*(int(number) if number else None for number in text.split(":")))
        expected = list(range(N_FRAMES))[part]
        frames = motion[part]
        assert frames.shape == (len(expected), 4, 3)
        assert frames[:, 0, 0].tolist() == expected
        assert motion.asked.pop() == expected


def test_iteration_gives_every_frame_once_and_asks_for_few_at_a_time(motion):
    frames = iter(motion)
    assert next(frames).shape == (4, 3)
    assert sum(map(len, motion.asked)) < N_FRAMES
    np.testing.assert_array_equal([frame[0, 0] for frame in frames], range(1, N_FRAMES))
    assert [number for run in motion.asked for number in run] == list(range(N_FRAMES))


def test_wrong_indices(motion):
    for number in (37, -38):
        message = rf"<Counted 'waving' of 'anna', 37 frames at 25 a second> has no frame {number}$"
        with pytest.raises(FrameIndexError, match=message):
            motion[number]
    for index in (1.0, "0", None, [0]):
        with pytest.raises(ArgumentTypeError, match="indexed by a whole number or a slice; found"):
            motion[index]
    assert motion.asked == []
