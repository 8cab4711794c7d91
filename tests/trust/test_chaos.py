"""Jobs in a hostile world: right distances, or one typed error; nothing of others is touched."""

import sys

import pytest
from lengths import FULL
from trust.chaos import REFUSED, disturb

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="processes fork, and sizes are limited"),
    pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning"),
]


def test_jobs_are_disturbed(tmp_path):
    n_rounds = 500 if FULL else 20
    ends, faults = disturb(tmp_path, n_rounds, seed=2)
    assert faults == []
    assert ends[REFUSED] > n_rounds // 5
    assert ends[0] > n_rounds // 5
