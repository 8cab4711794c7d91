"""Jobs on disk: all pairs of 10,000 bodies made on the fly, within 2 GiB of memory.

    pytest tests/benchmarks/test_jobs.py --benchmark-enable -s

prints, for the metrics of poses and of shapes, the time of the job, its disk space and the peak of
its resident memory at coarse resolution; the same for 600 bodies at full resolution; and what that
makes for larger sets.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

SUPPORT = Path(__file__).parents[1] / "support"
ROOT = Path(__file__).parents[2]
METRICS = {"pose": (0.0, 0.0, 1.0), "shape": (1.0, 1e-4, 0.0)}

# In a process of its own, whose peak of memory is the job's.
SCRIPT = f"""
import sys, time
sys.path[:0] = {[str(SUPPORT), str(ROOT)]!r}
import numpy as np
from people_in_motion import PeopleInMotion
from riemhuman.geometry import AlignedSurfaces
from riemhuman.geometry import ElasticMetric
from riemhuman.retrieval import pairwise_job
from riemhuman.io.job_folder import JobFolder

folder, n_bodies, resolution, n_jobs, *weights = sys.argv[1:]
bodies = PeopleInMotion(int(n_bodies), resolution)
metric = ElasticMetric(AlignedSurfaces(bodies.model.template), *map(float, weights))
metric.dist_pairwise(bodies[:2])  # compiles, where nothing is cached yet
n_bytes, laid_out = [0], JobFolder.make_tables

def measured(job, tables):
    laid_out(job, tables)
    n_bytes[0] = sum(file.stat().st_blocks * 512 for file in job.path.iterdir())

JobFolder.make_tables = measured
first_tile, write = [], JobFolder.write

def timed(job, name, *entries):
    if name.startswith("D."):
        first_tile.append(time.perf_counter())
    write(job, name, *entries)

JobFolder.write = timed
begin = time.perf_counter()
pairwise_job(metric, bodies, folder, n_jobs=int(n_jobs))
end = time.perf_counter()
status = open("/proc/self/status").read().split()
print(end - begin, end - first_tile[0], len(first_tile), n_bytes[0],
      1024 * int(status[status.index("VmHWM:") + 1]))
"""


def run(folder, n_bodies, resolution, metric):
    """Return seconds in all and of all tiles but the first, their number, disk and memory."""
    arguments = [folder, n_bodies, resolution, 2, *METRICS[metric]]
    command = [sys.executable, "-c", SCRIPT, *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, encoding="utf-8")
    assert result.returncode == 0, result.stderr
    return map(float, result.stdout.split())


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of memory is read from /proc")
@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("resolution", ["coarse", "full"])
def test_all_pairs_on_disk(benchmark, metric, resolution, tmp_path):
    n_bodies = {"coarse": 10_000, "full": 600}[resolution]
    seconds, of_tiles, n_tiles, n_bytes, memory = benchmark.pedantic(
        run, (tmp_path / "job", n_bodies, resolution, metric), rounds=1
    )
    distances = np.load(tmp_path / "job" / "D.npy", mmap_mode="r")
    n_pairs = n_bodies * (n_bodies - 1) // 2
    share = max(1.0, n_tiles - 1) / n_tiles
    a_pair = of_tiles / (n_pairs * share)
    a_body = (n_bytes - 8 * n_bodies**2) / n_bodies
    days = 100_000**2 / 2 * a_pair / 86_400
    print(
        f"\n{metric} of {n_bodies} {resolution} bodies, two threads: {seconds:.1f} s, "
        f"{1e6 * a_pair:.2f} µs a pair; {n_bytes / 2**30:.2f} GiB of disk, "
        f"{a_body / 1e3:.0f} kB a body and 8 bytes an entry; {memory / 2**30:.2f} GiB of memory; "
        f"100,000 such bodies: {days:.2g} days, {(1e5 * a_body + 8e10) / 1e9:.0f} GB of disk"
    )
    assert distances.shape == (n_bodies, n_bodies)
    assert memory < 2 * 2**30
