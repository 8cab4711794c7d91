"""Processor time of commands: the first run on a machine, which compiles, and the next ones.

pytest tests/benchmarks/test_first_runs.py --benchmark-enable -s
"""

import os
import resource
import subprocess
import sys

import pytest

from riemhuman.cli import main

COMMANDS = {
    "info": ["info", "anna.ply"],
    "dist": ["dist", "anna.ply", "ben.ply"],
    "matrix": ["matrix", "bodies", "-o", "distances.npz", "--force"],
    "retrieve": ["retrieve", "bodies/anna_wave.ply", "bodies"],
    "geodesic": ["geodesic", "sit.ply", "stand.ply", "-o", "path.npz", "--force"],
    "fit": ["fit", "anna.ply", "-o", "fit.npz", "--force"],
    "measure": ["measure", "anna.ply"],
    "register": ["register", "scans/anna.ply", "-o", "body.ply", "--force"],
}


def processor_seconds(arguments, folder, cache):
    """Return the seconds of processor time of a command in a fresh process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "riemhuman", *arguments],
        cwd=folder,
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        check=True,
    )
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


@pytest.mark.skipif(sys.platform == "win32", reason="processor time is asked otherwise there")
@pytest.mark.parametrize("name", COMMANDS)
def test_first_and_later_runs(benchmark, name, tmp_path):
    folder = tmp_path / "people"
    assert main(["examples", str(folder), "-q"]) == 0
    first = processor_seconds(COMMANDS[name], folder, tmp_path / "cache")
    later = [processor_seconds(COMMANDS[name], folder, tmp_path / "cache") for _ in range(3)]
    print(f"\n{name}: the first run {first:.1f} s of processor time, later ones {min(later):.2f} s")
    benchmark.pedantic(lambda: None)
    assert min(later) < 1.05 * first
