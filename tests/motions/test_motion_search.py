"""Parts of long motions are found where they are, by the least of all sums."""

import itertools
import math

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions._warping_kernels import extend_paths


def test_another_person_is_found_at_another_speed(pose, open_motions):
    """One person's punch, slowed down, among another person's three motions."""
    long = np.concatenate([motion[:60:4] for motion in open_motions[:3]])
    parts = rh.motions.MotionSearch(pose).find(open_motions[4][4:50:2], long, n_occurrences=3)
    assert len(parts) > 1
    assert 14 <= parts[0].start < parts[0].stop <= 31
    assert parts[0].dist < 0.7 * parts[1].dist
    intervals = sorted((part.start, part.stop) for part in parts)
    assert all(before[1] <= after[0] for before, after in itertools.pairwise(intervals))


def test_parts_are_not_much_shorter_than_the_query(pose, open_motions):
    """A person who holds one pose of the query is not the query."""
    query = open_motions[0][:60:4]
    held = np.repeat(query[-1:], 20, axis=0)
    long = np.concatenate([held, open_motions[3][:60:4], held])
    any_length = rh.motions.MotionSearch(pose, shortest=0.0).find(query, long, 12)
    assert min(part.stop - part.start for part in any_length) < 4
    parts = rh.motions.MotionSearch(pose).find(query, long, n_occurrences=12)
    assert min(part.stop - part.start for part in parts) >= 8
    assert 16 <= parts[0].start <= 24
    for wrong in (-1.0, 1.5):
        with pytest.raises(rh.RiemhumanError, match="shortest must be"):
            rh.motions.MotionSearch(pose, shortest=wrong)


@pytest.mark.parametrize("longest_run", [1, 2, 4])
def test_sums_are_the_least_of_all_beginnings(longest_run):
    """The least of all paths in which no frame of the motion stands for more of the query."""
    costs = np.random.default_rng(4).uniform(size=(4, 5))
    sums, numbers = np.full(4, math.inf), np.zeros(4, dtype=np.int64)
    totals, begins = np.empty(5), np.empty(5, dtype=np.int64)
    for first, last in ((0, 2), (2, 5)):  # in two runs
        run = np.ascontiguousarray(costs[:, first:last])
        extend_paths(run, first, longest_run, sums, numbers, totals[first:last], begins[first:last])

    def least_from(i, j, run, end):
        """Return the least sum from a cell onwards, as it is defined."""
        if (i, j) == (3, end):
            return 0.0
        best = math.inf
        if i < 3 and j < end:
            best = 2.0 * costs[i + 1, j + 1] + least_from(i + 1, j + 1, 1, end)
        if j < end:
            best = min(best, costs[i, j + 1] + least_from(i, j + 1, 1, end))
        if i < 3 and run < longest_run:
            best = min(best, costs[i + 1, j] + least_from(i + 1, j, run + 1, end))
        return best

    for end in range(5):
        found = [2.0 * costs[0, start] + least_from(0, start, 1, end) for start in range(end + 1)]
        assert totals[end] == pytest.approx(min(found), rel=1e-12)
        if math.isfinite(totals[end]):
            assert found[begins[end]] == min(found)


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
