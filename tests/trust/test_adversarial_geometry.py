"""Metrics on legal surfaces that rounding does not like: slivers, far, flat, folded, coincident.

An allowance is what rounding of the coordinates may cost, and of the metric field where there is
one: `ROUNDING` εκ times how far a surface moves for a relative change 1 of its triangles, see
`adversarial_surfaces`.
"""

import sys

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import taylor_slope
from trust.adversarial_surfaces import (
    EPS,
    FAMILIES,
    MESHES,
    exact_elastic,
    exact_srnf,
    heights,
    make,
    scale_of_elastic,
    scale_of_srnf,
    surfaces,
    weights,
)

import riemhuman as rh

ROUNDING = 16.0

# Derivatives are taken by the chain rule from edges: what overflows or divides by 0 is an error.
pytestmark = pytest.mark.filterwarnings("error")


def elastic(found, a, lam, c):
    """Return a metric, and the allowance for its distances."""
    metric = rh.ElasticMetric(found.space, a, lam, c)
    normals = found.condition * scale_of_elastic(found, 0.0, lam, c)
    fields = found.condition_of_fields * scale_of_elastic(found, a, lam, 0.0)
    return metric, ROUNDING * EPS * (fields + normals)


def srnf(found):
    return rh.SRNFMetric(found.space), ROUNDING * EPS * found.condition * scale_of_srnf(found)


def both(found, abc):
    return [elastic(found, *abc), srnf(found)]


PAIRS = [(0, 1), (0, 2), (1, 2)]


@settings(max_examples=60)
@given(surfaces(), weights())
def test_distances_are_exact_within_the_allowance(found, abc):
    metric, allowance = elastic(found, *abc)
    other, other_allowance = srnf(found)
    for i, j in PAIRS:
        f, g = found.points[i], found.points[j]
        exact = float(exact_elastic(found, i, j, *abc) ** 0.5)
        assert abs(metric.dist(f, g) - exact) <= allowance + 1e-13 * exact
        exact = float(exact_srnf(found, i, j) ** 0.5)
        assert abs(other.dist(f, g) - exact) <= other_allowance + 1e-13 * exact


@settings(max_examples=120)
@given(surfaces(), weights())
def test_axioms(found, abc):
    x, y, z = found.points
    for metric, allowance in both(found, abc):
        xy, yz, xz = metric.dist(x, y), metric.dist(y, z), metric.dist(x, z)
        assert xy == metric.dist(y, x)
        assert min(xy, yz, xz) >= 0
        for point in found.points:
            assert metric.dist(point, point) == 0
            assert metric.squared_dist(point, point.copy()) == 0
        # Each of the three may be wrong by the allowance and in its last digits.
        assert xz <= xy + yz + 3 * allowance + 1e-13 * (xy + yz)


@settings(max_examples=60)
@given(surfaces(), weights())
def test_code_paths_agree(found, abc):
    points = found.points
    for metric, allowance in both(found, abc):
        one_by_one = np.array([[metric.dist(f, g) for g in points] for f in points])
        tight = allowance + 1e-12 * one_by_one.max()
        at_once = metric.dist(points[:, None], points[None])
        np.testing.assert_allclose(at_once, one_by_one, rtol=0, atol=tight)
        squared = metric.squared_dist(points[:, None], points[None])
        np.testing.assert_allclose(np.sqrt(squared), one_by_one, rtol=0, atol=tight)
        double = metric.dist_pairwise(points, precision="double")
        np.testing.assert_allclose(double, one_by_one, rtol=0, atol=tight)
        single = metric.dist_pairwise(points)
        np.testing.assert_allclose(single, one_by_one, rtol=2e-5, atol=tight)
        np.testing.assert_array_equal(single, single.T)
        crossed = metric.cdist(points, points[:2])
        np.testing.assert_allclose(crossed, one_by_one[:, :2], rtol=2e-5, atol=tight)
        for i, j in PAIRS:
            path = points[[i, j]]
            length = metric.length(path)
            np.testing.assert_allclose(length, one_by_one[i, j], rtol=0, atol=tight)
            energy = np.sqrt(metric.energy(path))
            np.testing.assert_allclose(energy, one_by_one[i, j], rtol=0, atol=tight)
            compiled, gradient = metric.energy_and_gradient(path)
            np.testing.assert_allclose(np.sqrt(compiled), energy, rtol=0, atol=tight)
            assert np.isfinite(gradient).all()


@settings(max_examples=50)
@given(surfaces(), weights())
def test_single_precision_input_is_read_as_what_it_is(found, abc):
    single = found.points.astype(np.float32)
    for metric, _ in both(found, abc):
        try:
            expected = metric.dist(*single[:2].astype(np.float64))
        except rh.RiemhumanError as error:
            with pytest.raises(type(error)):
                metric.dist(*single[:2])
            continue
        assert metric.dist(*single[:2]) == expected


