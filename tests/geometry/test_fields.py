"""Fields of metrics and of normals: the integral of the kernels, the apex, what is refused."""

import numpy as np
import pytest
from autograd import grad
from cases import TEMPLATES, sphere_template, triangle_template
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, DegenerateSurfaceError, OutsideManifoldError
from riemhuman.geometry import EbinMetric, MetricFields, NormalFields, RotationFields

SPACE = MetricFields(sphere_template())


pytestmark = pytest.mark.usefixtures("strict_floats")


# Through the apex.


def test_geodesic_of_the_completion():
    """At λ = 1e-4 some triangles go through g = 0 and some do not."""
    metric = EbinMetric(SPACE, lam=1e-4)
    start, end = SPACE.random_point(2, rng=5)
    end[:40] = 1.7 * start[:40]
    end[40:45] = np.diag([1.0, 0.0])
    start[45:47] = 0.0
    times = np.linspace(0, 1, 9)
    path = metric.geodesic(start, end)(times)
    assert np.all(np.isfinite(path))
    dist = metric.dist(start, end)
    np.testing.assert_allclose(metric.dist(path[:-1], path[1:]), dist / 8, rtol=1e-10)
    np.testing.assert_allclose(metric.length(path), dist, rtol=1e-12)
    np.testing.assert_allclose(metric.energy(path), dist**2, rtol=1e-12)
    np.testing.assert_allclose(metric.dist(path[[0, -1]], np.stack([start, end])), 0, atol=1e-14)
    np.testing.assert_allclose(path[0, :45], start[:45], atol=1e-14)
    np.testing.assert_allclose(metric.geodesic(end, start)(1 - times), path, atol=1e-14)
    np.testing.assert_allclose(
        metric.geodesic(np.stack([start, start]), np.stack([end, start]))(times)[0], path
    )


def test_degenerate_fields():
    metric = EbinMetric(SPACE, lam=0.2)
    g = SPACE.random_point(rng=6)
    flat = g.copy()
    flat[3] = np.outer([0.1, 0.3], [0.1, 0.3])
    s = np.linalg.det(g[3]) ** 0.25
    expected = 4 * np.sqrt(0.2 * SPACE.template.face_areas[3]) * s
    np.testing.assert_allclose(metric.dist(flat, g), expected, rtol=1e-12)
    assert metric.dist(flat, flat) == 0
    for argument in (0, 1):
        for pair in ((flat, g), (g, flat), (flat, flat)):
            assert np.all(np.isfinite(grad(metric.squared_dist, argument)(*pair)))
            assert np.all(np.isfinite(grad(metric.dist, argument)(*pair)))
    assert not SPACE.belongs(flat)
    message = r"{} must hold invertible matrices; found otherwise at triangle 3$"
    for name, call in {
        "base_point": lambda: metric.norm(g, flat),
        "point": lambda: metric.log(flat, g),
        "initial_point": lambda: metric.geodesic(flat, initial_tangent_vec=g),
    }.items():
        with pytest.raises(DegenerateSurfaceError, match=message.format(name)):
            call()
    for call in (lambda: metric.exp(g, flat), lambda: metric.log(g, flat)):
        with pytest.raises(DegenerateSurfaceError, match=message.format("base_point")):
            call()
    with pytest.raises(DegenerateSurfaceError, match=r"triangle 3 of item \(1,\)"):
        metric.norm(g, np.stack([g, flat, g]))


@pytest.mark.parametrize("rng", range(5))
def test_exp_through_the_apex_is_refused(rng):
    """Rounding must not turn a radial geodesic around the apex, on any triangle."""
    space = MetricFields(triangle_template())
    metric = EbinMetric(space, lam=0.1)
    g = space.random_point(rng=rng)
    with pytest.raises(
        OutsideManifoldError, match=r"tangent_vec must .* g = 0; found .*triangle 0"
    ):
        metric.exp(-3 * g, g)
    geodesic = metric.geodesic(g, initial_tangent_vec=-3 * g)
    np.testing.assert_allclose(geodesic(0.5), [g / 16], rtol=1e-12)
    with pytest.raises(OutsideManifoldError, match="triangle 0"):
        geodesic([0.5, 1.0])


def test_log_beyond_pi_is_refused():
    metric = EbinMetric(SPACE, lam=1e-4)
    g = SPACE.random_point(rng=7)
    far = g.copy()
    far[[5, 9]] = SPACE.random_point(rng=8)[[5, 9]]
    with pytest.raises(
        OutsideManifoldError, match=r"point must be within .*triangle 5, the first of 2 such"
    ):
        metric.log(far, g)


