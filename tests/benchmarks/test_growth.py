"""How time and memory grow with bodies, triangles, frames and threads, and on a cluster.

    pytest tests/benchmarks/test_growth.py --benchmark-enable -s

prints one table. Every row is measured in a process of its own, after a small run that compiles.
Exponents are from one row to the next; memory is what the work adds at its peak.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from people_in_motion import PeopleInMotion
from performances import bodies, clocked, growth

import riemhuman as rh
import riemhuman.retrieval.jobs

RECORDING = Path(__file__).parents[1] / "mocap" / "recordings" / "cmu_01_01.bvh"
SUPPORT = Path(__file__).parents[1] / "support"
N_PAIRED, N_FRAMES_AT_A_TIME = 20, 1000
N_ON_CLUSTER = 1500

SIZES = {
    "bodies": (100, 300, 1000, 3000, 10_000),
    "subdivisions": (0, 1, 2, 3, 4),
    "frames": (100, 1000, 10_000, 50_000),
    "warped frames": (100, 300, 1000, 3000),
}


def pose_metric(template):
    return rh.ElasticMetric(rh.AlignedSurfaces(template), a=0.0, lam=0.0, c=1.0)


def subdivided(points, faces):
    """Return points (n, V, 3) and triangles with the middles of all edges as new vertices."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    ends, numbers = np.unique(edges, axis=0, return_inverse=True)
    first, second, third = (numbers.reshape(-1, 3) + points.shape[1]).T
    a, b, c = faces.T
    corners = [(a, first, third), (b, second, first), (c, third, second), (first, second, third)]
    middles = 0.5 * (points[:, ends[:, 0]] + points[:, ends[:, 1]])
    new_faces = np.concatenate([np.stack(corner, axis=1) for corner in corners])
    return np.concatenate([points, middles], axis=1), new_faces


def all_pairs(n_bodies, n_threads):
    """Return what compares all pairs of coarse bodies, by pose."""
    people = PeopleInMotion(n_bodies)
    points, metric = people[:], pose_metric(people.model.template)
    metric.dist_pairwise(points[:20], n_jobs=n_threads)
    return n_bodies, lambda: metric.dist_pairwise(points, n_jobs=n_threads)


def finer_pairs(n_subdivisions, n_threads):
    """Return what compares all pairs of 20 bodies, coarse ones after so many subdivisions."""
    points, faces = bodies("coarse").points[:N_PAIRED], bodies("coarse").template.faces
    for _ in range(n_subdivisions):
        points, faces = subdivided(points, faces)
    metric = pose_metric(rh.Template(points[0], faces))
    metric.dist_pairwise(points[:2], n_jobs=n_threads)
    return len(faces), lambda: metric.dist_pairwise(points, n_jobs=n_threads)


def long_recording(n_frames, n_threads):
    """Return what retargets a recording of so many frames and poses a body in every one."""
    recording = rh.datasets.load_bvh(RECORDING)
    there_and_back = np.r_[: len(recording), len(recording) : 0 : -1] % len(recording)
    frames = np.resize(there_and_back, n_frames)

    def perform(frames):
        long = rh.datasets.SkeletonMotion(
            recording.joint_names,
            recording.parents,
            recording.offsets,
            recording.rotations[frames],
            recording.translations[frames],
            recording.frames_per_second,
            unit=recording.unit,
        )
        motion = rh.datasets.retarget(long)
        for first in range(0, len(motion), N_FRAMES_AT_A_TIME):
            motion[first : first + N_FRAMES_AT_A_TIME]

    perform(frames[:100])
    return n_frames, lambda: perform(frames)


def warped(n_frames, n_threads):
    """Return what matches two motions of so many frames each."""
    motions = rh.datasets.load_open_motions("coarse", sequences=["knees", "hips"])
    metric = pose_metric(motions[0].template)
    pair = [
        motion[:][np.linspace(0, len(motion) - 1, n_frames).round().astype(int)]
        for motion in (motions[0], motions[1])
    ]
    measure = rh.motions.DynamicTimeWarping(metric, n_jobs=n_threads)
    measure.dist(pair[0][:10], pair[1][:10])
    return n_frames, lambda: measure.dist(*pair)


WORK = {
    "bodies": all_pairs,
    "subdivisions": finer_pairs,
    "frames": long_recording,
    "warped frames": warped,
}
TITLES = {
    "bodies": "all pairs of bodies",
    "subdivisions": "all pairs of 20 bodies, triangles each",
    "frames": "performing and posing, frames",
    "warped frames": "time warping of two motions, frames each",
}
# Performing uses threads by itself, and a single pair of motions is warped by one.
THREADED = ("bodies", "subdivisions")


