"""Principal components at the mean: known directions are found, and bodies stay bodies."""

from warnings import catch_warnings, simplefilter

import numpy as np
import pytest
from cases import sphere_template, surfaces, triangle_template
from open_bodies import coarse_bodies

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, MixedPosesWarning, OutsideManifoldError
from riemhuman.geometry import (
    AlignedSurfaces,
    EbinMetric,
    ElasticMetric,
    MetricFields,
    NormalFields,
    ProductManifold,
    VectorSpace,
)
from riemhuman.solvers import BasisMean, TangentPCA, tangent_pca
from riemhuman.solvers._mixed_poses import _MOST_TURNED, turned_share
from riemhuman.surfaces import DeformationBasis

FIELDS = {
    "normals": NormalFields(sphere_template()),
    "one sphere": NormalFields(triangle_template()),
    "metrics": MetricFields(triangle_template()).equip_with_metric(EbinMetric, lam=2.0),
    "product": ProductManifold(
        [
            MetricFields(sphere_template()).equip_with_metric(EbinMetric, lam=2.0),
            NormalFields(sphere_template()),
        ]
    ),
    "vectors": VectorSpace((4, 2)),
}
each_space = pytest.mark.parametrize("space", FIELDS.values(), ids=FIELDS)


def geodesic_points(space, times, rng=1):
    """Return points of a geodesic of length about one, and its point and velocity at 0."""
    point = space.random_point(rng=rng)
    velocity = space.random_tangent_vec(point, rng=rng + 1)
    velocity /= np.abs(velocity).max()
    times = np.reshape(times, (-1, *(1,) * point.ndim))
    return space.metric.exp(0.5 * times * velocity, point), point, 0.5 * velocity


def near_points(space, n_points=6):
    """Return points near enough for a mean to be unique."""
    points = space.random_point(n_points, rng=3)
    return space.projection(points[0] + 0.25 * (points - points[0]))


@each_space
def test_points_of_a_geodesic_have_one_component(space):
    times = np.array([-1.0, -0.4, 0.1, 0.3, 1.0])
    points, point, velocity = geodesic_points(space, times)
    pca = TangentPCA(space).fit(points)
    assert pca.n_components_ == 1
    np.testing.assert_allclose(pca.explained_variance_ratio_, 1.0, atol=1e-9)
    speed = space.metric.norm(velocity, point)
    np.testing.assert_allclose(pca.explained_variance_, np.var(speed * times, ddof=1), rtol=1e-6)
    scores = pca.transform(points)[:, 0]
    np.testing.assert_allclose(np.abs(scores), speed * np.abs(times - times.mean()), atol=1e-6)
    np.testing.assert_allclose(pca.inverse_transform(scores[:, None]), points, atol=1e-7)
    assert pca.transform(points[:0]).shape == (0, 1)
    assert pca.inverse_transform(np.zeros((0, 1))).shape == (0, *space.shape)


@each_space
def test_components_are_orthonormal_and_scores_uncorrelated(space):
    points = near_points(space)
    pca = TangentPCA(space).fit(points)
    gram = space.metric.inner_product(
        pca.components_[:, None], pca.components_[None], pca.mean_[None, None]
    )
    np.testing.assert_allclose(gram, np.eye(pca.n_components_), atol=1e-8)
    scores = pca.fit_transform(points)
    np.testing.assert_allclose(scores.mean(axis=0), 0.0, atol=1e-9)
    np.testing.assert_allclose(
        np.cov(scores.T, ddof=1).reshape(gram.shape), np.diag(pca.explained_variance_), atol=1e-9
    )
    assert np.all(np.diff(pca.explained_variance_) <= 0)
    assert pca.explained_variance_ratio_.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(pca.inverse_transform(scores), points, atol=1e-6)
    # At the Karcher mean the logarithms cancel.
    assert space.metric.norm(pca.offset_, pca.mean_) < 1e-6
    # The squared norms of logarithms are squared distances.
    squared = space.metric.squared_dist(points, pca.mean_)
    np.testing.assert_allclose((scores**2).sum(axis=1), squared, rtol=1e-5)


def test_samples_follow_the_distribution():
    space = FIELDS["one sphere"]
    points = near_points(space, 12)
    pca = TangentPCA(space).fit(points)
    samples = pca.sample(3000, rng=7)
    scores = pca.transform(samples)
    np.testing.assert_allclose(scores.var(axis=0), pca.explained_variance_, rtol=0.1)
    assert np.all(space.belongs(samples))
    np.testing.assert_array_equal(samples[:2], pca.sample(3000, rng=7)[:2])
    assert not np.allclose(samples[:2], pca.sample(2, rng=8))
    assert pca.sample().shape == space.shape


