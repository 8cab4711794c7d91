"""A term of one's own: what a user's script defines, and all that follows from it."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import value_and_grad
from cases import deformations, sphere_template, surfaces

from riemhuman.errors import ArgumentError, ArgumentTypeError, NotDefinedError
from riemhuman.geometry import (
    AlignedSurfaces,
    FlatMetric,
    NormalFields,
    ProductManifold,
    RiemannianMetric,
    SobolevMetric,
    SurfaceMetric,
    VectorSpace,
)
from riemhuman.solvers import TangentPCA
from riemhuman.terms import EbinTerm, FlatTerm, NormalTerm, Term


class RootArea(FlatTerm):
    """Differences of the square roots of areas."""

    is_rotation_invariant = True

    def field(self, first):
        return anp.sqrt(first.areas)[..., None]


class LogArea(Term):
    """Differences of the logarithms of areas: no compiled form at all."""

    is_rotation_invariant = True
    needs_area = True

    def fields(self, first):
        return (anp.log(first.areas),)

    def squared_dist(self, fields_a, fields_b):
        return (fields_a[0] - fields_b[0]) ** 2

    def inner_product(self, changes_a, changes_b, fields):
        return changes_a[0] * changes_b[0]


class Several(Term):
    """Fields of several shapes, whose differences count differently."""

    def fields(self, first):
        return anp.stack([first.areas, first.e], axis=-1), first.m, first.area_vectors

    def squared_dist(self, fields_a, fields_b):
        gaps = [one - other for one, other in zip(fields_a, fields_b, strict=True)]
        return self.inner_product(gaps, gaps, None)

    def inner_product(self, changes_a, changes_b, fields):
        products = [one * other for one, other in zip(changes_a, changes_b, strict=True)]
        return (
            0.7 * anp.sum(products[0], axis=-1)
            + 1.9 * products[1]
            + 0.4 * anp.sum(products[2] * anp.array([1.0, 2.0, 3.0]), axis=-1)
        )


class Kept(LogArea):
    """Features in single precision, and no bound on what that loses."""

    single = True


SPACE = AlignedSurfaces(sphere_template())
POINTS = surfaces(SPACE.template, 5, rng=1)
H = deformations(SPACE.template, 3, rng=2)
METRICS = {
    "flat": SurfaceMetric(SPACE, [RootArea(0.7)]),
    "any": SurfaceMetric(SPACE, [LogArea(0.7)]),
    "several fields": SurfaceMetric(SPACE, [Several(0.7)]),
    "any, kept in single precision": SurfaceMetric(SPACE, [Kept(0.7)]),
    "sum": SurfaceMetric(SPACE, [EbinTerm(1.0, 0.1), LogArea(0.3), RootArea(2.0)]),
}
each_metric = pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)


@each_metric
@pytest.mark.parametrize("precision", ["single", "double"])
def test_tables_of_distances(metric, precision):
    expected = np.array([[metric.dist(f, g) for g in POINTS] for f in POINTS])
    found = metric.dist_pairwise(POINTS, precision=precision, n_jobs=2)
    np.testing.assert_allclose(found, expected, rtol={"single": 1e-5, "double": 1e-10}[precision])


def test_distances_whose_rounding_no_term_bounds_are_computed_in_double_precision():
    metric = METRICS["any, kept in single precision"]
    points = POINTS[0] + 1e-9 * (POINTS - POINTS[0])
    found = metric.dist_pairwise(points, precision="single")
    np.testing.assert_allclose(found, metric.dist_pairwise(points, precision="double"), rtol=1e-6)


@each_metric
def test_energies_and_gradients(metric):
    energy, gradient = metric.energy_and_gradient(POINTS)
    by_definition = value_and_grad(lambda path: RiemannianMetric.energy(metric, path))
    expected, expected_gradient = by_definition(POINTS)
    assert energy == pytest.approx(expected, rel=1e-12)
    scale = np.abs(expected_gradient).max()
    np.testing.assert_allclose(gradient, expected_gradient, atol=1e-11 * scale)


@each_metric
def test_matrices(metric):
    f, flat = POINTS[0], H.reshape(3, -1)
    expected = metric.inner_product(H[:, None], H[None], f)
    size = np.abs(expected).max()
    np.testing.assert_allclose(
        flat @ (metric.metric_matrix(f) @ flat.T), expected, atol=1e-11 * size
    )
    step = 1e-4
    near = metric.squared_dist(f, f + step * H[0]) + metric.squared_dist(f, f - step * H[0])
    assert near / (2 * step**2) == pytest.approx(expected[0, 0], rel=1e-5)


@each_metric
def test_lower_bounds(metric):
    coordinates = metric.lower_bound_coordinates(POINTS)
    bound = np.linalg.norm(coordinates[:, None] - coordinates, axis=-1)
    assert np.all(bound <= metric.dist_pairwise(POINTS, precision="double") * (1 + 1e-12) + 1e-12)


def test_statistics_of_fields_need_terms_that_say_where_their_fields_live():
    assert METRICS["flat"].has_target_metric
    assert not METRICS["any"].has_target_metric
    with pytest.raises(NotDefinedError, match="the fields of LogArea have no manifold"):
        METRICS["any"].map(POINTS[0])


class LogAreaWithSpace(LogArea):
    """Its fields are numbers, the points of a vector space of the library's."""

    has_target_space = True

    def target_space(self, spaces):
        return spaces.vector_fields(1)

    def target_point(self, first):
        return anp.log(first.areas)[..., None]


