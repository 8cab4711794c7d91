"""Parts of long motions are found where they are, and the same as by all sums."""

import itertools
import math

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions.dtw_kernels import follow


def test_sums_are_the_least_of_all_paths():
    costs = np.random.default_rng(2).uniform(size=(3, 5))
    sums, starts = np.full(3, math.inf), np.zeros(3, dtype=np.int64)
    totals, begins = np.empty(5), np.empty(5, dtype=np.int64)
    for first, last in ((0, 2), (2, 5)):  # in two runs
        run = np.ascontiguousarray(costs[:, first:last])
        follow(run, first, sums, starts, totals[first:last], begins[first:last])
    for end in range(5):
        found = {}
        for start in range(end + 1):
            found[start] = least_sum(costs[:, start : end + 1])
        assert totals[end] == pytest.approx(min(found.values()), rel=1e-12)
        assert found[begins[end]] == pytest.approx(totals[end], rel=1e-12)


def least_sum(costs):
    """Return the least weighted sum from corner to corner by recursion."""
    n, m = costs.shape
    best = np.full((n, m), math.inf)
    for i, j in itertools.product(range(n), range(m)):
        options = [2 * costs[i, j]] if i == j == 0 else []
        options += [best[i - 1, j - 1] + 2 * costs[i, j]] if i and j else []
        options += [best[i - 1, j] + costs[i, j]] if i else []
        options += [best[i, j - 1] + costs[i, j]] if j else []
        best[i, j] = min(options)
    return best[-1, -1]


def test_another_person_is_found_at_another_speed(pose, open_motions):
    """One person's punch, slowed down, among another person's three motions."""
    knees, punching, arms = (motion[:60:4] for motion in open_motions[3:])
    long = np.concatenate([knees, punching, arms])
    query = open_motions[1][4:50:3]
    found = rh.motions.MotionSearch(pose).find(query, long, n_occurrences=3)
    assert len(found) > 1
    assert 14 <= found[0].start < found[0].stop <= 31
    assert found[0].dist < 0.7 * found[1].dist
    parts = sorted((part.start, part.stop) for part in found)
    assert all(one[1] <= other[0] for one, other in itertools.pairwise(parts))


def test_motions_are_read_in_runs(pose, open_motions):
    class Watched:
        longest = 0

        def __len__(self):
            return 60

        def __getitem__(self, index):
            frames = open_motions[0][:60][index]
            self.longest = max(self.longest, len(frames))
            return frames

    motion = Watched()
    found = rh.motions.MotionSearch(pose).find(open_motions[0][20:30], motion, 1)
    assert (found[0].start, found[0].stop) == (20, 30)
    assert found[0].dist == 0.0
    assert motion.longest <= 16


def test_one_frame(pose, motions):
    with pytest.raises(rh.RiemhumanError, match="query must have at least 2 frames; found 1"):
        rh.motions.MotionSearch(pose).find(motions[0][:1], motions[0])
