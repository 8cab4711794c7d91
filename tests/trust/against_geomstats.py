"""geomstats as an oracle, in an environment of its own: `python .ci/jobs.py oracles`.

Its elastic metric, its spheres and matrices, its path straightening, and its learning classes run
unchanged on the spaces of this library. It needs an older NumPy than the newest, which is why it
is not collected with the other tests.
"""

import os

os.environ.setdefault("GEOMSTATS_BACKEND", "autograd")

import numpy as np
import pytest
import trimesh
from cases import TEMPLATES, deformations, surfaces
from geomstats.geometry.discrete_surfaces import DiscreteSurfaces
from geomstats.geometry.discrete_surfaces import ElasticMetric as SobolevMetric
from geomstats.geometry.hypersphere import Hypersphere
from geomstats.learning.frechet_mean import FrechetMean
from geomstats.learning.geometric_median import GeometricMedian
from geomstats.learning.kmeans import RiemannianKMeans
from geomstats.learning.mdm import RiemannianMinimumDistanceToMean
from geomstats.learning.pca import TangentPCA
from geomstats.numerics.geodesic import PathStraightening

import riemhuman as rh
from riemhuman.solvers.means import GradientDescentMean

EBIN_WEIGHTS = [(1.0, 1e-4), (2.0, 0.05), (1.0, 0.5), (1.0, 1.0), (0.3, 10.0)]
NO_WEIGHTS = dict.fromkeys(("a0", "a1", "b1", "c1", "d1", "a2"), 0.0)


def sobolev_term(name, faces, h, k, f):
    """Return one term of their inner product, of weight 1, with its first order alone.

    They take finite differences of g and of the normals over the whole of h: a linear part plus a
    quadratic one, which is even in h. What is odd in both h and k is the exact inner product.
    """
    inner_product = SobolevMetric(
        DiscreteSurfaces(np.asarray(faces)), **{**NO_WEIGHTS, name: 1.0}
    ).inner_product
    signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    return sum(s * t * inner_product(s * h, t * k, f) for s, t in signs) / 4.0


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize(("a", "lam"), EBIN_WEIGHTS)
@pytest.mark.parametrize("name", TEMPLATES)
def test_elastic_inner_product(name, a, lam, seed):
    """Their a₁ tr((g⁻¹δg)²) + b₁ tr(g⁻¹δg)² is the Ebin metric for a₁ = a, b₁ = a(λ − ½).

    They integrate over parallelograms, twice the area of the triangles.
    """
    template = TEMPLATES[name]()
    f = surfaces(template, 1, rng=seed)[0]
    h, k = deformations(template, 2, rng=100 + seed)
    shear, area = (sobolev_term(term, template.faces, h, k, f) for term in ("a1", "b1"))
    expected = a * (shear + (lam - 0.5) * area) / 2.0
    ours = rh.ElasticMetric(rh.AlignedSurfaces(template), a, lam, 0.0)
    scale = ours.norm(h, f) * ours.norm(k, f)
    assert ours.inner_product(h, k, f) == pytest.approx(expected, rel=1e-12, abs=1e-13 * scale)