def rotation(seed):
    turn, triangle = np.linalg.qr(np.random.default_rng(seed).standard_normal((3, 3)))
    turn = turn * np.sign(np.diag(triangle))
    return turn * np.sign(np.linalg.det(turn))


@settings(max_examples=60)
@given(surfaces(), weights(), st.integers(0, 99))
def test_isometries(found, abc, seed):
    x, y, _ = found.points
    turn, shift = rotation(seed), np.random.default_rng(seed).uniform(-1, 1, 3)
    shift *= np.abs(found.points).max()
    for metric, allowance in both(found, abc):
        expected = metric.dist(x, y)
        # Moved and turned coordinates are rounded anew, and up to three times as large.
        tolerance = 8 * allowance + 1e-12 * expected
        assert abs(metric.dist(x + shift, y) - expected) <= tolerance
        assert abs(metric.dist(x @ turn.T, y @ turn.T) - expected) <= tolerance
    a, lam, _ = abc
    if a:
        shape, allowance = elastic(found, a, lam, 0.0)
        expected = shape.dist(x, y)
        tolerance = 8 * allowance + 1e-12 * expected
        assert abs(shape.dist(x @ turn.T, y) - expected) <= tolerance


@settings(max_examples=50)
@given(surfaces(), weights(), st.floats(-6.0, 6.0))
def test_scaling_scales_what_it_should(found, abc, power):
    x, y, _ = found.points
    factor = 10.0**power
    a, lam, _ = abc
    cases = [(*srnf(found), factor), (*elastic(found, 0.0, 0.0, 1.0), 1.0)]
    if a:
        cases.append((*elastic(found, a, lam, 0.0), factor))
    for metric, allowance, expected in cases:
        distance = metric.dist(x, y)
        scaled = metric.dist(factor * x, factor * y)
        assert abs(scaled - expected * distance) <= 4 * expected * (allowance + 1e-13 * distance)


@settings(max_examples=60)
@given(surfaces(), weights())
def test_gradients_are_finite(found, abc):
    for metric, _ in both(found, abc):
        for i, j in [*PAIRS, (0, 0)]:
            f, g = found.points[i], found.points[j]
            for argument in (0, 1):
                assert np.isfinite(grad(metric.squared_dist, argument)(f, g)).all()
        assert np.isfinite(grad(metric.energy)(found.points)).all()


SMOOTH = ("plain", "slivers", "tiny", "huge", "flat folds", "sliver template")


@settings(max_examples=60)
@given(
    st.sampled_from(SMOOTH),
    st.sampled_from(list(MESHES)),
    st.floats(0.0, 0.5),
    st.integers(0, 2**16),
    st.sampled_from([0.3, 1.0, 1e2, 1e4]),
)
def test_gradients_have_the_taylor_slope(family, mesh, severity, seed, lam):
    found = make(family, mesh, severity, seed)
    x = found.points[0]
    metric = rh.ElasticMetric(found.space, 1.0, lam, 0.0)
    height = heights(x, found.template.faces).min()
    direction = 0.3 * height * np.random.default_rng(seed).standard_normal(x.shape)
    # The steps are those of a unit of height; the value is near its own change, or digits go.
    near = x + 3.0 * direction

    def value(f):
        return metric.squared_dist(f, near)

    gradient = grad(value)(x)
    if found.condition_of_fields < 1e5:
        assert taylor_slope(value, x, direction, gradient) >= 1.9


@settings(max_examples=60)
@given(st.integers(0, 2**16), st.floats(0.0, 3.0), st.floats(-3.0, 4.0), st.floats(-6.0, 6.0))
def test_exp_and_log_of_metric_fields(seed, anisotropy, log_lam, log_size):
    rng = np.random.default_rng(seed)
    template = make("plain", "open", 0.0, seed).template
    lam = 10.0**log_lam
    space = rh.MetricFields(template)
    metric = rh.EbinMetric(space, lam=lam)
    factors = rng.standard_normal((3, 2, 2)) + 2 * np.eye(2)
    factors[..., 0, :] *= 10.0**anisotropy
    start = 10.0**log_size * factors @ np.swapaxes(factors, -1, -2)
    # Angles on the cone stay below π: there is a geodesic.
    spread = min(0.3, np.sqrt(lam))
    noise = rng.uniform(-1, 1, (3, 2, 2))
    root = np.linalg.cholesky(start)
    end = (
        root
        @ (np.eye(2) + 0.5 * spread * (noise + np.swapaxes(noise, -1, -2)))
        @ (np.swapaxes(root, -1, -2))
    )
    end = 0.5 * (end + np.swapaxes(end, -1, -2))
    velocity = metric.log(end, start)
    error = metric.dist(metric.exp(velocity, start), end)
    distance = metric.dist(start, end)
    condition = np.linalg.cond(start).max() * max(1.0, 1.0 / np.sqrt(lam))
    scale = np.sqrt((2 + 4 * lam) * np.sqrt(np.linalg.det(start)).max() * template.face_areas.sum())
    assert error <= 100 * EPS * condition * scale
    assert abs(metric.norm(velocity, start) - distance) <= 100 * EPS * condition * scale