def memory_of(field):
    """Return a field of this process' memory, bytes."""
    words = Path("/proc/self/status").read_text().split()
    return 1024 * int(words[words.index(f"{field}:") + 1])


def measure(kind, size, n_threads):
    """Print size, seconds, processor seconds and peak bytes of one piece of work."""
    size, work = WORK[kind](size, n_threads)
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins here
    before = memory_of("VmRSS")
    _, wall, processor = clocked(work)
    print(size, wall, processor, memory_of("VmHWM") - before)


def measured(kind, size, n_threads):
    """Return what `measure` prints in a process of its own."""
    command = [sys.executable, __file__, kind, str(size), str(n_threads)]
    environment = os.environ | {"PYTHONPATH": str(SUPPORT)}
    result = subprocess.run(command, capture_output=True, encoding="utf-8", env=environment)
    assert result.returncode == 0, result.stderr
    size, wall, processor, memory = map(float, result.stdout.split())
    return int(size), wall, processor, memory


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of memory is read from /proc")
def test_growth():
    """Exponents are those of the processor time of one thread."""
    rows = [
        "| work | size | s, one thread | s, two | processor s | exponent | MB |",
        "|---|---|---|---|---|---|---|",
    ]
    exponents = {}
    for kind, sizes in SIZES.items():
        done = []
        for size_asked in sizes:
            size, wall, processor, memory = measured(kind, size_asked, 1)
            wall_of_two = f"{measured(kind, size_asked, 2)[1]:.2g}" if kind in THREADED else "-"
            done.append((size, processor))
            exponent = "-"
            if len(done) > 1:
                exponents[kind] = growth(*np.transpose(done[-2:]))
                exponent = f"{exponents[kind]:.2f}"
            title = TITLES[kind] if len(done) == 1 else ""
            rows.append(
                f"| {title} | {size:,} | {wall:.2g} | {wall_of_two} | {processor:.2g} | "
                f"{exponent} | {memory / 1e6:.0f} |"
            )
    print("\n" + "\n".join(rows))
    assert exponents["bodies"] < 2.3
    assert exponents["subdivisions"] < 1.5
    assert exponents["frames"] < 1.2
    assert exponents["warped frames"] < 2.3


def killing(compute, pid, number):
    """Return what computes the parts of a job, and kills a worker after so many of them."""

    def compute_parts(*arguments):
        for count, values in enumerate(compute(*arguments)):
            if count == number:
                os.kill(pid, signal.SIGKILL)
            yield values

    return compute_parts


def test_cluster(tmp_path, monkeypatch):
    """One process, a job, and two workers of Dask, both of which are killed in the last row."""
    distributed = pytest.importorskip("distributed")
    people = PeopleInMotion(N_ON_CLUSTER)
    points, metric = people[:], pose_metric(people.model.template)
    metric.dist_pairwise(points[:20])
    expected, seconds, _ = clocked(lambda: metric.dist_pairwise(points))
    rows = [("at once", seconds, expected)]
    table, seconds, _ = clocked(lambda: rh.pairwise_job(metric, points, tmp_path / "job"))
    rows.append(("a job", seconds, table))
    compute = riemhuman.retrieval.jobs.compute_parts
    for name in ("two workers", "two workers, one killed at the start, the other later"):
        with (
            distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
            ) as cluster,
            distributed.Client(cluster) as client,
        ):
            first, second = client.run(os.getpid).values()
            if "killed" in name:
                monkeypatch.setattr(
                    riemhuman.retrieval.jobs, "compute_parts", killing(compute, second, 3)
                )
            start = time.perf_counter()
            if "killed" in name:
                os.kill(first, signal.SIGKILL)
            table = rh.pairwise_job(
                metric, points, tmp_path / f"job {len(rows)}", memory=2**25, client=client
            )
            rows.append((name, time.perf_counter() - start, table))
    print(f"\n| all pairs of {N_ON_CLUSTER} coarse bodies | s | over one process |\n|---|---|---|")
    for name, seconds, table in rows:
        print(f"| {name} | {seconds:.1f} | {seconds / rows[0][1]:.2f} |")
        np.testing.assert_array_equal(table, expected)


if __name__ == "__main__":
    measure(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
