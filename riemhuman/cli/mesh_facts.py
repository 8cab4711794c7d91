"""The size and the defects of a single mesh."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from riemhuman.errors import ArgumentError
from riemhuman.surfaces.distortion import signed_volume, triangle_areas
from riemhuman.surfaces.template import Template
from riemhuman.units import likely_units


def mesh_facts(vertices: np.ndarray, faces: np.ndarray) -> dict[str, Any]:
    """Return counts, sizes and defects of a mesh.

    Parameters
    ----------
    vertices : array, shape (V, 3)
        Vertex positions, in the unit of the file.
    faces : array of int, shape (F, 3)
        Triangles.

    Returns
    -------
    dict
        Numbers and strings by name, in types that JSON can hold.
    """
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    _, n_triangles = np.unique(np.sort(sides, axis=1), axis=0, return_counts=True)
    _, n_directed = np.unique(sides, axis=0, return_counts=True)
    used = np.unique(faces)
    graph = sparse.coo_array((np.ones(len(sides)), sides.T), shape=(len(vertices),) * 2)
    _, part = connected_components(graph, directed=False)
    extents = np.ptp(vertices[used], axis=0)
    closed = bool((n_triangles == 2).all())
    oriented = bool((n_directed == 1).all())
    return {
        "vertices": len(vertices),
        "triangles": len(faces),
        "edges": len(n_triangles),
        "parts": len(np.unique(part[used])),
        "closed": closed,
        "boundary_edges": int((n_triangles == 1).sum()),
        "non_manifold_edges": int((n_triangles > 2).sum()),
        "consistently_oriented": oriented,
        "unused_vertices": len(vertices) - len(used),
        "coincident_vertices": len(vertices) - len(np.unique(vertices, axis=0)),
        "degenerate_triangles": _n_degenerate(vertices, faces),
        "extents": extents.tolist(),
        "area": float(triangle_areas(vertices, faces).sum()),
        "volume": float(signed_volume(vertices, faces)) if closed and oriented else None,
        "unit_guess": _unit(float(extents.max())),
        "usable_as_template": _template_problem(vertices, faces) or "yes",
    }


def _n_degenerate(vertices: np.ndarray, faces: np.ndarray) -> int:
    """Return the number of triangles whose height is zero up to rounding."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).max(axis=1)
    return int((2 * triangle_areas(vertices, faces) <= 1e-12 * longest**2).sum())


def _unit(extent: float) -> str:
    """Return the units in which a body can have this largest extent."""
    return " or ".join(likely_units(extent)) or "none: no human body has this size"


def _template_problem(vertices: np.ndarray, faces: np.ndarray) -> str | None:
    try:
        Template(vertices, faces)
    except ArgumentError as error:
        return f"no: {error}"
    return None
