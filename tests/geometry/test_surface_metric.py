"""The compiled and sparse forms of metrics on surfaces agree with their definitions."""

import pickle
from functools import partial

import numpy as np
import pytest
from autograd import grad, hessian_vector_product, value_and_grad
from autograd.core import primitive_vjps
from cases import deformations, sphere_template, surfaces
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric, SRNFMetric

SPACE = AlignedSurfaces(sphere_template(2), equip=False)
METRICS = {
    "shape": ElasticMetric(SPACE, 1.0, 1e-4, 0.0),
    "stretch": ElasticMetric(SPACE, 1.0, 1.0, 0.0),
    "pose": ElasticMetric(SPACE, 0.0, 0.0, 1.0),
    "mixed": ElasticMetric(SPACE, 1.0, 0.1, 0.3),
    "srnf": SRNFMetric(SPACE),
}
each_metric = pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)


def wavy_path(size, n_times=5):
    """Return a path whose steps are of a given size, so that every branch of the loops runs."""
    return surfaces(SPACE.template, 1, rng=8)[0] + size * deformations(
        SPACE.template, n_times, rng=9
    )


@each_metric
@pytest.mark.parametrize("size", [1e-9, 1e-4, 0.03, 0.3, 1.0])
def test_compiled_energy_agrees_with_the_definition(metric, size):
    path = wavy_path(size)
    energy, gradient = metric.energy_and_gradient(path)
    expected, expected_gradient = value_and_grad(partial(RiemannianMetric.energy, metric))(path)
    # Differences of nearly equal surfaces carry the rounding error of the surfaces.
    tolerance = max(1e-10, 1e-14 / size)
    assert energy == pytest.approx(expected, rel=tolerance)
    error = np.abs(gradient - expected_gradient).max()
    assert error <= tolerance * np.abs(expected_gradient).max()


@each_metric
def test_compiled_gradient_has_taylor_slope_two(metric):
    path, direction = wavy_path(0.2), deformations(SPACE.template, 5, rng=10)
    energy, gradient = metric.energy_and_gradient(path)
    steps = np.array([1e-3, 1e-4])
    remainders = [
        abs(
            metric.energy_and_gradient(path + step * direction)[0]
            - energy
            - step * np.sum(gradient * direction)
        )
        for step in steps
    ]
    slope = np.log(remainders[0] / remainders[1]) / np.log(steps[0] / steps[1])
    assert slope >= 1.9


@each_metric
def test_large_meshes_run_in_threads_with_the_same_result(metric, monkeypatch):
    path = wavy_path(0.2)
    alone = metric.energy_and_gradient(path)
    monkeypatch.setattr("riemhuman.terms._sum._WORTH_THREADS", 0)
    threaded = metric.energy_and_gradient(path)
    assert alone[0] == threaded[0]
    np.testing.assert_array_equal(alone[1], threaded[1])


@each_metric
def test_autograd_takes_derivatives_of_the_compiled_energy(metric, monkeypatch):
    path, direction = wavy_path(0.2), deformations(SPACE.template, 5, rng=10)
    gradient = grad(metric.energy)(path)
    np.testing.assert_array_equal(gradient, metric.energy_and_gradient(path)[1])
    curvature = hessian_vector_product(metric.energy)(path, direction)
    expected = hessian_vector_product(partial(RiemannianMetric.energy, metric))(path, direction)
    np.testing.assert_allclose(curvature, expected, atol=1e-10 * np.abs(expected).max())
    # In one pass: the definition is not asked.
    monkeypatch.setattr(RiemannianMetric, "energy", None)
    np.testing.assert_array_equal(value_and_grad(metric.energy)(path)[1], gradient)


def test_compiled_energy_in_the_completion():
    path = wavy_path(0.1, n_times=3)
    one, two, three = SPACE.template.faces[0]
    path[1, two] = path[1, three] = path[1, one]
    for name in ("shape", "stretch", "srnf"):
        energy, gradient = METRICS[name].energy_and_gradient(path)
        assert energy == pytest.approx(METRICS[name].energy(path), rel=1e-10)
        assert np.isfinite(gradient).all()
    for name in ("pose", "mixed"):
        assert METRICS[name].energy_and_gradient(path)[0] == np.inf
        with pytest.raises(DegenerateSurfaceError):
            METRICS[name].energy(path)


