"""Means of motions, their components, and geodesics between them."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh


@pytest.fixture(scope="module")
def motion_space(space):
    return rh.motions.MotionSpace(space, n_times=4)


@pytest.fixture(scope="module")
def knees():
    """Three people raise a knee, each at a speed of their own."""
    performances = rh.datasets.load_open_motions("coarse", sequences="knees")[:3]
    frames = [np.arange(0, 41, 8), np.arange(0, 41, 5), np.rint(np.linspace(0, 1, 9) ** 1.5 * 40)]
    return [
        np.stack([m[int(i)] for i in some]) for m, some in zip(performances, frames, strict=True)
    ]


@pytest.fixture(scope="module")
def components(motion_space, knees):
    return rh.motions.MotionComponents(rh.motions.MotionMean(motion_space)).fit(knees)


class TestMean:
    def test_of_one_motion_at_three_speeds_is_that_motion(self, motion_space, open_motions):
        frames = open_motions[0][:41:8]
        held = [np.repeat(frames, [n, 1, 1, 1, 1, 4 - n], axis=0) for n in (1, 2, 3)]
        mean = rh.motions.MotionMean(motion_space, n_iterations=1).fit(held)
        distances = [
            motion_space.frames.metric.dist(frames, surface).min() for surface in mean.estimate_
        ]
        step = motion_space.frames.metric.dist(frames[1:], frames[:-1]).max()
        assert max(distances) < 0.5 * step
        assert mean.variance_ < 0.1 * step**2

    def test_of_a_motion_that_turns_around(self, space, open_motions):
        """The fields of a body are those of its reflection through a point."""
        motion = open_motions[0][:40:8].copy()
        motion[3:] *= [-1.0, 1.0, -1.0]
        turning = rh.motions.MotionSpace(space, n_times=5)
        mean = rh.motions.MotionMean(turning, n_iterations=1).fit([motion, motion])
        np.testing.assert_allclose(mean.estimate_, mean.aligned_[0], atol=1e-3)

    def test_directions_of_bodies_do_not_count(self, motion_space, knees, components):
        angles = 2.5, 0.0, -1.5
        turned = [
            motion @ Rotation.from_euler("y", angle).as_matrix().T + [angle, 0.0, 0.0]
            for motion, angle in zip(knees, angles, strict=True)
        ]
        mean = rh.motions.MotionMean(motion_space).fit(turned)
        for found, expected in zip(mean.estimate_, components.mean.estimate_, strict=True):
            moved = rh.procrustes(expected, to=found)
            np.testing.assert_allclose(found, moved, atol=1e-3)

    def test_limbs_do_not_shrink(self, space, components):
        """Roots of areas are averaged, as λ of the metric weighs them; a straight mean is less."""
        mean = components.mean
        roots = np.sqrt(space.face_areas(mean.aligned_)).mean(axis=0)
        expected = np.sum(roots**2, axis=-1)
        area = space.face_areas(mean.estimate_).sum(axis=-1)
        np.testing.assert_allclose(area, expected, rtol=0.01)

    def test_it_is_nearer_to_all_than_any_of_them(self, motion_space, components):
        mean = components.mean
        metric = rh.motions.RateDependentMetric(
            motion_space, rh.ElasticMetric(motion_space.frames, a=1.0, lam=1.0, c=1.0)
        )
        for motion in mean.aligned_:
            spread = np.mean([metric.squared_dist(other, motion) for other in mean.aligned_])
            assert mean.variance_ < spread

    def test_clock_is_the_mean_of_all(self, components):
        times = components.mean.times_
        np.testing.assert_allclose(times.mean(axis=0), [0, 1 / 3, 2 / 3, 1], atol=0.02)
        assert (np.diff(times, axis=1) > 0).all()


class TestComponents:
    def test_all_of_them_make_the_motions(self, space, components):
        made = components.inverse_transform(components.scores_[:1])[0]
        metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=1.0)
        original = components.mean.aligned_[0]
        far = metric.dist(original, components.mean_)
        assert (metric.dist(made, original) < 0.1 * far).all()
        variances = components.scores_.var(axis=0, ddof=1)
        np.testing.assert_allclose(variances, components.explained_variance_, rtol=1e-6)
        assert components.explained_variance_ratio_.sum() == pytest.approx(1.0)


class TestGeodesic:
    def test_ends_and_speed(self, motion_space, knees):
        result = rh.motions.MotionGeodesic(n_nodes=5).solve(motion_space, knees[0], knees[1])
        np.testing.assert_array_equal(result.path[0], motion_space.resample(knees[0]))
        np.testing.assert_allclose(result.path[-1][[0, -1]], knees[1][[0, -1]])
        steps = motion_space.metric.dist(result.path[1:], result.path[:-1])
        assert steps.max() < 1.1 * steps.min()
        whole = motion_space.metric.dist(result.path[0], result.path[-1])
        assert steps.sum() < 1.05 * whole
