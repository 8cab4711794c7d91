"""Too little memory is said before a computation where it is foreseen, and else when it happens."""

import importlib
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.checks.memory import available_memory, check_memory, enough_memory, size_text
from riemhuman.errors import OutOfMemoryError
from riemhuman.kernels.compilation import Compiled
from riemhuman.optional import import_optional

# Bytes that copies of the bodies do not fit into.
_LEFT = 2**24

_LITTLE_MEMORY = """
import resource, sys, warnings
from pathlib import Path
import numpy as np
import riemhuman as rh

bodies = rh.datasets.load_open_bodies("coarse")
space = rh.AlignedSurfaces(bodies.template, equip=False)
space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=1.0)
few, many, metric = bodies.points[:4], np.concatenate([bodies.points] * 12), space.metric
names = [*bodies.subject] * 12
warping = rh.motions.DynamicTimeWarping(rh.SRNFMetric(space))
measurements = rh.measurements.Measurements(bodies.model)
basis = rh.DeformationBasis(np.eye(4, few[0].size).reshape(4, *few[0].shape))
doors = {
    "table": lambda points: metric.dist_pairwise(points),
    "features": lambda points: metric.features(points),
    "index": lambda points: rh.NearestNeighbors(metric, 1).fit(points),
    "path": lambda points: rh.solvers.BasisPath(basis, n_nodes=len(points)).solve(metric, *few[:2]),
    "mean": lambda points: rh.solvers.BasisMean(basis, max_iter=1).solve(metric, points),
    "components": lambda points: rh.TangentPCA(space, 1, mean=few[0]).fit(points),
    "logarithms": lambda points: metric.log(points, few[0]),
    "learned metric": lambda points: rh.LearnedMetric(metric).fit(points, names[: len(points)]),
    "deformations": lambda points: rh.DeformationBasis.from_motions([points], 1, 1),
    "alignment": lambda points: rh.procrustes(points, few[0]),
    "posing": lambda points: bodies.model(np.zeros((len(points), bodies.model.n_betas))),
    "measurements": lambda points: measurements.measure(points[:60], gradient=True),
    "motions": lambda points: warping.dist_pairwise([points, points]),
    "alignment of motions": lambda points: rh.motions.align_motions(
        rh.motions.MotionSpace(space, len(points)), points, points
    ),
}
warnings.simplefilter("ignore")
# Compilers of the system do not survive a lack of memory.
for name in ("table", "mean", "components", "logarithms", "motions"):
    doors[name](few)
measurements.measure(few[:1], gradient=True)
used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + int(sys.argv[1]), -1))
for name, door in doors.items():
    try:
        door(many)
        said = "nothing"
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
    print(f"{name}: {said}")
"""


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited")
def test_too_little_memory_is_said_at_every_door():
    finished = subprocess.run(
        [sys.executable, "-c", _LITTLE_MEMORY, str(_LEFT)],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert finished.returncode == 0, finished.stderr
    lines = finished.stdout.splitlines()
    assert len(lines) == 14
    for line in lines:
        _, _, said = line.partition(": ")
        assert said.startswith("OutOfMemoryError: memory is too short for "), line
        assert "Unable to allocate" in said, line
        remedy = said.rpartition("; ")[2].split()[0]
        assert remedy in ("compare", "ask", "pose", "pass", "measure", "take"), line


_FIRST_CALL = """
import resource
from pathlib import Path
import numpy as np
from scipy.linalg import lapack
from riemhuman.checks.memory import enough_memory

used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (used + 2**22, -1))
try:
    with enough_memory("a task", "use less"):
        np.linalg.inv(np.eye(3))
        lapack.dgetrf(np.eye(3))
except MemoryError as error:
    print(error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited")
def test_the_first_call_of_openblas_does_not_wait_for_memory():
    finished = subprocess.run(
        [sys.executable, "-c", _FIRST_CALL], capture_output=True, text=True, timeout=600
    )
    assert finished.returncode == 0, finished.stderr
    assert finished.stdout.startswith("memory is too short for a task (Unable to allocate")
    assert finished.stdout.endswith("; use less\n")


def many(template, n):
    return np.broadcast_to(template.vertices, (n, *template.vertices.shape))


def test_a_table_beyond_all_memory_is_refused_before_the_work(bodies):
    metric = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template, equip=False), 1.0, 1e-4, 0.0)
    points = many(bodies.template, 10**7)
    message = (
        r"a table of 10,000,000 × 10,000,000 distances needs 800\.\d TB .* left; .*pairwise_job"
    )
    with pytest.raises(OutOfMemoryError, match=message):
        metric.dist_pairwise(points)
    with pytest.raises(OutOfMemoryError, match="a table of 10,000,000 × 10,000,000 distances"):
        metric.cdist(points, points)


def test_other_needs_are_foreseen(bodies, monkeypatch):
    monkeypatch.setattr("riemhuman.checks.memory.available_memory", lambda: 2.0**25)
    metric = rh.SRNFMetric(rh.AlignedSurfaces(bodies.template, equip=False))
    points = many(bodies.template, 2500)
    with pytest.raises(
        OutOfMemoryError, match=r"the features of 2,500 points needs .*33\.6 MB are"
    ):
        metric.features(points)
    with pytest.raises(OutOfMemoryError, match=r"an index of 2,500 bodies needs"):
        rh.NearestNeighbors(metric, 1).fit(points)
    with pytest.raises(OutOfMemoryError, match=r"posing 2,500 bodies needs 144\.2 MB"):
        bodies.model(np.zeros((2500, bodies.model.n_betas)))
    with pytest.raises(OutOfMemoryError, match=r"a basis of 4,000 components needs"):
        rh.DeformationBasis.from_motions([points], 4000, 1)
    measurements = rh.measurements.Measurements(bodies.model)
    with pytest.raises(OutOfMemoryError, match=r"the derivatives of \d+ measurements of 20 bodies"):
        measurements.measure(bodies.points[:20], gradient=True)


def test_free_memory_is_known():
    left = available_memory()
    assert left > 2**26
    assert left < 2**50 or math.isinf(left)
    check_memory(0.0, "nothing")


def test_an_error_says_what_was_needed_and_what_to_do():
    def fail(error):
        with enough_memory("a mean", "use less"):
            raise error

    with pytest.raises(
        OutOfMemoryError, match=r"short for a mean \(8\.0 GiB\); use less"
    ) as caught:
        fail(MemoryError("8.0 GiB"))
    assert isinstance(caught.value, MemoryError)
    with pytest.raises(OutOfMemoryError, match="can't start new thread"):
        fail(RuntimeError("can't start new thread"))
    with pytest.raises(OutOfMemoryError, match="^said before$"):
        fail(OutOfMemoryError("said before"))
    with pytest.raises(RuntimeError, match="^another$"):
        fail(RuntimeError("another"))


def test_the_outermost_task_says_what_to_do(monkeypatch):
    inner = r"posing these bodies: 8\.0 GiB"
    message = rf"^memory is too short for a mean \({inner}\); use less$"
    with (
        pytest.raises(OutOfMemoryError, match=message) as caught,
        enough_memory("a mean", "use less"),
        enough_memory("a fit", "fit fewer"),
        enough_memory("posing these bodies", "pose fewer"),
    ):
        raise MemoryError("8.0 GiB")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.remedy) == (str(caught.value), "use less")

    def fail(*given):
        raise MemoryError("8.0 GiB")

    monkeypatch.setattr("riemhuman.bodies.body_model.skin_by", fail)
    for resolution, advice in (("full", "ask for resolution="), ("coarse", "give fewer")):
        message = rf"too short for a body from measurements \({inner}\); {advice}"
        with pytest.raises(OutOfMemoryError, match=message):
            rh.measurements.model_from_measurements({"stature": 1.7}, resolution=resolution)


@pytest.mark.parametrize(
    ("n_bytes", "text"),
    [(0, "0 bytes"), (999, "999 bytes"), (1500, "1.5 kB"), (8e9, "8.0 GB"), (2e19, "20000.0 PB")],
)
def test_sizes(n_bytes, text):
    assert size_text(n_bytes) == text


@pytest.mark.parametrize(
    "error",
    [
        ImportError("libopenblas.so: failed to map segment from shared object"),
        OSError("Could not load libllvmlite.so: cannot allocate memory in static TLS block"),
    ],
)
def test_imports_say_a_lack_of_memory(monkeypatch, error):
    """Neither an import that fails, nor a package that is not installed."""

    def fail(*given, **options):
        raise error

    with monkeypatch.context() as patch:
        patch.setattr(importlib, "import_module", fail)
        for load in (lambda: rh.__getattr__("plots"), lambda: import_optional("h5py", "data")):
            with pytest.raises(OutOfMemoryError, match=r"short for the import of .*; close other"):
                load()
    with monkeypatch.context() as patch:
        patch.setattr("numba.njit", fail)
        with pytest.raises(OutOfMemoryError, match=r"the import of numba \(.*; close other"):
            _ = Compiled(size_text, {"forceinline": True}).function
    with pytest.raises(OutOfMemoryError, match="short for a mean"), enough_memory("a mean"):
        raise error
    with pytest.raises(ImportError, match="another"), enough_memory("a mean"):
        raise ImportError("another")
