"""Surfaces whose girths, lengths and volumes are known, and measurements of them."""

import numpy as np

from riemhuman.measurements import MeasurementSet
from riemhuman.surfaces.template import Template


def tube(n_around, n_along, radius=0.15, length=0.8):
    """Return an open cylinder about the y axis."""
    angles = 2 * np.pi * np.arange(n_around) / n_around
    ring = np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    rings = [radius * ring + [0.0, y, 0.0] for y in np.linspace(0.0, length, n_along)]
    return Template(np.concatenate(rings), _grid(n_around, n_along, closed=False))


def torus(n_around, n_along, major=0.4, minor=0.12):
    """Return a torus about the y axis."""
    u = 2 * np.pi * np.arange(n_along)[:, np.newaxis] / n_along
    v = 2 * np.pi * np.arange(n_around) / n_around
    radius = major + minor * np.cos(v)
    points = [radius * np.cos(u), 0 * u + minor * np.sin(v), radius * np.sin(u)]
    faces = _grid(n_around, n_along, closed=True)
    return Template(np.stack(points, axis=-1).reshape(-1, 3), faces)


def ellipsoid(n, axes=(0.2, 0.5, 0.12)):
    """Return an ellipsoid: a cube's grid blown up."""
    steps = np.tan(np.linspace(-np.pi / 4, np.pi / 4, n + 1))
    points, faces = [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            a, b = np.meshgrid(steps, steps, indexing="ij")
            cube = np.empty((n + 1, n + 1, 3))
            cube[..., axis], cube[..., (axis + 1) % 3], cube[..., (axis + 2) % 3] = sign, a, b
            first = len(points) * (n + 1) ** 2
            numbers = first + np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
            p, q = numbers[:-1, :-1].ravel(), numbers[1:, :-1].ravel()
            r, s = numbers[1:, 1:].ravel(), numbers[:-1, 1:].ravel()
            both = np.concatenate([np.stack([p, q, r], 1), np.stack([p, r, s], 1)])
            faces.append(both if sign > 0 else both[:, ::-1])
            points.append(cube.reshape(-1, 3))
    points = np.concatenate(points)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    kept, numbers = np.unique(points.round(9), axis=0, return_inverse=True)
    return Template(kept * axes, numbers.reshape(-1)[np.concatenate(faces)])


def set_at(template, measurements, **places):
    """Return measurements at landmarks, which are the surface points nearest to some places."""
    from riemhuman.surfaces.nearest_points import nearest_points

    points = np.array(list(places.values()), dtype=float)
    nearest, _ = nearest_points(points, template.vertices, template.faces)
    landmarks = {
        name: (template.faces[face], weight)
        for name, face, weight in zip(places, *nearest, strict=True)
    }
    return MeasurementSet(template, measurements, landmarks)


def _grid(n_around, n_along, *, closed):
    rows = np.arange(n_along if closed else n_along - 1)[:, np.newaxis]
    columns = np.arange(n_around)
    after, above = (columns + 1) % n_around, (rows + 1) % n_along
    p, q = rows * n_around + columns, above * n_around + columns
    r, s = above * n_around + after, rows * n_around + after
    return np.concatenate(
        [np.stack([p, q, r], -1).reshape(-1, 3), np.stack([p, r, s], -1).reshape(-1, 3)]
    )