EQUAL_AREAS = {
    "icosahedron": trimesh.creation.icosahedron,
    "triangle": lambda: trimesh.Trimesh([[0, 0, 0], [0.7, 0, 0.1], [0.2, 0.9, -0.3]], [[0, 1, 2]]),
}


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("name", EQUAL_AREAS)
def test_normal_inner_product(name, seed):
    """Their normals N = A n have the length of the area A: ⟨δN, δN⟩ = A²⟨δn, δn⟩ + δA².

    With δA = ½A tr(g⁻¹δg), and all triangles of one area at the template itself, what is left of
    their c₁ term without that of b₁ is 2A² times our metric of normals.
    """
    mesh = EQUAL_AREAS[name]()
    template = rh.Template(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    f, (h, k) = template.vertices, deformations(template, 2, rng=seed)
    square = template.face_areas[0] ** 2
    bending, area = (sobolev_term(term, template.faces, h, k, f) for term in ("c1", "b1"))
    expected = (bending - square / 4.0 * area) / (2.0 * square)
    ours = rh.ElasticMetric(rh.AlignedSurfaces(template), 0.0, 0.0, 1.0)
    scale = ours.norm(h, f) * ours.norm(k, f)
    assert ours.inner_product(h, k, f) == pytest.approx(expected, rel=1e-11, abs=1e-12 * scale)


def test_normal_fields_are_spheres():
    template = TEMPLATES["sphere"]()
    space, sphere = rh.NormalFields(template), Hypersphere(2).metric
    x, y = space.random_point(2, rng=1)
    v, w = space.random_tangent_vec(x, 2, rng=2)
    expected = np.sum(template.face_areas * sphere.squared_dist(x, y))
    assert space.metric.squared_dist(x, y) == pytest.approx(expected, rel=1e-12)
    np.testing.assert_allclose(space.metric.exp(v, x), sphere.exp(v, x), atol=1e-12)
    np.testing.assert_allclose(space.metric.log(y, x), sphere.log(y, x), atol=1e-9)
    np.testing.assert_allclose(
        space.metric.parallel_transport(w, x, direction=v),
        sphere.parallel_transport(w, x, direction=v),
        atol=1e-12,
    )


@pytest.mark.parametrize(("lam", "seed"), [(1.0, 7), (2.0, 6)])
def test_path_straightening(lam, seed):
    """Theirs knows the inner product alone, and finds the geodesic that we have in closed form.

    A single triangle takes every metric of Met(T), so its paths are as short as those of Met(T).
    Their discrete energy may fall below that of any path: a long step along an infinitesimal
    rotation costs nothing and makes the triangle larger. For these pairs that does not happen.
    """
    template = TEMPLATES["triangle"]()
    space = rh.AlignedSurfaces(template).equip_with_metric(rh.ElasticMetric, a=1.0, lam=lam, c=0.0)
    start, end = surfaces(template, 2, rng=seed, size=0.3)
    path = PathStraightening(space, n_nodes=31).discrete_geodesic_bvp(end, start)
    straight = start + np.linspace(0.0, 1.0, 31)[:, None, None] * (end - start)
    distance, longer = space.metric.dist(start, end), space.metric.length(straight)
    assert space.metric.length(path) - distance < 1e-3 * (longer - distance)
    fields = space.metric_field(path)
    target = rh.MetricFields(template).equip_with_metric(rh.EbinMetric, lam=lam).metric
    expected = target.geodesic(fields[0], fields[-1])(np.linspace(0.0, 1.0, 31))
    np.testing.assert_allclose(fields, expected, atol=2e-3 * np.abs(expected).max())


def spaces():
    """Return metric fields, normal fields and their product, whose points are vectors."""
    template = TEMPLATES["open"]()
    metric_fields = rh.MetricFields(template).equip_with_metric(rh.EbinMetric, lam=1.0)
    normal_fields = rh.NormalFields(template)
    return [
        pytest.param(metric_fields, id="metric fields"),
        pytest.param(normal_fields, id="normal fields"),
        pytest.param(rh.ProductManifold([metric_fields, normal_fields]), id="product"),
    ]


every_space = pytest.mark.parametrize("space", spaces())
LABELS = np.repeat([0, 1, 2], 6)


def clusters(space, size=0.15, rng=0):
    """Return three clusters of six points."""
    centers = np.repeat(space.random_point(3, rng=rng), 6, axis=0)
    return space.metric.exp(size * space.random_tangent_vec(centers, rng=rng + 1), centers)


def one_by_one(points):
    """Return the three clusters, shape (3, 6, *shape)."""
    return points.reshape(3, 6, *points.shape[1:])


def our_mean(space, points, weights=None):
    solver = GradientDescentMean(tolerance=1e-12, max_iter=500)
    return rh.FrechetMean(space, solver).fit(points, weights=weights)


@every_space
@pytest.mark.parametrize("method", ["default", "adaptive"])
@pytest.mark.parametrize("weighted", [False, True])
def test_frechet_mean(space, method, weighted):
    points = clusters(space, 0.3)[:6]
    weights = np.arange(1.0, 7.0) if weighted else None
    theirs = FrechetMean(space, method=method).set(max_iter=200, epsilon=1e-16)
    mean = theirs.fit(points, weights=weights).estimate_
    np.testing.assert_allclose(mean, our_mean(space, points, weights).estimate_, atol=1e-6)


@every_space
def test_k_means(space):
    points = clusters(space)
    found = RiemannianKMeans(space, 3, init=points[[0, 6, 12]], tol=1e-6).fit(points)
    np.testing.assert_array_equal(found.labels_, LABELS)
    np.testing.assert_array_equal(found.predict(points), LABELS)
    means = [our_mean(space, cluster) for cluster in one_by_one(points)]
    expected = sum(6 * mean.variance_ for mean in means)
    assert found.inertia_ == pytest.approx(expected, rel=1e-3)


# Learning classes on surfaces, with strategies filled in.


def test_mean_of_surfaces():
    mesh = trimesh.creation.icosahedron()
    template = rh.Template(np.asarray(mesh.vertices) * [0.5, 0.9, 0.4], np.asarray(mesh.faces))
    space = rh.AlignedSurfaces(template).equip_with_metric(
        rh.ElasticMetric,
        a=1.0,
        lam=1.0,
        c=1.0,
        geodesic_solver=rh.solvers.PathStraightening(3),
        exp_solver=rh.solvers.DiscreteExponential(n_steps=2),
        log_solver=rh.solvers.DiscreteLogarithm(n_steps=2),
    )
    metric = space.metric
    points = surfaces(template, 1, rng=3) + 0.05 * deformations(template, 4, rng=5)
    mean = FrechetMean(space).set(max_iter=10, epsilon=1e-8).fit(points).estimate_
    logs = metric.log(points, mean)
    assert metric.norm(logs.mean(axis=0), mean) < 1e-2 * metric.norm(logs, mean).min()


@pytest.mark.parametrize("fields", [rh.NormalFields, rh.MetricFields])
def test_their_learning_runs_on_fields_far_apart(fields):
    space = fields(TEMPLATES["sphere"]())
    points = space.random_point(9, rng=3)
    classes = np.arange(9) % 2
    assert space.belongs(GeometricMedian(space).fit(points).estimate_)
    found = RiemannianMinimumDistanceToMean(space).fit(points, classes).predict(points)
    assert set(found) <= {0, 1}
    if fields is rh.MetricFields:
        with pytest.raises(ValueError, match="too many values to unpack"):
            TangentPCA(space, n_components=2).fit(points)
