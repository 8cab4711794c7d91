"""Equal chords of smooth curves: where they lie does not depend on when a curve was sampled."""

import numpy as np
import pytest

from riemhuman.motions._velocity_curves import even_segments


def helix(times):
    angles = 2.0 * np.pi * times
    return np.stack([np.cos(angles), np.sin(angles), 0.5 * angles], axis=1)


EVEN = np.linspace(0.0, 1.0, 60)
NONE = 1e-9  # smoothing


@pytest.mark.parametrize("times", [EVEN, EVEN**1.5])
def test_chords_are_those_of_the_curve(times):
    chords, places = even_segments(np.diff(helix(times), axis=0), 24, NONE)
    expected = np.diff(helix(np.linspace(0.0, 1.0, 25)), axis=0)
    np.testing.assert_allclose(chords, expected, atol=2e-5)
    begins = np.interp(places, np.arange(60), times)
    np.testing.assert_allclose(begins, np.linspace(0.0, 1.0, 25), atol=2e-3)


def test_curve_that_reverses():
    """Where it reverses, it stands still for a moment and makes no loop."""
    there_and_back = np.sin(np.pi * EVEN)[:, None] * np.array([[1.0, 2.0]])
    chords, _ = even_segments(np.diff(there_and_back, axis=0), 20, NONE)
    expected = np.repeat([[0.1, 0.2], [-0.1, -0.2]], 10, axis=0)
    np.testing.assert_allclose(chords, expected, atol=1e-4)


def test_gaussian_mean_of_a_helix_is_a_thinner_helix():
    """A circle's mean over σ radians has the radius exp(−σ²/2); here on six turns."""
    points = helix(np.linspace(0.0, 6.0, 181))
    chords, places = even_segments(np.diff(points, axis=0), 120, 0.02)
    middle = chords[50:70]
    angles = 2.0 * middle[:, 2]
    radii = np.hypot(middle[:, 0], middle[:, 1]) / (2.0 * np.sin(0.5 * angles))
    np.testing.assert_allclose(radii, np.exp(-0.5 * (0.02 * 12.0 * np.pi) ** 2), rtol=1e-3)
    # The ends stay, and places follow: a thinner helix turns faster along its length.
    np.testing.assert_allclose(chords.sum(axis=0), points[-1] - points[0], atol=1e-10)
    times = np.interp(places, np.arange(181), np.linspace(0.0, 6.0, 181))
    np.testing.assert_allclose(2.0 * np.pi * np.diff(times)[50:70], angles, rtol=1e-3)


def test_pauses_change_nothing_but_places():
    segments = np.diff(helix(EVEN), axis=0)
    paused = np.insert(segments, [0, 20, 20, 59], 0.0, axis=0)
    chords, places = even_segments(segments, 24, NONE)
    again, later = even_segments(paused, 24, NONE)
    np.testing.assert_allclose(again, chords, rtol=1e-12, atol=1e-14)
    frames = places + 1.0 + 2.0 * (places >= 20)
    np.testing.assert_allclose(later[1:-1], frames[1:-1], rtol=1e-12)
    assert later[[0, -1]].tolist() == [0.0, 63.0]


@pytest.mark.parametrize(
    ("segments", "smoothing", "chord"),
    [
        (np.zeros((3, 2)), NONE, [0.0, 0.0]),
        (np.array([[3.0, 4.0]]), NONE, [0.6, 0.8]),
        (np.array([[1.0, 2.0], [2.0, 4.0], [1.0, 2.0]]), 0.1, [0.8, 1.6]),
    ],
)
def test_standing_still_and_lines(segments, smoothing, chord):
    chords, places = even_segments(segments, 5, smoothing)
    np.testing.assert_allclose(chords, np.tile(chord, (5, 1)), rtol=2e-6)
    assert (np.diff(places) > 0).all()
    assert places[[0, -1]].tolist() == [0.0, len(segments)]
