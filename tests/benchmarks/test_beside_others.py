"""The same work by this library and by what people would use instead, as the speed page's table.

    pytest tests/benchmarks/test_beside_others.py --benchmark-enable -s

prints milliseconds: the shortest of several runs in turns, in one process, on one thread of every
library, on the same data. Compiling and loading come before the clock starts. tslearn, dtaidistance
and meshio are no requirements: without one, its figure is missing and a line says so.
"""

import importlib

import numpy as np
import pytest
import trimesh
from performances import bodies, shortest
from sklearn.metrics import pairwise_distances
from threadpoolctl import threadpool_limits

import riemhuman as rh
from riemhuman.bodies import joint_motions, rotation_matrix

N_BODIES = 100


@pytest.fixture(autouse=True)
def one_thread():
    with threadpool_limits(1):
        yield


def optional(name):
    """Return a library that may be missing."""
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"\n{name} is not installed: its figure is missing")
        return None


def compared(benchmark, title, calls, rounds=5):
    """Print and return the shortest milliseconds of calls, ours first, which take turns."""
    for call in calls.values():
        call()
    seconds = shortest(*calls.values(), rounds=rounds)
    milliseconds = dict(zip(calls, 1e3 * seconds, strict=True))
    listed = "; ".join(f"{name} {value:.3g}" for name, value in milliseconds.items())
    print(f"\n{title}, ms: {listed}")
    if not benchmark.stats:
        benchmark.pedantic(next(iter(calls.values())), rounds=1)
    return milliseconds


def by_product(rows):
    """Return distances of rows by ‖a‖² + ‖b‖² − 2 ⟨a, b⟩, which loses the digits of close pairs."""
    squares = np.einsum("ij,ij->i", rows, rows)
    return np.sqrt(np.maximum(squares[:, None] + squares - 2.0 * (rows @ rows.T), 0.0))


def by_differences(rows):
    """Return distances of rows by NumPy, one row against the later ones."""
    distances = np.zeros((len(rows), len(rows)))
    for i, row in enumerate(rows):
        distances[i, i + 1 :] = np.linalg.norm(rows[i + 1 :] - row, axis=1)
    return distances + distances.T


@pytest.mark.parametrize("resolution", ["coarse", "full"])
def test_flat_metrics_in_bulk(benchmark, resolution):
    """SRNF, of which the distance of two bodies is that of two vectors: features in float32."""
    points = bodies(resolution).points[:N_BODIES]
    metric = rh.SRNFMetric(rh.AlignedSurfaces(bodies(resolution).template, equip=False))
    features = metric.features(points, "single")
    rows = features[0].reshape(len(points), -1)
    pairs = np.triu_indices(len(points), 1)
    exact = metric.dist_pairwise(points)[pairs]
    np.testing.assert_allclose(by_product(rows)[pairs], exact, rtol=1e-3)
    np.testing.assert_allclose(by_differences(rows)[pairs], exact, rtol=1e-6)
    errors = np.abs(by_product(rows)[pairs] / exact - 1.0)
    print(f"\none product is off by {errors.max():.1e} of a distance at most")
    compared(
        benchmark,
        f"all pairs of {len(points)} bodies, SRNF in float32, {resolution}",
        {
            "riemhuman": lambda: np.sqrt(metric.bulk.squared_distances(features, features)),
            "one product (BLAS)": lambda: by_product(rows),
            "scikit-learn": lambda: pairwise_distances(rows),
            "NumPy": lambda: by_differences(rows),
        },
    )


