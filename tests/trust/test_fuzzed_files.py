"""Thousands of damaged files: each is refused by a typed error, or read as it should.

No other error, no warning, no array that is not finite. A size that is damaged may ask for more
than the gigabyte of memory that there is.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SUPPORT = Path(__file__).parents[1] / "support"
ROOT = Path(__file__).parents[2]
GROUPS = {
    "meshes": ["ply text", "ply binary", "obj", "off", "glb"],
    "archives": ["amass", "dynamic faust"],
    "pickles": ["model pickle"],
}

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="memory is bounded by the address space, as Linux counts it"
)


def fuzz(tmp_path, names, count):
    """Return how cases ended in a process of its own, which may crash."""
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(SUPPORT), str(ROOT)]),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }
    command = [sys.executable, str(SUPPORT / "fuzz.py"), *names, "--verbose"]
    command += ["--count", str(count)]
    options = {"env": environment, "cwd": tmp_path, "timeout": 600, "check": False}
    done = subprocess.run(command, capture_output=True, text=True, **options)
    at_work = done.stdout.splitlines()[-1:]
    assert done.returncode == 0, f"ended with {done.returncode} at {at_work}: {done.stderr[-2000:]}"
    return json.loads(*at_work)["ends"]


@pytest.mark.slow
@pytest.mark.parametrize("group", GROUPS)
def test_damaged_files(group, tmp_path):
    for name, ends in fuzz(tmp_path, GROUPS[group], 300).items():
        assert sum(ends.values()) == 300
        assert min(ends.values()) > 0, f"{name}: {ends}"
