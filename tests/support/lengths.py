"""How much of a long test is run: a sample every day, all of it in the long job, `.ci/nightly`."""

import os
from collections import Counter
from zlib import crc32

FULL = os.environ.get("RIEMHUMAN_TESTS") == "full"


def sample(items, step, first=0):
    """Return one of so many items; all of them in the long job."""
    items = list(items)
    return items if FULL else items[first::step]


def some(number, step):
    """Return one of so many examples, rounded up; all of them in the long job."""
    return number if FULL else -(-number // step)


def deselected(tests):
    """Return the tests that wait for the long job.

    Of the cases of a test marked `sampled(step)`, one of so many runs every day; likewise of all
    tests marked `sampled(step, kind)` with one kind. Which comes first depends on the name of the
    test, so that no case is left out by all tests.
    """
    if FULL:
        return set()
    waiting, counts = set(), Counter()
    for test in tests:
        mark = test.get_closest_marker("sampled")
        if mark is None:
            continue
        step, *kind = mark.args
        name = kind[0] if kind else test.nodeid.partition("[")[0]
        if (counts[name] + crc32(name.encode())) % step:
            waiting.add(test)
        counts[name] += 1
    return waiting
