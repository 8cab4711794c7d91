"""Benchmarks run where clocks are asked for, with `--benchmark-enable`: elsewhere they cost hours.

A benchmark is a test that measures by `performances.clocked`, and thus by pytest-benchmark, prints
its figures and asserts what the documentation promises.
"""

from pathlib import Path

import pytest

FOLDER = Path(__file__).parent


def pytest_collection_modifyitems(config, items):
    if config.getoption("--benchmark-enable"):
        return
    reason = pytest.mark.skip(reason="a benchmark: add --benchmark-enable -s")
    for item in items:
        if FOLDER in item.path.parents:
            item.add_marker(reason)
