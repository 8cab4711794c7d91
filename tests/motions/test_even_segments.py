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


def test_gaussian_mean_of_a_helix_is_a_thinner_helix():
    """Six turns; a circle's mean over σ radians has the radius exp(−σ²/2)."""
    points = helix(np.linspace(0.0, 6.0, 181))
    chords, places = even_segments(np.diff(points, axis=0), 120, smoothing=0.02)
    middle = chords[50:70]
    turned = 2.0 * middle[:, 2]
    radii = np.hypot(middle[:, 0], middle[:, 1]) / (2.0 * np.sin(0.5 * turned))
    np.testing.assert_allclose(radii, np.exp(-0.5 * (0.02 * 12.0 * np.pi) ** 2), rtol=1e-3)
    # The ends stay, and places follow: a thinner helix turns faster along its length.
    np.testing.assert_allclose(chords.sum(axis=0), points[-1] - points[0], atol=1e-10)
    found = np.interp(places, np.arange(181), np.linspace(0.0, 6.0, 181))
    np.testing.assert_allclose(2.0 * np.pi * np.diff(found)[50:70], turned, rtol=1e-3)


def test_gaussian_mean_of_a_line_is_the_line():
    chords, places = even_segments(np.array([[1.0, 2.0], [2.0, 4.0], [1.0, 2.0]]), 8, 0.1)
    np.testing.assert_allclose(chords, np.full((8, 2), [0.5, 1.0]), rtol=2e-6)
    assert (np.diff(places) > 0).all()


def test_what_two_samplings_do_not_share_is_smoothed_away():
    """A jolt between two frames of one sampling, of which the other has none."""
    plain = np.diff(helix(EVEN), axis=0)
    jolt = np.array([0.0, 0.3, 0.0])
    jolted = np.insert(plain, [30, 30], [jolt, -jolt], axis=0)
    gaps = []
    for smoothing in (0.0, 0.03):
        chords = (even_segments(sides, 24, smoothing)[0] for sides in (plain, jolted))
        one, other = (np.cumsum(each, axis=0) for each in chords)
        gaps.append(np.linalg.norm(one - other))
    assert gaps[1] < 0.6 * gaps[0]


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
