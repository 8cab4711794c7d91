"""Equal chords of smooth curves: where they lie does not depend on when a curve was sampled."""

import numpy as np
import pytest

from riemhuman.motions.even_segments import even_segments


def helix(times):
    turns = 2.0 * np.pi * times
    return np.stack([np.cos(turns), np.sin(turns), 0.5 * turns], axis=1)


EVEN = np.linspace(0.0, 1.0, 60)
LATE = EVEN**1.5


def chords_of(times, n_segments=24):
    return even_segments(np.diff(helix(times), axis=0), n_segments)


@pytest.mark.parametrize("times", [EVEN, LATE])
def test_chords_are_those_of_the_curve(times):
    chords, places = chords_of(times)
    expected = np.diff(helix(np.linspace(0.0, 1.0, 25)), axis=0)
    np.testing.assert_allclose(chords, expected, atol=2e-5)
    # Where they begin, in frames.
    found = np.interp(places, np.arange(60), times)
    np.testing.assert_allclose(found, np.linspace(0.0, 1.0, 25), atol=2e-3)


def test_curve_that_turns_back():
    """Its turn is a point that it stands at for a moment, and no loop."""
    there_and_back = np.sin(np.pi * EVEN)[:, None] * np.array([[1.0, 2.0]])
    chords, _ = even_segments(np.diff(there_and_back, axis=0), 20)
    expected = np.repeat([[0.1, 0.2], [-0.1, -0.2]], 10, axis=0)
    np.testing.assert_allclose(chords, expected, atol=1e-4)


def test_pauses_change_nothing_but_places():
    segments = np.diff(helix(EVEN), axis=0)
    paused = np.insert(segments, [0, 20, 20, 59], 0.0, axis=0)
    chords, places = even_segments(segments, 24)
    again, later = even_segments(paused, 24)
    np.testing.assert_allclose(again, chords, rtol=1e-12, atol=1e-14)
    frames = places + 1.0 + 2.0 * (places >= 20)
    np.testing.assert_allclose(later[1:-1], frames[1:-1], rtol=1e-12)
    assert later[[0, -1]].tolist() == [0.0, 63.0]


def test_motion_that_stands_still():
    chords, places = even_segments(np.zeros((3, 2)), 4)
    assert not chords.any()
    assert places.tolist() == [0.0, 0.75, 1.5, 2.25, 3.0]


def test_one_side_is_divided():
    chords, places = even_segments(np.array([[3.0, 4.0]]), 5)
    np.testing.assert_allclose(chords, np.full((5, 2), [0.6, 0.8]), rtol=1e-12)
    np.testing.assert_allclose(places, np.linspace(0.0, 1.0, 6), atol=1e-12)
