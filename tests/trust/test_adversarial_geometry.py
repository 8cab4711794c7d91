"""The elastic metric on legal surfaces that rounding does not like: slivers, far, flat, coincident.

The condition κ of surfaces is the largest coordinate over the least height of a triangle, the
template's included: a relative error ε of coordinates moves a triangle by εκ of its height, and so
a distance by εκ times the scale of the metric, and by a small factor more. What a metric owes on
other surfaces is in `tests/geometry`.
"""

from __future__ import annotations

import numpy as np
import pytest
from autograd import grad
from mpmath import mp
from oracles import exact_arc, exact_squared_dist

import riemhuman as rh

# Derivatives are taken by the chain rule from edges: what overflows or divides by 0 is an error.
pytestmark = pytest.mark.filterwarnings("error")

EPS = float(np.finfo(np.float64).eps)
ROUNDING = 4.0
PAIRS = [(0, 1), (0, 2), (1, 2)]
MESHES = {
    "one triangle": [[0, 1, 2]],
    "open": [[0, 1, 2], [1, 3, 2], [2, 3, 4]],
    "an edge of three triangles": [[0, 1, 2], [1, 0, 3], [0, 1, 4], [4, 1, 5]],
    "closed": [
        [0, 1, 2],
        [1, 3, 2],
        [3, 4, 2],
        [4, 0, 2],
        [1, 0, 5],
        [3, 1, 5],
        [4, 3, 5],
        [0, 4, 5],
    ],
}
OCTAHEDRON = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]])
FAMILIES = (
    *("plain", "slivers", "tiny", "huge", "far", "flat folds", "antipodal", "coincident", "near"),
    *("sliver template", "single precision"),
)


def surfaces(family, mesh, severity, seed):
    """Return a template and three surfaces, as bad as the severity from 0 to 1 says."""
    rng = np.random.default_rng(seed)
    faces = np.array(MESHES[mesh])
    start = OCTAHEDRON[: faces.max() + 1] + rng.uniform(-0.2, 0.2, (faces.max() + 1, 3))
    points = start + rng.uniform(-0.3, 0.3, (3, *start.shape))
    template = start
    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    # Everything but lies on a line: heights of 1e-6 of a side.
    squeeze = turn @ np.diag([1.0, 10 ** (-6 * severity), 10 ** (-6 * severity)]) @ turn.T
    if family == "slivers":
        points = points @ squeeze
    elif family == "sliver template":
        template = template @ squeeze
    elif family == "tiny":
        points, template = 10 ** (-6 * severity) * points, 10 ** (-6 * severity) * template
    elif family == "huge":
        points = 10 ** (6 * severity) * points
    elif family == "far":
        points = points + 10 ** (4 * severity) * turn[0]
    elif family == "flat folds":
        points[..., 2] *= 10 ** (-8 * severity)
        points[..., :2] += rng.uniform(-0.3, 0.3, points[..., :2].shape)
    elif family == "antipodal":
        points[1] = points[0] @ np.diag([1.0, 1.0, 10 ** (-2 - 6 * severity)])
        points[2] = points[1] * np.array([-1.0 if seed % 2 else 1.0, 1.0, -1.0])
    elif family == "coincident":
        points[1] = points[0]
        points[2] = points[0] + 0.1 * turn[0]
    elif family == "near":
        points = points[0] + 10 ** (-12 * severity) * (points - points[0])
    elif family == "single precision":
        points = points.astype(np.float32).astype(np.float64)
    return rh.AlignedSurfaces(rh.Template(template, faces), equip=False, scale=None), points


def draw(rng):
    """Return surfaces whose triangles have areas, and weights (a, λ, c)."""
    names = str(rng.choice(FAMILIES)), str(rng.choice(list(MESHES)))
    space, points = surfaces(*names, rng.uniform(), int(rng.integers(2**16)))
    abc = rng.choice([1e-3, 1.0, 1e3]), 10 ** rng.uniform(-8.0, 4.0), rng.choice([1e-2, 1.0, 1e2])
    try:
        space.check_immersed(points)
    except rh.RiemhumanError:
        space, points = surfaces("plain", "open", 0.0, 0)
    return space, points, abc