class NormalsAndAreas(LogAreaWithSpace):
    """Its fields are points of a manifold of one's own: unit normals, and logarithms of areas."""

    def fields(self, first):
        return first.area_vectors / first.areas[..., None], anp.log(first.areas)

    def squared_dist(self, fields_a, fields_b):
        (n_a, log_a), (n_b, log_b) = fields_a, fields_b
        angle = 2.0 * anp.arcsin(0.5 * anp.sqrt(anp.sum((n_a - n_b) ** 2, axis=-1)))
        return angle**2 + (log_a - log_b) ** 2

    def inner_product(self, changes_a, changes_b, fields):
        (n_a, log_a), (n_b, log_b) = changes_a, changes_b
        return anp.sum(n_a * n_b, axis=-1) + log_a * log_b

    def target_space(self, spaces):
        areas = spaces.template.face_areas
        logs = VectorSpace((len(areas),)).equip_with_metric(FlatMetric, weights=areas)
        return ProductManifold([NormalFields(spaces.template), logs])

    def target_point(self, first):
        return anp.concatenate(
            [self.fields(first)[0].reshape(*first.areas.shape[:-1], -1), anp.log(first.areas)],
            axis=-1,
        )


@pytest.mark.parametrize(
    "terms",
    [
        [LogAreaWithSpace()],
        [LogAreaWithSpace(0.7)],
        [NormalsAndAreas(0.3)],
        [EbinTerm(1.0, 0.1), NormalsAndAreas(0.3), RootArea(2.0)],
    ],
)
def test_a_term_that_declares_its_space_gets_exp_and_log_of_fields(terms):
    metric = SurfaceMetric(SPACE, terms)
    assert metric.has_target_metric
    images, target = metric.map(POINTS), metric.target_metric
    np.testing.assert_allclose(
        target.dist(images[0], images[1:]), metric.dist(POINTS[0], POINTS[1:]), rtol=1e-9
    )
    velocity = target.log(images[1], images[0])
    assert target.norm(velocity, images[0]) == pytest.approx(metric.dist(POINTS[0], POINTS[1]))
    np.testing.assert_allclose(target.exp(velocity, images[0]), images[1], atol=1e-9)


def test_statistics_of_fields_take_a_term_of_ones_own():
    metric = SurfaceMetric(SPACE, [NormalsAndAreas(0.3)])
    components = TangentPCA(metric, n_components=2, image="fields").fit(POINTS)
    assert components.transform(POINTS).shape == (5, 2)


def test_a_space_of_fields_without_metric_is_refused():
    class Bare(LogAreaWithSpace):
        def target_space(self, spaces):
            return VectorSpace((spaces.template.n_faces, 1), equip=False)

    with pytest.raises(ArgumentError, match="equipped with a metric.*VectorSpace without one"):
        SurfaceMetric(SPACE, [Bare()]).map(POINTS[0])


# Slips in a term of one's own are refused when the metric is made: loops trust its shapes.


class WithoutLastAxis(FlatTerm):
    def field(self, first):
        return first.areas


class NearlyLocal(FlatTerm):
    def field(self, first):
        return first.areas[..., None] + 1e-6 * anp.sum(first.areas, axis=-1)[..., None, None]


class WithoutTuple(Term):
    def fields(self, first):
        return first.areas

    def squared_dist(self, fields_a, fields_b):
        return (fields_a - fields_b) ** 2

    def inner_product(self, changes_a, changes_b, fields):
        return changes_a * changes_b


class Summed(WithoutTuple):
    def fields(self, first):
        return (first.areas,)

    def squared_dist(self, fields_a, fields_b):
        return anp.sum((fields_a[0] - fields_b[0]) ** 2, axis=-1)


@pytest.mark.parametrize(
    ("term", "message"),
    [
        (WithoutLastAxis, r"fields of WithoutLastAxis must have shape \(..., F, n\);.*\(2, 3\)$"),
        (NearlyLocal, "fields of NearlyLocal must be computed triangle by triangle"),
        (Summed, r"squared_dist of Summed must return shape \(..., F\).*found \(2,\)"),
    ],
)
def test_shapes(term, message):
    with pytest.raises(ArgumentError, match=message):
        SurfaceMetric(SPACE, [NormalTerm(), term()])


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ([WithoutTuple()], "fields of WithoutTuple must return a tuple of arrays; found ndarray"),
        ([NormalTerm], "terms must hold instances of Term; found <class .*NormalTerm"),
        (["normals"], "terms must hold instances of Term; found 'normals'"),
        (SobolevMetric(SPACE).terms, "terms must hold instances of Term; found .*FirstOrderTerm"),
    ],
)
def test_what_is_no_term(terms, message):
    with pytest.raises(ArgumentTypeError, match=message):
        SurfaceMetric(SPACE, terms)
