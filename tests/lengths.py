"""How much of a long test is run: a sample every day, all of it in the long job, `.ci/nightly`."""

import os

FULL = os.environ.get("RIEMHUMAN_TESTS") == "full"


def sample(items, step, first=0):
    """Return one of so many items; all of them in the long job."""
    items = list(items)
    return items if FULL else items[first::step]