# Refusals.


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        ([[1.0, 0.5], [0.4, 1.0]], "must hold symmetric matrices; found otherwise at triangle 2"),
        ([[-1.0, 0.0], [0.0, -1.0]], "must hold positive semidefinite matrices"),
        ([[0.0, 1.0], [1.0, 0.0]], "must hold positive semidefinite matrices"),
    ],
)
def test_fields_must_be_metrics(matrix, message):
    metric = EbinMetric(SPACE)
    g = SPACE.random_point(rng=9)
    bad = g.copy()
    bad[2] = matrix
    assert not SPACE.belongs(bad)
    with pytest.raises(ArgumentError, match=f"point_b {message}"):
        metric.dist(g, bad)
    with pytest.raises(ArgumentError, match=f"base_point {message}"):
        metric.exp(g, bad)
    with pytest.raises(ArgumentError, match=f"end_point {message}"):
        metric.geodesic(g, bad)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_rounding_errors_of_fields_are_legal(scale):
    """Relative to the trace, whatever the unit of length."""
    plain = scale * np.array([[1.0, 0.5], [0.5, 2.0]])
    size = 3.0 * scale
    good = np.broadcast_to(plain, SPACE.shape)
    for share, legal in ((0.9e-9, True), (1.1e-9, False)):
        for sign in (-1.0, 1.0):
            crooked = good.copy()
            crooked[5, 0, 1] += sign * share * size
            # [[1, 1], [1, 1]] has trace 2; its determinant is made −4 times the share.
            negative = good.copy()
            negative[5] = scale * np.array([[1.0, 1.0], [1.0, 1.0 - 4 * share]])
            for field, message in ((crooked, "symmetric"), (negative, "positive semidefinite")):
                if legal:
                    kept = SPACE.check_point(field, "g", completion=True)
                    np.testing.assert_array_equal(kept, field)
                else:
                    with pytest.raises(ArgumentError, match=f"g must hold {message} .*triangle 5$"):
                        SPACE.check_point(field, "g", completion=True)


# Normals.

NORMALS = NormalFields(sphere_template())
ON_NORMALS = NORMALS.metric
AREAS = NORMALS.template.face_areas


def test_antipodal_normals():
    n = NORMALS.random_point(rng=4)
    opposite = n.copy()
    opposite[[6, 8]] *= -1
    expected = np.pi * np.sqrt(AREAS[[6, 8]].sum())
    np.testing.assert_allclose(ON_NORMALS.dist(n, opposite), expected, rtol=1e-14)
    with np.errstate(all="raise"):
        for argument in (0, 1):
            assert np.all(np.isfinite(grad(ON_NORMALS.squared_dist, argument)(n, opposite)))
            assert np.all(np.isfinite(grad(ON_NORMALS.dist, argument)(n, opposite)))
    message = "point must hold no normal antipodal .*triangle 6, the first of 2 such triangles"
    for call in (
        lambda: ON_NORMALS.log(opposite, n),
        lambda: ON_NORMALS.geodesic(n, opposite),
        lambda: ON_NORMALS.parallel_transport(n, n, end_point=opposite),
    ):
        with pytest.raises(OutsideManifoldError, match=message):
            call()
    rounded = np.where(opposite == -n, opposite * (1 + 2e-16), opposite)
    with pytest.raises(OutsideManifoldError, match="triangle 6"):
        ON_NORMALS.log(rounded, n)


def test_refusals_of_normals():
    n = NORMALS.random_point(rng=5)
    long = n.copy()
    long[4] *= 1.001
    assert not NORMALS.belongs(long)
    with pytest.raises(ArgumentError, match=r"point_a must hold unit vectors; .* at triangle 4$"):
        ON_NORMALS.dist(long, n)
    with pytest.raises(ArgumentError, match="base_point must hold unit vectors"):
        ON_NORMALS.exp(n, long)
    with pytest.raises(ArgumentError, match="end_point must hold unit vectors"):
        ON_NORMALS.geodesic(n, long)
    with pytest.raises(ArgumentError, match="needs direction or end_point, and not both"):
        ON_NORMALS.parallel_transport(n, n, direction=n, end_point=n)


# Fields of rotations, beside what holds for every manifold and metric.


@pytest.fixture
def space():
    return RotationFields(sphere_template())


@pytest.mark.parametrize("name", TEMPLATES)
def test_distance_is_the_weighted_sum_of_squared_angles(name):
    space = RotationFields(TEMPLATES[name]())
    first, second = space.random_point(2, rng=1)
    angles = (Rotation.from_matrix(first).inv() * Rotation.from_matrix(second)).magnitude()
    expected = np.sum(space.template.face_areas * angles**2)
    assert space.metric.squared_dist(first, second) == pytest.approx(expected, rel=1e-13)


def test_half_turns_are_the_cut_locus(space):
    start = space.random_point(rng=4)
    half = Rotation.from_euler("y", 180, degrees=True).as_matrix()
    for end in (start @ half, half @ start):
        assert space.metric.squared_dist(start, end) == pytest.approx(
            np.pi**2 * space.template.face_areas.sum()
        )
        with pytest.raises(OutsideManifoldError, match="the angle π"):
            space.metric.log(end, start)
    nearly = start @ Rotation.from_euler("y", np.pi - 1e-6).as_matrix()
    np.testing.assert_allclose(
        space.metric.exp(space.metric.log(nearly, start), start), nearly, atol=1e-9
    )


def test_what_is_no_field_of_rotations(space):
    point = space.random_point(rng=6)
    mirrored, stretched = point.copy(), point.copy()
    mirrored[3] *= -1
    stretched[3] *= 1.001
    candidates = np.stack([point, mirrored, stretched])
    np.testing.assert_array_equal(space.belongs(candidates), [True, False, False])
    for wrong in (mirrored, stretched):
        with pytest.raises(ArgumentError, match="point_b must hold rotations"):
            space.metric.dist(point, wrong)
    assert space.belongs(space.projection(stretched))
