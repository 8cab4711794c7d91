"""Triangulations of surfaces whose curvatures and integrals are known."""

import numpy as np
import trimesh

from riemhuman.surfaces import Template


def sphere(subdivisions, radius=1.0):
    """Return an icosphere."""
    mesh = trimesh.creation.icosphere(subdivisions, radius)
    return Template(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def torus(n, major=1.0, minor=0.4):
    """Return a torus of 2n × n vertices and the angles of these, around it and about its tube."""
    u, v = np.meshgrid(
        2 * np.pi * np.arange(2 * n) / (2 * n), 2 * np.pi * np.arange(n) / n, indexing="ij"
    )
    reach = major + minor * np.cos(v)
    points = np.stack([reach * np.cos(u), reach * np.sin(u), minor * np.sin(v)], axis=-1)
    here = np.arange(2 * n * n).reshape(2 * n, n)
    right, up = np.roll(here, -1, 0), np.roll(here, -1, 1)
    both = np.roll(right, -1, 1)
    faces = np.stack([np.stack([here, right, both], -1), np.stack([here, both, up], -1)])
    return Template(points.reshape(-1, 3), faces.reshape(-1, 3)), u.ravel(), v.ravel()