def areas(vertices, faces):
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def condition(vertices, faces):
    """Return the largest coordinate over the least height."""
    corners = vertices[faces]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
    return float(np.abs(vertices).max() / (2 * areas(vertices, faces) / sides.max(axis=1)).min())


def rounding(template, points, a, lam, c):
    """Return how far relative errors ε of coordinates move a distance.

    A change η of the edges relative to the heights changes g by 2η g at most in every direction,
    which is √(2 + 4λ) 2η √area in the Ebin metric, but never more than 8 √(λ area), twice the way
    to the apex; and a normal by η.
    """
    area = max(areas(point, template.faces).sum() for point in points)
    ebin = 2 * min(np.sqrt(2 + 4 * lam), 4 * np.sqrt(lam) / EPS) * np.sqrt(area)
    scale = np.sqrt(a) * ebin + np.sqrt(c * template.face_areas.sum())
    return EPS * scale * max(condition(s, template.faces) for s in (template.vertices, *points))


def exact_elastic(template, points, a, lam, c):
    """Return the squared distance of two surfaces with 60 digits."""
    total = mp.mpf(0)
    for face in template.faces:
        f, g, t = (edges(surface[face]) for surface in (*points, template.vertices))
        if a:
            total += mp.mpf(a) * exact_squared_dist(f.T * f, g.T * g, lam) / 2
        if c:
            total += mp.mpf(c) * mp.norm(normal(t)) / 2 * exact_arc(normal(f), normal(g)) ** 2
    return total


def edges(corners):
    """Return two edge vectors as columns."""
    p = [mp.matrix([mp.mpf(float(x)) for x in corner]) for corner in corners]
    u, v = p[1] - p[0], p[2] - p[0]
    return mp.matrix([[u[k], v[k]] for k in range(3)])


def normal(e):
    """Return the cross product of the two columns."""
    (a, d), (b, f), (c, g) = ((e[k, 0], e[k, 1]) for k in range(3))
    return mp.matrix([b * g - c * f, c * d - a * g, a * f - b * d])


METRICS = {
    "shape": lambda a, lam, c: (1.0, lam, 0.0),
    "pose": lambda a, lam, c: (0.0, 0.0, 1.0),
    "mixed": lambda a, lam, c: (a, lam, c),
}


def check_distances(metric, points, weights):
    """Distances are those of 60 digits, and satisfy the axioms."""
    template = metric.space.template
    error = ROUNDING * rounding(template, points, *weights)
    distances = []
    for i, j in PAIRS:
        expected = float(exact_elastic(template, points[[i, j]], *weights) ** 0.5)
        found = metric.dist(points[i], points[j])
        assert abs(found - expected) <= error + 1e-13 * expected
        assert found == metric.dist(points[j], points[i]) >= 0
        distances.append(found)
    assert all(metric.dist(point, point.copy()) == 0 for point in points)
    xy, xz, yz = distances
    assert xz <= xy + yz + 3 * error + 1e-13 * (xy + yz)


def check_gradients(metric, points, weights):
    """Gradients are finite everywhere, and 0 where surfaces coincide."""
    for i, j in [*PAIRS, (0, 0)]:
        for argument in (0, 1):
            for function in (metric.squared_dist, metric.dist):
                gradient = grad(function, argument)(points[i], points[j].copy())
                assert np.isfinite(gradient).all()
                assert i != j or not gradient.any()
    assert np.isfinite(grad(metric.energy)(points)).all()


@pytest.mark.everyday
@pytest.mark.parametrize(
    "seeds", [range(1), pytest.param(range(1, 25), marks=pytest.mark.slow)], ids=["one", "others"]
)
@pytest.mark.parametrize("check", [check_distances, check_gradients])
@pytest.mark.parametrize("name", METRICS)
def test_metrics(name, check, seeds):
    for seed in seeds:
        rng = np.random.default_rng([seed, *name.encode(), *check.__name__.encode()])
        space, points, weights = draw(rng)
        weights = METRICS[name](*weights)
        check(rh.ElasticMetric(space, *weights), points, weights)


@pytest.mark.parametrize("power", [1, 4, 7, 8, 9, 12])
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
