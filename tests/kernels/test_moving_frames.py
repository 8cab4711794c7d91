"""Frames of triangles that compiled loops share, against NumPy; interpreted, as written."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad

from riemhuman.kernels import triangles

N_VERTICES, N_TIMES, TIME = 6, 3, 1
FACE = np.array([4, 1, 3])


@pytest.fixture
def corners():
    """Return surfaces vertex by vertex, and the corners of a triangle at one time."""
    surfaces = np.random.default_rng(0).standard_normal((N_VERTICES, N_TIMES, 3))
    return surfaces, surfaces[FACE, TIME]


@pytest.fixture
def noise():
    return np.random.default_rng(1).standard_normal((N_VERTICES, N_TIMES, 3))


def axes_and_sides(q):
    """Return e₁, e₂, e₃ as rows, and p, q, r in them."""
    normal = np.cross(q[1] - q[0], q[2] - q[0])
    along = (q[1] - q[0]) / np.linalg.norm(q[1] - q[0])
    normal /= np.linalg.norm(normal)
    axes = np.stack([along, np.cross(normal, along), normal])
    return axes, np.array([axes[:2] @ (q[1] - q[0]), axes[:2] @ (q[2] - q[0])]).T


def derivatives(q, h):
    """Return the derivatives along e₁ and e₂ of what is h at the corners, in the axes."""
    axes, sides = axes_and_sides(q)
    return axes @ np.stack([h[1] - h[0], h[2] - h[0]], axis=1) @ np.linalg.inv(sides)


def triangle_area(q):
    return 0.5 * anp.sqrt(anp.sum(anp.cross(q[1] - q[0], q[2] - q[0]) ** 2))


def test_frames(corners, monkeypatch):
    surfaces, q = corners
    axes, ((p, skewed), (_, r)) = axes_and_sides(q)
    found = triangles.frame_of.py_func(surfaces, FACE, TIME)
    numbers = [triangle_area(q), 1 / p, 1 / r, skewed / (p * r)]
    np.testing.assert_allclose(found, [*numbers, *axes.ravel()], atol=1e-13)
    monkeypatch.setattr(triangles, "frame_of", triangles.frame_of.py_func)
    filled = np.empty((3, 3))
    four = triangles.fill_axes.py_func(surfaces, FACE, TIME, filled)
    np.testing.assert_array_equal([*four, *filled.ravel()], found)


def test_derivatives_and_their_transpose(corners, noise):
    surfaces, q = corners
    frame = triangles.frame_of.py_func(surfaces, FACE, TIME)
    found = triangles.derivatives_in_frame.py_func(noise, FACE, TIME, frame)
    expected = derivatives(q, noise[FACE, TIME])
    np.testing.assert_allclose(np.reshape(found, (3, 2)), expected, atol=1e-13)
    entries = np.random.default_rng(2).standard_normal(6)
    slopes = np.ones_like(noise)
    triangles.add_to_corners.py_func(slopes, FACE, TIME, frame, tuple(entries))
    added = slopes - 1.0
    units = np.eye(9).reshape(9, 3, 3)
    wanted = [np.sum(entries * derivatives(q, h).ravel()) for h in units]
    np.testing.assert_allclose(added[FACE, TIME].ravel(), wanted, atol=1e-13)
    added[FACE, TIME] = 0.0
    assert not added.any()


def test_edges_and_the_slope_of_the_area(corners):
    surfaces, q = corners
    edges, slopes = np.empty((2, 3)), np.ones_like(surfaces)
    area = triangles.fill_edges.py_func(surfaces, FACE, TIME, edges)
    assert area == pytest.approx(triangle_area(q), rel=1e-14)
    np.testing.assert_array_equal(edges, [q[1] - q[0], q[2] - q[0]])
    triangles.add_area_slope.py_func(slopes, FACE, TIME, edges, area, 0.7)
    added = slopes - 1.0
    np.testing.assert_allclose(added[FACE, TIME], 0.7 * grad(triangle_area)(q), atol=1e-13)
    added[FACE, TIME] = 0.0
    assert not added.any()


@pytest.mark.parametrize("at", [0.0, 0.3, 1.0, 2.0], ids=str)
def test_triangles_without_area(corners, at):
    surfaces, _ = corners
    one, two, three = FACE
    surfaces[three, TIME] = (1 - at) * surfaces[one, TIME] + at * surfaces[two, TIME]
    area, _, over_r, skew, *axes = triangles.frame_of.py_func(surfaces, FACE, TIME)
    assert (area, over_r, skew) == (0.0, 0.0, 0.0)
    assert np.isfinite(axes).all()
    assert not np.any(axes[3:])
    assert triangles.fill_edges.py_func(surfaces, FACE, TIME, np.empty((2, 3))) == 0.0