@settings(max_examples=50)
@given(st.integers(0, 2**16), st.floats(-12.0, 0.0), st.booleans())
def test_exp_and_log_of_normal_fields(seed, power, antipodal):
    template = make("plain", "open", 0.0, seed).template
    space = rh.NormalFields(template)
    start = space.random_point(rng=seed)
    # Not drawn as the point was, or it would have next to no tangential part.
    vector = np.random.default_rng([seed, 1]).standard_normal((3, 3))
    vector = space.to_tangent(vector, start)
    vector /= np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = np.pi - 10.0**power if antipodal else 10.0**power
    end = space.metric.exp(angle * vector, start)
    back = space.metric.log(end, start)
    # Near the antipode a last digit of the end point turns the direction of the logarithm.
    gap = min(angle, np.pi - angle)
    np.testing.assert_allclose(np.linalg.norm(back, axis=-1), angle, rtol=1e-12, atol=8 * EPS)
    np.testing.assert_allclose(back, angle * vector, atol=20 * EPS * angle / min(1.0, gap))
    assert space.metric.dist(space.metric.exp(back, start), end) <= 50 * EPS


def test_accuracy_by_condition():
    """Print the largest relative errors of distances; the README quotes them."""
    rows = {}
    for number, family in enumerate(FAMILIES):
        for severity in (0.0, 0.5, 1.0):
            for mesh in MESHES:
                found = make(family, mesh, severity, number)
                if not found.legal:
                    continue
                decade = 2 * int(np.log10(found.condition_of_fields) / 2)
                row = rows.setdefault(decade, [0, 0.0, 0.0, 0.0])
                row[0] += 1
                for column, abc in ((1, (1.0, 1e-4, 0.0)), (2, (0.0, 0.0, 1.0))):
                    metric, allowance = elastic(found, *abc)
                    exact = float(exact_elastic(found, 0, 1, *abc) ** 0.5)
                    error = abs(metric.dist(*found.points[:2]) - exact)
                    assert error <= allowance + 1e-13 * exact
                    row[column] = max(row[column], error / scale_of_elastic(found, *abc))
                metric, allowance = srnf(found)
                exact = float(exact_srnf(found, 0, 1) ** 0.5)
                error = abs(metric.dist(*found.points[:2]) - exact)
                row[3] = max(row[3], error / scale_of_srnf(found))
    lines = ["", "condition    surfaces  shape  pose   SRNF  (error / scale)"]
    for decade, (count, *errors) in sorted(rows.items()):
        text = "  ".join(f"{error:.0e}" for error in errors)
        lines.append(f"{f'1e{decade} to 1e{decade + 2}':14}{count:5}  {text}")
    assert len(rows) > 3
    sys.stdout.write("\n".join(lines) + "\n")


@pytest.mark.parametrize("power", range(1, 13))
def test_energies_of_nearly_antipodal_normals_keep_their_digits(power):
    """The compiled energy took the angle from a chord of nearly 2, and lost half of its digits."""
    template = rh.Template([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    metric = rh.ElasticMetric(rh.AlignedSurfaces(template, equip=False), 0.0, 0.0, 1.0)
    angle = np.pi - 10.0**-power
    turn = [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    path = np.stack([template.vertices, template.vertices @ np.transpose(turn)])
    energy, gradient = metric.energy_and_gradient(path)
    np.testing.assert_allclose(energy, 0.5 * angle**2, rtol=1e-14)
    np.testing.assert_allclose(metric.energy(path), 0.5 * angle**2, rtol=1e-14)
    expected = [grad(metric.squared_dist, k)(*path) for k in (0, 1)]
    np.testing.assert_allclose(gradient, expected, rtol=1e-13, atol=1e-14)


def test_a_metric_that_loses_digits_is_convicted():
    class ByArcCosine(rh.SRNFMetric):
        """Cosines of angles, whose digits vanish for near surfaces."""

        def squared_dist(self, point_a, point_b):
            n, m = (self.space.normal_field(f) for f in (point_a, point_b))
            cosine = anp.clip(anp.sum(n * m, axis=-1), -1.0, 1.0)
            return anp.sum(self.space.template.face_areas * anp.arccos(cosine) ** 2, axis=-1)

    found = make("near", "open", 0.8, 3)
    _, allowance = elastic(found, 0.0, 0.0, 1.0)
    exact = float(exact_elastic(found, 0, 1, 0.0, 0.0, 1.0) ** 0.5)
    assert abs(ByArcCosine(found.space).dist(*found.points[:2]) - exact) > 10 * allowance
