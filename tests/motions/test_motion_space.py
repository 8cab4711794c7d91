"""Points of the space of motions, and their metric."""

import numpy as np
import pytest

import riemhuman as rh


@pytest.fixture(scope="module")
def motion_space(space):
    return rh.motions.MotionSpace(space, n_times=7)


class TestResample:
    def test_limbs_keep_their_length_between_frames(self, space, motion_space, open_motions):
        """Half way between arms hanging and arms raised, straight lines would shrink them."""
        punching = open_motions[1][:40:13]
        frames = motion_space.resample(punching, 7)
        np.testing.assert_array_equal(frames[::2], punching)
        middle = frames[1::2]
        straight = 0.5 * (punching[1:] + punching[:-1])
        expected = 0.5 * (space.face_areas(punching[1:]) + space.face_areas(punching[:-1]))

        def change(surfaces):
            return np.abs(space.face_areas(surfaces) / expected - 1).mean()

        assert change(middle) < 0.2 * change(straight)

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"at": [0.0, 2.5]}, "at must lie within the motion, 0 to 2"),
            ({"at": [1.0, 0.5]}, "must not decrease"),
            ({"n_times": 1}, "n_times must be a whole number of at least 2"),
        ],
    )
    def test_bad_times(self, motion_space, motions, options, message):
        with pytest.raises(rh.RiemhumanError, match=message):
            motion_space.resample(motions[0][:3], **options)


class TestRateDependentMetric:
    def test_it_is_the_mean_over_time(self, space, motion_space, motions):
        one, other = motions[0][:7], motions[1][:7]
        frames = space.metric.squared_dist(one, other)
        expected = np.trapezoid(frames, dx=1 / 6)
        assert motion_space.metric.squared_dist(one, other) == pytest.approx(expected)
        pairs = motion_space.metric.dist_pairwise(np.stack([one, other, one]), precision="double")
        np.testing.assert_allclose(pairs[0], [0.0, np.sqrt(expected), 0.0], rtol=1e-9)

    def test_inner_product_is_half_the_second_derivative(self, motion_space, motions):
        base, step = motions[0][:7], 1e-4
        vector = motions[1][:7] - base
        moved = motion_space.metric.squared_dist(base, base + step * vector) / step**2
        assert motion_space.metric.squared_norm(vector, base) == pytest.approx(moved, rel=1e-2)

    def test_the_space(self, motion_space):
        points = motion_space.random_point(2, bound=0.5, rng=0)
        assert motion_space.belongs(points).all()
        points[0, 3, 5] = np.nan
        assert motion_space.belongs(points).tolist() == [False, True]
