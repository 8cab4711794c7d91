"""Surfaces whose spectra, curvatures, girths, lengths and volumes are known."""

import numpy as np
import trimesh

from riemhuman.measurements import MeasurementSet
from riemhuman.surfaces.template import Template


def sphere(subdivisions=3, radius=1.0):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=radius)
    return np.array(mesh.vertices), np.array(mesh.faces)


def sheet(n_columns=21, n_rows=13, width=1.0, height=0.6):
    """Return a flat rectangle, a mesh with a border."""
    x, y = np.meshgrid(np.linspace(0, width, n_columns), np.linspace(0, height, n_rows))
    return np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), grid_faces(n_rows, n_columns)


def folded_sheet(angle, **sizes):
    """Return the sheet folded along its middle: lengths within it stay as they are."""
    vertices, faces = sheet(**sizes)
    middle = vertices[:, 0].max() / 2
    beyond = np.maximum(vertices[:, 0] - middle, 0.0)
    folded = vertices.copy()
    folded[:, 0] = np.minimum(vertices[:, 0], middle) + beyond * np.cos(angle)
    folded[:, 2] = beyond * np.sin(angle)
    return folded, faces


def flat_torus(n_columns, n_rows, width, height):
    """Return a torus glued of a rectangle, laid flat in the plane in four layers.

    Folding changes no length within the surface, and the layers share no vertex.
    """
    column, row = np.meshgrid(np.arange(n_columns), np.arange(n_rows))
    x = np.minimum(column, n_columns - column) * width / n_columns
    y = np.minimum(row, n_rows - row) * height / n_rows
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    return vertices, grid_faces(n_rows, n_columns, closed=(True, True))


def torus_spectrum(width, height, count):
    """Return the eigenvalues 4π² (m² / width² + n² / height²), without the first zero."""
    m, n = np.meshgrid(np.arange(-20, 21), np.arange(-20, 21))
    values = 4 * np.pi**2 * ((m / width) ** 2 + (n / height) ** 2)
    return np.sort(values.ravel())[1 : count + 1]


def sphere_spectrum(count):
    """Return the eigenvalues l (l + 1), each 2 l + 1 times, without zero."""
    degree = np.arange(1, 30)
    return np.repeat(degree * (degree + 1), 2 * degree + 1)[:count].astype(float)


def grid_faces(n_rows, n_columns, closed=(False, False)):
    """Return the triangles of a grid that may be closed along its columns and along its rows."""
    index = np.arange(n_rows * n_columns).reshape(n_rows, n_columns)
    index = np.pad(index, [(0, int(is_closed)) for is_closed in closed], mode="wrap")
    corner, right, up, far = (
        block.ravel() for block in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    )
    return np.concatenate([np.stack([corner, right, far], 1), np.stack([corner, far, up], 1)])


def tube(n_around, n_along, radius=0.15, length=0.8):
    """Return an open cylinder about the y axis."""
    angles = 2 * np.pi * np.arange(n_around) / n_around
    ring = np.stack([np.cos(angles), 0 * angles, np.sin(angles)], axis=1)
    rings = [radius * ring + [0.0, y, 0.0] for y in np.linspace(0.0, length, n_along)]
    faces = grid_faces(n_along, n_around, closed=(False, True))
    return Template(np.concatenate(rings), faces[:, ::-1])


def torus(n_around, n_along, major=0.4, minor=0.12):
    """Return a torus about the y axis, and the angles of its vertices around it and its tube."""
    u, v = 2 * np.pi * np.indices((n_along, n_around)).reshape(2, -1)
    u, v = u / n_along, v / n_around
    reach = major + minor * np.cos(v)
    points = np.stack([reach * np.sin(u), minor * np.sin(v), reach * np.cos(u)], axis=1)
    faces = grid_faces(n_along, n_around, closed=(True, True))
    return Template(points, faces[:, ::-1]), u, v


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
