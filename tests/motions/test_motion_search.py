"""Parts of long motions are found where they are, by the least of all sums."""

import itertools
import math

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions._warping_kernels import extend_paths, least_sums


def test_sums_are_the_least_of_all_beginnings():
    costs = np.random.default_rng(2).uniform(size=(3, 5))
    sums, starts = np.full(3, math.inf), np.zeros(3, dtype=np.int64)
    totals, begins = np.empty(5), np.empty(5, dtype=np.int64)
    for first, last in ((0, 2), (2, 5)):  # in two runs
        run = np.ascontiguousarray(costs[:, first:last])
        extend_paths(run, first, sums, starts, totals[first:last], begins[first:last])
    for end in range(5):
        parts = [np.ascontiguousarray(costs[:, start : end + 1]) for start in range(end)]
        all_sums = [least_sums(part)[-1, -1] for part in parts]
        all_sums.append(costs[:, end].sum() + costs[0, end])
        assert totals[end] == pytest.approx(min(all_sums), rel=1e-12)
        assert all_sums[begins[end]] == pytest.approx(totals[end], rel=1e-12)


def test_another_person_is_found_at_another_speed(pose, open_motions):
    """One person's punch, slowed down, among another person's three motions."""
    long = np.concatenate([motion[:60:4] for motion in open_motions[:3]])
    parts = rh.motions.MotionSearch(pose).find(open_motions[4][4:50:2], long, n_occurrences=3)
    assert len(parts) > 1
    assert 14 <= parts[0].start < parts[0].stop <= 31
    assert parts[0].dist < 0.7 * parts[1].dist
    intervals = sorted((part.start, part.stop) for part in parts)
    assert all(before[1] <= after[0] for before, after in itertools.pairwise(intervals))


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
    part = rh.motions.MotionSearch(pose).find(open_motions[0][20:30], motion, 1)[0]
    assert (part.start, part.stop, part.dist) == (20, 30, 0.0)
    assert motion.longest <= 16
    with pytest.raises(rh.RiemhumanError, match="query must have at least 2 frames; found 1"):
        rh.motions.MotionSearch(pose).find(open_motions[0][:1], motion)
