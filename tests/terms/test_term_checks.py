"""Slips in a term of one's own are refused when the metric is made: loops trust its shapes."""

import autograd.numpy as anp
import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import AlignedSurfaces, SobolevMetric, SurfaceMetric
from riemhuman.terms import FlatTerm, NormalTerm, Term

SPACE = AlignedSurfaces(sphere_template(), equip=False)


class WithoutLastAxis(FlatTerm):
    def field(self, first):
        return first.areas


class OneForAll(FlatTerm):
    def field(self, first):
        return anp.sum(first.area_vectors, axis=-2)


class ShareOfAll(FlatTerm):
    def field(self, first):
        return (first.areas / anp.sum(first.areas, axis=-1, keepdims=True))[..., None]


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
        (OneForAll, r"fields of OneForAll must have shape \(..., F, n\);.*\(2, 3\)$"),
        (ShareOfAll, "fields of ShareOfAll must be computed triangle by triangle"),
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
        (NormalTerm(), r"terms must be a sequence of terms; found NormalTerm\(weight=1.0\)"),
        ("normals", "terms must be a sequence of terms; found 'normals'"),
    ],
)
def test_what_is_no_term(terms, message):
    with pytest.raises(ArgumentTypeError, match=message):
        SurfaceMetric(SPACE, terms)


class Unweighted(FlatTerm):
    """Its `__init__` knows nothing of the weight."""

    def __init__(self, power):
        self.power = power

    def field(self, first):
        return first.areas[..., None] ** self.power


def test_a_term_that_says_no_weight_has_weight_one():
    metric = SurfaceMetric(SPACE, [Unweighted(0.5)])
    points = surfaces(SPACE.template, 3)
    found = metric.dist_pairwise(points, precision="double")
    np.testing.assert_allclose(found[0, 1], metric.dist(points[0], points[1]), rtol=1e-12)


def test_fields_that_some_triangles_do_not_have_are_none_of_these_slips():
    class OfSome(FlatTerm):
        def field(self, first):
            return anp.where(first.areas > 0.1, first.areas, anp.nan)[..., None]

    metric = SurfaceMetric(SPACE, [OfSome()])
    f1, f2 = surfaces(SPACE.template, 2)
    assert np.isfinite(metric.dist(f1, f2))
    assert np.isnan(metric.dist(f1, 0.3 * f2))