@each_metric
def test_matrix_gram_and_covectors_agree_with_the_inner_product(metric):
    f, g = surfaces(SPACE.template, 2, rng=11)
    vectors = deformations(SPACE.template, 4, rng=12)
    expected = metric.inner_product(vectors[:, None], vectors[None], f)
    size = np.abs(expected).max()
    flat = vectors.reshape(4, -1)
    np.testing.assert_allclose(
        flat @ (metric.metric_matrix(f) @ flat.T), expected, rtol=0, atol=1e-12 * size
    )
    np.testing.assert_allclose(metric.gram_matrix(vectors, f), expected, rtol=0, atol=1e-12 * size)
    by_default = RiemannianMetric.gram_matrix(metric, vectors, f)
    np.testing.assert_allclose(by_default, expected, rtol=0, atol=1e-12 * size)
    covectors = metric.covector(vectors, f).reshape(4, -1)
    np.testing.assert_allclose(covectors @ flat.T, expected, rtol=0, atol=1e-12 * size)
    averaged = metric.gram_matrix(vectors, np.stack([f, g]))
    other = metric.gram_matrix(vectors, g)
    np.testing.assert_allclose(averaged, 0.5 * (expected + other), rtol=0, atol=1e-12 * size)


def test_matrix_needs_an_immersion():
    f = SPACE.template.vertices.copy()
    f[SPACE.template.faces[3]] = 0.0
    with pytest.raises(DegenerateSurfaceError, match="triangle"):
        METRICS["stretch"].metric_matrix(f)


@each_metric
def test_drift_is_what_the_metric_does_not_see(metric):
    """Translations for all, and rotations where no normals are looked at."""
    path = np.repeat(SPACE.template.vertices[None], 3, axis=0)
    moved, turned = path.copy(), path.copy()
    moved[1] += [0.4, -0.2, 0.1]
    turned[1] = turned[1] @ Rotation.from_rotvec([0.0, 0.3, 0.5]).as_matrix()
    np.testing.assert_allclose(metric.remove_drift(moved), path, atol=1e-9)
    found = metric.remove_drift(turned)
    blind = metric.energy(turned) < 1e-12
    assert blind == (metric in (METRICS["shape"], METRICS["stretch"]))
    np.testing.assert_allclose(found, path if blind else turned, atol=1e-3)
    assert (np.abs(found - turned).max() > 0.1) == blind


def test_energies_leave_nothing_behind():
    metric, path = METRICS["mixed"], wavy_path(0.1, n_times=3)
    metric.energy(path)
    known = len(primitive_vjps)
    for _ in range(5):
        metric.energy(path)
    assert len(primitive_vjps) == known
    again = pickle.loads(pickle.dumps(metric))
    assert again.energy(path) == metric.energy(path)
    assert "_compiled_energy" not in metric.__getstate__()


def test_an_energy_alone_does_without_its_gradient(monkeypatch):
    metric = ElasticMetric(SPACE, 1.0, 0.3, 0.2)
    path = surfaces(SPACE.template, 3, rng=4)
    expected, _ = metric.energy_and_gradient(path)

    def fail(*_):
        raise AssertionError("slopes were added up")

    monkeypatch.setattr("riemhuman.terms._sum.add_gradient", fail)
    assert metric.energy(path) == expected


def test_gradients_are_those_of_one_path():
    paths = surfaces(SPACE.template, 6, rng=3).reshape(2, 3, *SPACE.shape)
    with pytest.raises(ArgumentError, match="path must have shape"):
        ElasticMetric(SPACE, 1.0, 0.1, 0.3).energy_and_gradient(paths)


@pytest.mark.parametrize(
    ("weights", "unseen"),
    [
        ((0.5, 0.1, 0.3), None),
        ((0.5, 0.1, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, 0.3), (1.0, 1.0, 0.0)),
    ],
)
def test_the_part_of_the_family_that_a_metric_lacks(weights, unseen):
    found = ElasticMetric(SPACE, *weights).complementary_metric
    assert (found and (found.a, found.lam, found.c)) == unseen