def test_mean_may_be_given_or_sought_by_any_solver():
    space = AlignedSurfaces(sphere_template(), equip=False)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    points = surfaces(sphere_template(), 4, rng=5)
    given = TangentPCA(space, mean=points[0]).fit(points)
    np.testing.assert_array_equal(given.mean_, points[0])
    centred = given.transform(points) - given.transform(points[:1])
    squared = space.metric.squared_dist(points, points[0])
    np.testing.assert_allclose((centred**2).sum(axis=1), squared, rtol=1e-9, atol=1e-20)
    basis = DeformationBasis.from_laplacian(sphere_template(), 12)
    sought = TangentPCA(space, mean=BasisMean(basis)).fit(points)
    default = TangentPCA(space).fit(points)
    assert not np.array_equal(sought.mean_, default.mean_)

    def spread(mean):
        return sum(space.metric.squared_dist(mean, point) for point in points)

    assert spread(default.mean_) <= spread(sought.mean_) <= spread(points[0])


def test_fields_and_points_are_one_where_the_map_is_the_identity():
    space = VectorSpace((4,))
    points = np.random.default_rng(2).standard_normal((5, 4))
    alone = TangentPCA(space, image="points").fit(points)
    np.testing.assert_allclose(alone.mean_, points.mean(axis=0), atol=1e-7)
    with pytest.raises(ArgumentError, match=r'image="fields".*FlatMetric'):
        TangentPCA(space, image="fields").fit(points)


def equipped(a, lam, c):
    space = AlignedSurfaces(coarse_bodies().template, equip=False)
    return space.equip_with_metric(ElasticMetric, a=a, lam=lam, c=c)


def test_samples_with_inverted_triangles_are_drawn_anew(monkeypatch):
    space = AlignedSurfaces(sphere_template(), equip=False)
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    points = surfaces(sphere_template(), 3, rng=5, size=0.1)
    pca, verdicts = TangentPCA(space, 1, mean=points[0]).fit(points), [False, True]
    monkeypatch.setattr(tangent_pca, "inverted_triangles", lambda *_: np.array([verdicts.pop()]))
    assert pca.sample(rng=3).shape == space.shape
    assert verdicts == []
    monkeypatch.setattr(tangent_pca, "inverted_triangles", lambda *_: np.array([True]))
    monkeypatch.setattr(tangent_pca, "_MOST_DRAWN", 3)
    with pytest.raises(ArgumentError, match="without inverted triangles; 0 of 3 drawn"):
        pca.sample()


def test_refusals():
    space = VectorSpace((3,))
    points = np.random.default_rng(1).standard_normal((4, 3))
    with pytest.raises(ArgumentError, match="at least two points; found 1"):
        TangentPCA(space).fit(points[:1])
    with pytest.raises(ArgumentError, match="coincide"):
        TangentPCA(space).fit(np.repeat(points[:1], 3, axis=0))
    with pytest.raises(ArgumentError, match="n_components=2 exceeds the 1 directions"):
        TangentPCA(space, 2).fit([[0, 0, 0], [1, 1, 1], [3, 3, 3]])
    surface_space = AlignedSurfaces(sphere_template(), equip=False)
    surface_space.equip_with_metric(ElasticMetric, a=1.0, lam=1e-4, c=0.0)
    few = surfaces(sphere_template(), 3, size=0.5)
    with pytest.raises(OutsideManifoldError, match="angle θ < π"):
        TangentPCA(surface_space, mean=few[0]).fit(few)


# Mixed poses.


def one_pose(variant, pose, members=slice(None)):
    bodies = load_open_bodies("coarse", variant=variant)
    return bodies.points[bodies.pose == pose][members]


def share_turned(points, noise=0.0):
    """Return the share that is compared, of bodies some of which face another way."""
    template = coarse_bodies().template
    rng = np.random.default_rng(5)
    points = points + rng.normal(0.0, noise, points.shape) if noise else points.copy()
    points[::2] = points[::2] * [-1.0, 1.0, -1.0]
    return turned_share(template, points, points[0])


@pytest.mark.slow
@pytest.mark.everyday("plain")
@pytest.mark.parametrize("variant", ["plain", "natural"])
def test_one_pose_of_many_people_is_one(variant):
    """Whatever their builds, and however differently people hold it; scale does not matter."""
    shares = [share_turned(one_pose(variant, number)) for number in range(10)]
    assert max(shares) < 0.5 * _MOST_TURNED
    squat = one_pose(variant, 9)
    assert share_turned(1000.0 * squat) == pytest.approx(share_turned(squat), abs=1e-3)
    assert share_turned(squat, noise=0.003) < _MOST_TURNED


@pytest.mark.parametrize("weights", [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_mixed_poses_are_warned_of(weights):
    """Unless poses are what the metric describes."""
    space = equipped(*weights)
    points = one_pose("plain", 0, slice(4))
    mixed = np.concatenate([points[:2], one_pose("plain", 3, slice(2, 4))])
    mean = points[0]
    TangentPCA(space, 2, mean=mean).fit(points)
    with catch_warnings(record=True) as warnings:
        simplefilter("always")
        TangentPCA(space, 2, mean=mean).fit(mixed)
    assert [entry.category for entry in warnings] == [MixedPosesWarning] * (weights[0] > 0)
