"""Meshes whose spectra, volumes and symmetries are known."""

import numpy as np
import trimesh


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


def rolled_sheet(radius, **sizes):
    """Return the sheet bent into a part of a cylinder."""
    vertices, faces = sheet(**sizes)
    angle = vertices[:, 0] / radius
    rolled = [radius * np.sin(angle), vertices[:, 1], radius * (1 - np.cos(angle))]
    return np.stack(rolled, axis=1), faces


def flat_torus(n_columns, n_rows, width, height):
    """Return a torus glued of a rectangle, laid flat in the plane in four layers.

    Folding changes no length within the surface, and the layers share no vertex.
    """
    column, row = np.meshgrid(np.arange(n_columns), np.arange(n_rows))
    x = np.minimum(column, n_columns - column) * width / n_columns
    y = np.minimum(row, n_rows - row) * height / n_rows
    vertices = np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)
    return vertices, grid_faces(n_rows, n_columns, closed=True)


def torus_spectrum(width, height, count):
    """Return the eigenvalues 4π² (m² / width² + n² / height²), without the first zero."""
    m, n = np.meshgrid(np.arange(-20, 21), np.arange(-20, 21))
    values = 4 * np.pi**2 * ((m / width) ** 2 + (n / height) ** 2)
    return np.sort(values.ravel())[1 : count + 1]


def sphere_spectrum(count):
    """Return the eigenvalues l (l + 1), each 2 l + 1 times, without zero."""
    degree = np.arange(1, 30)
    return np.repeat(degree * (degree + 1), 2 * degree + 1)[:count].astype(float)


def grid_faces(n_rows, n_columns, closed=False):
    index = np.arange(n_rows * n_columns).reshape(n_rows, n_columns)
    if closed:
        index = np.pad(index, (0, 1), mode="wrap")
    corner, right, up, far = (
        block.ravel() for block in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    )
    return np.concatenate([np.stack([corner, right, far], 1), np.stack([corner, far, up], 1)])
