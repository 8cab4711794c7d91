"""Pairs of frames from motions of every kind; what is refused."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.surfaces.motion_frames import frames_apart

MOTION = np.random.default_rng(0).normal(size=(24, 5, 3))


class Indexed:
    """A motion whose frames are computed when asked for."""

    def __init__(self, frames):
        self.frames = frames
        self.asked = []

    def __len__(self):
        return len(self.frames)

    def __getitem__(self, number):
        self.asked.append(number)
        return self.frames[number]


def reusing_one_array():
    frame = np.empty((5, 3))
    for values in MOTION:
        frame[:] = values
        yield frame


@pytest.mark.parametrize(
    "make",
    [
        lambda: MOTION,
        lambda: list(MOTION),
        lambda: iter(MOTION),
        lambda: [MOTION[:7], MOTION[7:8], MOTION[8], MOTION[9:]],
        lambda: (run for run in np.split(MOTION, 4)),
        reusing_one_array,
        lambda: Indexed(MOTION),
        lambda: MOTION.tolist(),
    ],
    ids=["array", "list", "iterator", "mixed", "runs", "reusing", "indexed", "nested lists"],
)
def test_every_kind_of_motion_gives_the_same_pairs(make):
    pairs = list(frames_apart([make(), make()], step=5))
    assert len(pairs) == 8
    for n, (start, end) in enumerate(pairs):
        np.testing.assert_array_equal(start, MOTION[n % 4 * 5])
        np.testing.assert_array_equal(end, MOTION[n % 4 * 5 + 5])


def test_motions_may_be_one_array_or_a_generator():
    stacked = np.stack([MOTION, MOTION + 1.0])
    for motions in (stacked, (motion for motion in stacked)):
        ends = [end for _, end in frames_apart(motions, step=23)]
        np.testing.assert_array_equal(ends, stacked[:, 23])


def test_indexed_motion_is_asked_for_the_frames_needed_alone():
    motion = Indexed(MOTION)
    list(frames_apart([motion], step=10))
    assert motion.asked == [0, 10, 20]


def test_only_a_pair_of_frames_is_kept():
    alive = []

    class Frame(np.ndarray):
        def __del__(self):
            alive.pop()

    def motion():
        for _ in range(50):
            frame = np.zeros((5, 3)).view(Frame)
            alive.append(1)
            yield frame
            del frame
            assert len(alive) <= 2

    assert len(list(frames_apart([motion()], step=1))) == 49


def test_shortest_motion_has_one_pair():
    assert len(list(frames_apart([MOTION[:11]], step=10))) == 1


def with_bad_entry(number):
    motion = MOTION.copy()
    motion[number, 2, 1] = np.nan
    return motion


@pytest.mark.parametrize(
    ("motions", "error", "message"),
    [
        ([], ArgumentError, "motions holds no motion"),
        ([MOTION, MOTION[:10]], ArgumentError, r"motions\[1\] has 10 frames; with step=10 .* 11"),
        ([Indexed(MOTION[:4])], ArgumentError, r"motions\[0\] has 4 frames"),
        ([iter(())], ArgumentError, r"motions\[0\] has 0 frames"),
        (
            [MOTION, MOTION, MOTION[:, :4]],
            ArgumentError,
            r"motions\[2\] has 4 vertices; the motions before it have 5",
        ),
        (
            [[*MOTION[:3], MOTION[3, :4]]],
            ArgumentError,
            r"frame 3 of motions\[0\] has 4 vertices; .* 5",
        ),
        ([MOTION, with_bad_entry(10)], ArgumentError, r"frame 10 of motions\[1\] holds 1 NaN"),
        ([MOTION, with_bad_entry(7)], ArgumentError, r"frame 7 of motions\[1\] holds 1 NaN"),
        ([[with_bad_entry(7)]], ArgumentError, r"frame 7 of motions\[0\] holds 1 NaN"),
        ([Indexed(with_bad_entry(20))], ArgumentError, r"frame 20 of motions\[0\] holds 1 NaN"),
        (MOTION, ArgumentError, r"found one, of shape \(24, 5, 3\)"),
        ([MOTION[:, :, :2]], ArgumentError, r"frame 0 of motions\[0\] must have shape"),
        ([3.0], ArgumentTypeError, r"motions\[0\] must be an array"),
        (None, ArgumentTypeError, "motions must be an array"),
        (
            ["walking on the spot"],
            ArgumentTypeError,
            r"frame 0 of motions\[0\] must be an array of real",
        ),
    ],
)
def test_refusals_say_which(motions, error, message):
    with pytest.raises(error, match=message):
        list(frames_apart(motions, step=10))


@pytest.mark.parametrize(("step", "error"), [(0, ArgumentError), (2.5, ArgumentTypeError)])
def test_step_must_be_a_positive_whole_number(step, error):
    with pytest.raises(error, match="step"):
        next(frames_apart([MOTION], step=step))


def test_progress_is_shown_on_request(capsys):
    list(frames_apart([MOTION, MOTION], progress=True))
    assert "2/2" in capsys.readouterr().err
    list(frames_apart(iter([MOTION]), progress=True))
    assert "1motion" in capsys.readouterr().err
    list(frames_apart([MOTION]))
    assert capsys.readouterr().err == ""
