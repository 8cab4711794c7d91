"""Rows that describe motions: what changes them, what does not, and scikit-learn's conventions."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions import MotionDescriptor


@pytest.fixture(scope="module")
def descriptor(pose):
    return MotionDescriptor(pose, n_components=8, frames_per_second=30.0)


def test_repetitions_change_little(descriptor, motions):
    """A movement and its return, twice: no alignment is needed."""
    cycles = [np.concatenate([m, m[::-1]]) for m in motions]
    rows = descriptor.fit_transform(cycles)
    twice = descriptor.transform([np.concatenate([m, m]) for m in cycles])
    apart = np.linalg.norm(rows[:, None] - rows, axis=-1)
    nearest = apart[~np.eye(len(rows), dtype=bool)].min()
    assert np.linalg.norm(rows - twice, axis=1).max() < 0.3 * nearest


def test_blocks_from_their_definition(pose, space, motions):
    """With all components, distances of means are those of the metric's coordinates."""
    descriptor = MotionDescriptor(pose, n_components=100, frames_per_second=30.0, heading=True)
    rows = descriptor.fit_transform(motions)
    width = (rows.shape[1] - 2) // 3
    coordinates = [pose.lower_bound_coordinates(motion) for motion in motions]
    means = np.stack([c.mean(axis=0) for c in coordinates])
    spread = np.sqrt(np.sum(np.var(means, axis=0)))
    between = np.linalg.norm(means[:, None] - means, axis=-1) / spread
    found = np.linalg.norm(rows[:, None, :width] - rows[:, :width], axis=-1)
    np.testing.assert_allclose(found, between, rtol=1e-3)
    # Each block has a spread of one; nobody travels in these motions but by swaying.
    for block in (rows[:, :width], rows[:, width : 2 * width], rows[:, 2 * width : -2]):
        assert np.sum(np.var(block, axis=0)) == pytest.approx(1.0)


def test_travel_is_weighted(pose, motions):
    moved = [motion + 0.05 * k * np.arange(10)[:, None, None] * [1, 0, 0]
             for k, motion in enumerate(motions)]  # fmt: skip
    spreads = [
        np.sum(np.var(
            MotionDescriptor(pose, travel_weight=weight, frames_per_second=30.0, n_components=4)
            .fit_transform(moved)[:, -2:], axis=0,
        ))
        for weight in (0.0, 1.0, 2.0)
    ]  # fmt: skip
    assert spreads == pytest.approx([0.0, 1.0, 4.0])


def test_conventions_of_scikit_learn(descriptor, motions):
    base = pytest.importorskip("sklearn.base")
    other = base.clone(descriptor).set_params(n_components=3)
    assert other.fit(motions) is other
    assert other.transform(motions[:2]).shape == (2, other.n_features_out_)
    np.testing.assert_array_equal(other.fit_transform(motions), other.transform(motions))


def test_refusals(pose, motions):
    with pytest.raises(rh.RiemhumanError, match="must be fitted first"):
        MotionDescriptor(pose).transform(motions)
    with pytest.raises(rh.RiemhumanError, match=r"speed of motions\[0\] depends on the frame rate"):
        MotionDescriptor(pose).fit(motions)
    with pytest.raises(rh.RiemhumanError, match="pass it in a list"):
        MotionDescriptor(pose, frames_per_second=30.0).fit(motions[0])
    with pytest.raises(rh.RiemhumanError, match="at least 2 frames; found 1"):
        MotionDescriptor(pose, frames_per_second=30.0).fit([motions[0][:1], motions[1]])
