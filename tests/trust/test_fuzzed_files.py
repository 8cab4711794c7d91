"""Thousands of damaged and hostile files: each is refused by a typed error, or read as it should.

Every case runs with a gigabyte of memory, two seconds of processor time and a watchman: no other
error, no warning, nothing run, nothing written elsewhere, no array that is not finite.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from lengths import FULL

TESTS = Path(__file__).parents[1]
ALL_CASES = 300
CASES_A_READER = ALL_CASES if FULL else 100
GROUPS = {
    "meshes": ["ply text", "ply little", "obj", "off", "stl", "glb", "points"],
    "archives": ["basis", "latent npz", "latent csv", "model archive"],
    "pickles": ["model pickle", "model pickle, text"],
    "motions": ["dynamic faust", "amass, smpl-h", "amass, smpl-x"],
    "folders": ["labels", "classes", "index", "job"],
}

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="memory is bounded by the address space, as Linux counts it"
)


def fuzz(tmp_path, names, first, count):
    """Return the report of a process of its own, which may crash."""
    current = tmp_path / "current"
    arguments = [str(TESTS / "trust" / "fuzz.py"), *names, "--current", str(current)]
    arguments += ["--first", str(first), "--count", str(count)]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent)]),
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
    }
    done = subprocess.run(
        [sys.executable, *arguments],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    at_work = current.read_text() if current.exists() else "preparation"
    assert done.returncode == 0, f"ended with {done.returncode} at {at_work}: {done.stderr[-2000:]}"
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("group", GROUPS)
def test_damaged_files(group, tmp_path):
    report = fuzz(tmp_path, GROUPS[group], 0, CASES_A_READER)
    assert not report["problems"], "\n".join(report["problems"])
    for name, ends in report["ends"].items():
        assert sum(ends.values()) == CASES_A_READER
        assert min(ends.values()) > 0, f"{name}: {ends}"
    assert report["slowest"] < 2.0
    assert report["peak"] < 2**30


def test_a_careless_reader_is_convicted(tmp_path):
    problems = "\n".join(fuzz(tmp_path, ["careless"], 0, 300)["problems"])
    assert "os.system" in problems
    assert "pickle.find_class" in problems
    assert "MemoryError" in problems