def test_time_warping(benchmark):
    """Twelve motions of 20 to 60 frames in SRNF; the others get vectors, ours prepares frames.

    Each has the weights of steps that it has by default, which change results, not the work.
    """
    motions = [
        np.asarray(motion[: 20 + 40 * k // 11])
        for k, motion in enumerate(rh.datasets.load_open_motions("coarse")[:12])
    ]
    template = rh.datasets.load_open_motions("coarse")[0].template
    metric = rh.SRNFMetric(rh.AlignedSurfaces(template, equip=False))
    warping = rh.motions.DynamicTimeWarping(metric, heading=True)
    series = []
    for motion in motions:
        features = metric.features(motion, "double")[0]
        series.append(np.ascontiguousarray(features.reshape(len(motion), -1)))
    calls = {"riemhuman, from vertices": lambda: warping.dist_pairwise(motions)}
    if tslearn := optional("tslearn.metrics"):
        calls["tslearn, from features"] = lambda: tslearn.cdist_dtw(series)
    if dtaidistance := optional("dtaidistance.dtw_ndim"):
        calls["dtaidistance (C), from features"] = lambda: dtaidistance.distance_matrix_fast(
            series, parallel=False
        )
    found = compared(benchmark, "time warping, all pairs of 12 motions, float64", calls, rounds=2)
    assert min(found, key=found.__getitem__).startswith("riemhuman")


def blended(model, betas, pose):
    """Return posed bodies by dense linear blend skinning, as papers write it, in NumPy."""
    shaped = model.template.vertices + np.tensordot(betas, model.shapedirs, axes=(1, 2))
    joints = model.joint_regressor @ shaped
    rotations, positions = joint_motions(joints, rotation_matrix(pose), model.parents)
    shifts = positions - (rotations @ joints[..., None])[..., 0]
    motions = np.concatenate([rotations, shifts[..., None]], axis=-1)
    blends = np.tensordot(model.weights, motions, axes=(1, 1))  # (V, n, 3, 4)
    return np.einsum("vnij,nvj->nvi", blends[..., :3], shaped) + blends[..., 3].swapaxes(0, 1)


@pytest.mark.parametrize("resolution", ["coarse", "full"])
def test_posing(benchmark, resolution):
    model, rng = bodies(resolution).model, np.random.default_rng(0)
    betas = rng.normal(size=(50, model.n_betas))
    pose = rng.normal(scale=0.3, size=(50, model.n_joints, 3))
    np.testing.assert_allclose(model(betas, pose), blended(model, betas, pose), atol=1e-13)
    found = compared(
        benchmark,
        f"posing 50 bodies, float64, {resolution}",
        {
            "riemhuman": lambda: model(betas, pose),
            "dense blending in NumPy": lambda: blended(model, betas, pose),
        },
    )
    assert found["riemhuman"] < found["dense blending in NumPy"]


def test_girths(benchmark):
    """All girths of one full body, against as many sections of trimesh at fixed heights."""
    body = bodies("full")
    measurements = rh.measurements.Measurements(body.model)
    girths = [name for name in measurements.names if "circumference" in name or "girth" in name]
    some = rh.measurements.Measurements(body.model, girths)
    mesh = trimesh.Trimesh(body.points[0], body.template.faces, process=False)
    low, high = mesh.bounds[:, 1]
    heights = np.linspace(low + 0.05, high - 0.05, len(girths))

    def sections():
        return [mesh.section(plane_normal=[0, 1, 0], plane_origin=[0, h, 0]) for h in heights]

    one = body.points[:1]
    compared(
        benchmark,
        f"{len(girths)} girths of a full body",
        {
            "riemhuman": lambda: some.measure(one),
            "sections of trimesh": lambda: [path.length for path in sections()],
        },
        rounds=3,
    )


@pytest.mark.parametrize("suffix", ["ply", "obj", "off", "glb"])
def test_reading(benchmark, tmp_path, suffix):
    file = tmp_path / f"body.{suffix}"
    rh.save_mesh(file, bodies("full")[0], bodies("full").template.faces)
    calls = {
        "riemhuman": lambda: rh.load_mesh(file),
        "trimesh": lambda: trimesh.load(file, process=False),
    }
    meshio = optional("meshio") if suffix != "glb" else None
    if meshio:
        calls["meshio"] = lambda: meshio.read(file)
    compared(benchmark, f"reading a full body, {suffix}", calls, rounds=10)
