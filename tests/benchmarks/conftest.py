"""Benchmarks run where clocks are asked for, and in the long job: elsewhere they cost minutes.

`--benchmark-enable -s` measures and prints; `RIEMHUMAN_TESTS=full` alone runs the brief forms, of
which the files speak as those where benchmarks are disabled.
"""

from pathlib import Path

import pytest
from lengths import FULL

FOLDER = Path(__file__).parent


def pytest_collection_modifyitems(config, items):
    if FULL or config.getoption("--benchmark-enable"):
        return
    reason = pytest.mark.skip(reason="a benchmark: add --benchmark-enable -s")
    for item in items:
        if FOLDER in item.path.parents:
            item.add_marker(reason)
