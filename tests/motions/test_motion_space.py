"""Points of the space of motions: resampled, cropped, trimmed, smoothed."""

import numpy as np
import pytest

import riemhuman as rh


@pytest.fixture(scope="module")
def motion_space(space):
    return rh.motions.MotionSpace(space, n_times=7)


class TestResample:
    def test_frames_stay_where_times_meet_them(self, motion_space, motions):
        frames = motion_space.resample(motions[0][:4], 7)
        np.testing.assert_array_equal(frames[::2], motions[0][:4])

    def test_limbs_keep_their_length_between_frames(self, space, motion_space, open_motions):
        """Half way between arms hanging and arms raised, straight lines would shrink them."""
        punching = open_motions[1][:40:13]
        middle = motion_space.resample(punching, 7)[1::2]
        straight = 0.5 * (punching[1:] + punching[:-1])
        expected = 0.5 * (space.face_areas(punching[1:]) + space.face_areas(punching[:-1]))

        def change(surfaces):
            return np.abs(space.face_areas(surfaces) / expected - 1).mean()

        assert change(middle) < 0.2 * change(straight)

    def test_times_of_frames(self, motion_space, motions):
        uneven = motion_space.resample(motions[0][:3], 5, times=[0.0, 1.0, 4.0])
        plain = motion_space.resample(motions[0][:3], at=[0.0, 1.0, 4 / 3, 5 / 3, 2.0])
        np.testing.assert_allclose(uneven, plain, atol=1e-12)

    def test_geodesics_of_a_solver(self, space, motions):
        solver = rh.solvers.LinearPath(n_nodes=3)
        straight = rh.motions.MotionSpace(space, 3, solver).resample(motions[0][:2])
        np.testing.assert_allclose(straight[1], motions[0][:2].mean(axis=0))

    @pytest.mark.parametrize(
        ("options", "message"),
        [
            ({"times": [0.0, 2.0, 1.0]}, "times must increase; found 1 after 2, at index 2"),
            ({"times": [0.0, 1.0]}, r"times must have shape \(3\)"),
            ({"at": [0.0, 2.5]}, "at must lie within the motion, 0 to 2"),
            ({"at": [1.0, 0.5]}, "must not decrease"),
            ({"n_times": 1}, "n_times must be a whole number of at least 2"),
        ],
    )
    def test_bad_times(self, motion_space, motions, options, message):
        with pytest.raises(rh.RiemhumanError, match=message):
            motion_space.resample(motions[0][:3], **options)


class TestParts:
    def test_crop(self, motion_space, motions):
        part = motion_space.crop(motions[0], 1.5, 4)
        assert len(part) == 4
        np.testing.assert_array_equal(part[1:], motions[0][2:5])

    def test_trim_takes_stillness_off(self, motion_space, motions):
        held = np.repeat(motions[0], [3, *[1] * 8, 4], axis=0)
        np.testing.assert_array_equal(motion_space.trim(held), motions[0])

    def test_trim_of_what_does_not_move(self, motion_space, motions):
        with pytest.raises(rh.RiemhumanError, match="above the share"):
            motion_space.trim(np.repeat(motions[0][:1], 3, axis=0))

    def test_smoothing_lowers_noise_and_keeps_the_ends(self, motion_space, open_motions):
        still = open_motions[2][:5]
        noisy = still + np.random.default_rng(0).normal(0.0, 5e-4, still.shape)
        smooth = motion_space.smooth(noisy, 2)
        np.testing.assert_array_equal(smooth[[0, -1]], noisy[[0, -1]])
        metric = motion_space.frames.metric
        assert metric.dist(smooth, still)[1:-1].mean() < 0.8 * metric.dist(noisy, still).mean()


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
