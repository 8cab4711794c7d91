"""Every adversarial property convicts a metric that is broken in the way it looks for."""

from dataclasses import replace
from functools import partial

import autograd.numpy as np
import numpy as onp
import pytest
from trust.adversarial_metrics import apart, subject_of
from trust.adversarial_properties import PROPERTIES
from trust.adversarial_surfaces import make

import riemhuman as rh
from riemhuman.checks import values_of

WEIGHTS = (1.0, 0.5, 0.3)


def with_metric(name, found, metric_class, *parameters):
    """Return a subject whose metric is another one on the same space."""
    subject = subject_of(name, found, WEIGHTS)
    return replace(subject, metric=metric_class(subject.metric.space, *parameters))


def by_way_of_fields(name, found):
    """Return a subject whose metric is the pull-back by g, as it is defined."""
    subject = subject_of(name, found, WEIGHTS)
    metric = subject.metric
    return replace(
        subject, metric=rh.PullbackMetric(metric.space, metric.target_metric, metric.map)
    )


class ByArcCosine(rh.SRNFMetric):
    """Cosines of angles, whose digits vanish for near surfaces."""

    def squared_dist(self, point_a, point_b):
        n, m = (self.space.normal_field(f) for f in (point_a, point_b))
        cosine = np.clip(np.sum(n * m, axis=-1), -1.0, 1.0)
        return np.sum(self.space.template.face_areas * np.arccos(cosine) ** 2, axis=-1)


class Squared(rh.ElasticMetric):
    """Squared distances, for which the triangle inequality does not hold."""

    def squared_dist(self, point_a, point_b):
        return super().squared_dist(point_a, point_b) ** 2


class Biased(rh.ElasticMetric):
    """A distance of its own for two surfaces, next to the right one for many."""

    def squared_dist(self, point_a, point_b):
        return (1 + 1e-9) * super().squared_dist(point_a, point_b)


class Affine(rh.ElasticMetric):
    """An inner product that is not linear."""

    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        product = super().inner_product(tangent_vec_a, tangent_vec_b, base_point)
        return product * (1 + 1e-9 * np.sum(tangent_vec_a**2))


class MisplacedLambda(rh.EbinMetric):
    """λ in front of the wrong term."""

    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        twin = rh.EbinMetric(self.space, lam=1 / self.lam)
        return self.lam * twin.inner_product(tangent_vec_a, tangent_vec_b, base_point)


class WithoutSegments(rh.ElasticMetric):
    """Energies that forget the number of segments."""

    def energy(self, path):
        return super().energy(path) / (path.shape[-3] - 1)


class RootOfZero(rh.ElasticMetric):
    """Slopes of a square root at 0."""

    def dist(self, point_a, point_b):
        with onp.errstate(all="ignore"):
            return np.sqrt(self.squared_dist(point_a, point_b))


class HalfBlind(rh.SRNFMetric):
    """Half of the distance without derivatives."""

    def squared_dist(self, point_a, point_b):
        seen = super().squared_dist(point_a, point_b)
        return 0.5 * (seen + super().squared_dist(values_of(point_a), point_b))


class InSinglePrecision(rh.ElasticMetric):
    """Arithmetic in the precision of its input."""

    def squared_dist(self, point_a, point_b):
        squared = super().squared_dist(point_a, point_b)
        return squared.astype(point_a.dtype)


class TooFast(rh.EbinMetric):
    """An exponential at twice the speed."""

    def exp(self, tangent_vec, base_point):
        return super().exp(2.0 * tangent_vec, base_point)


def on_a_ray(subject):
    """Return a subject with surfaces on a ray, where d(x, z) = d(x, y) + d(y, z)."""
    return replace(subject, points=subject.points[0] * np.reshape([1.0, 2.0, 4.0], (3, 1, 1)))


def turned_apart(found):
    """Return the metric of normals, claimed not to see a surface turn."""
    subject = subject_of("pose", found, WEIGHTS)
    metric_on = lambda space: rh.ElasticMetric(space, 0.0, 0.0, 1.0)  # noqa: E731
    return replace(subject, isometries=(partial(apart, found, metric_on),))


PLAIN, SLIVERS = make("plain", "open", 0.0, 1), make("slivers", "open", 0.8, 3)
NEAR = make("near", "open", 0.8, 3)
TWINS = {
    "by the arc cosine": ("exact distance", with_metric("pose", NEAR, ByArcCosine)),
    "by way of g": ("exact distance", by_way_of_fields("shape", SLIVERS)),
    "squared": ("axioms", on_a_ray(with_metric("shape", PLAIN, Squared, 1.0, 0.5, 0.0))),
    "biased": ("code paths", with_metric("shape", PLAIN, Biased, 1.0, 0.5, 0.0)),
    "turned apart": ("isometries", turned_apart(PLAIN)),
    "not linear": ("bilinearity", with_metric("shape", PLAIN, Affine, 1.0, 0.5, 0.0)),
    "product by way of g": ("exact product", by_way_of_fields("shape", SLIVERS)),
    "misplaced λ": ("norm as limit", with_metric("Ebin", PLAIN, MisplacedLambda)),
    "without segments": ("energy bounds", with_metric("pose", PLAIN, WithoutSegments, 0, 0, 1)),
    "root of zero": ("finite gradient", with_metric("pose", PLAIN, RootOfZero, 0, 0, 1)),
    "half blind": ("Taylor slope", with_metric("SRNF", PLAIN, HalfBlind)),
    "single": ("float32", with_metric("pose", PLAIN, InSinglePrecision, 0, 0, 1)),
    "too fast": ("exp and log", with_metric("Ebin", PLAIN, TooFast)),
}


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize(("name", "subject"), TWINS.values(), ids=TWINS)
def test_broken_twins_are_convicted(name, subject):
    with pytest.raises(AssertionError):
        PROPERTIES[name].check(subject, onp.random.default_rng(0))


def test_every_property_has_a_twin():
    assert {name for name, _ in TWINS.values()} == set(PROPERTIES)
