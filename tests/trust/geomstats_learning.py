"""Learning classes of geomstats on surfaces, with strategies filled in: `bash .ci/oracles`."""

import os

os.environ.setdefault("GEOMSTATS_BACKEND", "autograd")

import numpy as np
import pytest
import trimesh
from cases import deformations, surfaces
from geomstats.learning.frechet_mean import FrechetMean
from geomstats.learning.geodesic_regression import GeodesicRegression
from geomstats.learning.pca import TangentPCA

import riemhuman as rh


@pytest.fixture(scope="module")
def space():
    mesh = trimesh.creation.icosahedron()
    template = rh.Template(np.asarray(mesh.vertices) * [0.5, 0.9, 0.4], np.asarray(mesh.faces))
    return rh.AlignedSurfaces(template).equip_with_metric(
        rh.ElasticMetric,
        a=1.0,
        lam=1.0,
        c=1.0,
        geodesic_solver=rh.solvers.PathStraightening(3),
        exp_solver=rh.solvers.DiscreteExponential(n_steps=2),
        log_solver=rh.solvers.DiscreteLogarithm(n_steps=2),
    )


@pytest.fixture(scope="module")
def points(space):
    """Return three clusters of four surfaces."""
    centers = surfaces(space.template, 3, rng=3)
    noise = [0.05 * deformations(space.template, 4, rng=k + 5) for k in range(3)]
    return np.concatenate([center + each for center, each in zip(centers, noise, strict=True)])


def test_means(space, points):
    theirs = FrechetMean(space).set(max_iter=10, epsilon=1e-8).fit(points[:4]).estimate_
    logs = space.metric.log(points[:4], theirs)
    sizes = space.metric.norm(logs, theirs)
    assert space.metric.norm(logs.mean(axis=0), theirs) < 1e-2 * sizes.min()


def test_principal_components(space, points):
    """Theirs are of the logarithms' coordinates."""
    found = TangentPCA(space, 2).fit(points[:4], base_point=points[0])
    logs = space.metric.log(points[:4], points[0]).reshape(4, -1)
    values = np.linalg.svd(logs - logs.mean(axis=0), compute_uv=False) ** 2 / 3.0
    np.testing.assert_allclose(found.explained_variance_, values[:2], rtol=1e-9)


@pytest.mark.parametrize("method", ["extrinsic", "riemannian"])
def test_geodesic_regression(method):
    """It differentiates through `exp`; on a surface of 18 units, for steps of one unit."""
    mesh = trimesh.creation.icosahedron()
    template = rh.Template(np.asarray(mesh.vertices) * [5.0, 9.0, 4.0], np.asarray(mesh.faces))
    space = rh.AlignedSurfaces(template).equip_with_metric(
        rh.ElasticMetric,
        a=0.1,
        lam=1.0,
        c=0.1,
        exp_solver=rh.solvers.DiscreteExponential(n_steps=2),
        transport_solver=rh.solvers.PoleLadder(),
    )
    metric, times = space.metric, np.array([-1.0, 0.0, 1.0])
    start = surfaces(template, 1, rng=3)[0]
    velocity, noise = deformations(template, 2, rng=5)
    velocity *= 0.9 / np.linalg.norm(velocity)
    noise *= 0.3 / np.linalg.norm(noise)
    points = metric.exp(times[:, None, None] * velocity, start)
    found = GeodesicRegression(
        space,
        center_X=False,
        method=method,
        initialization=(start + noise, 0.5 * velocity),
        compute_training_score=True,
    )
    if method == "extrinsic":
        found.set(autodiff_jac=True, options={"maxiter": 8})
    else:
        found.set(max_iter=12)
    found.fit(times, points)
    assert found.training_score_ > 0.97
    assert metric.dist(found.predict(times[2:])[0], points[2]) < 0.3 * metric.norm(velocity, start)
