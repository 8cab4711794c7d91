"""Registered surfaces that treat both sides alike, between meshes that are their own mirror images.

A registration slips by millimetres, on the left in other ways than on the right: unless places are
averaged over both sides, girths of a limb differ from those of the other by more than a centimetre.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Integers, Triangles
from riemhuman.bodies import BodyModel
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.surfaces.measures import vertex_components
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.topologies._vertex_places import place_vertices

# Edges from which a mirror symmetry of a mesh is sought.
_N_SEEDS = 60
# Opposite places that are farther apart are not averaged, metres.
_FARTHEST_OPPOSITE = 0.03

_Edge = tuple[int, int]


def symmetric_surface(
    reference: Array, faces: Triangles, registered: Array, model: BodyModel
) -> Array:
    """Return the model's surface on a mesh in any pose, with places averaged over both sides.

    If one of the two meshes is not symmetric, it is the surface as it was registered.
    """
    rest = model.template.vertices
    opposite = cKDTree(rest).query(rest * [-1.0, 1.0, 1.0])[1]
    model_image = mirrored_vertices(model.faces, len(rest), _seeds(model.faces, opposite))
    if model_image is None:
        return registered
    on_model = nearest_points(reference, registered, model.faces)[0]
    corners = model.faces[on_model.triangles]
    mirrored = np.einsum("nk,nkx->nx", on_model.barycentric, registered[model_image[corners]])
    near = cKDTree(reference).query(mirrored)[1]
    image = mirrored_vertices(faces, len(reference), _seeds(faces, near))
    if image is None:
        return registered
    everywhere = np.ones(len(reference), dtype=bool)
    places, heights, gaps = place_vertices(registered, model.faces, reference, faces, everywhere)
    normals = vertex_normals(reference, faces)
    corners = image[faces[places.triangles[model_image]]]
    barycentric = places.barycentric[model_image]
    along = unit_vectors(np.einsum("nk,nkx->nx", barycentric, normals[corners]))
    opposite = np.einsum("nk,nkx->nx", barycentric, reference[corners])
    opposite += heights[model_image, np.newaxis] * along
    both = (gaps < _FARTHEST_OPPOSITE) & (gaps[model_image] < _FARTHEST_OPPOSITE)
    both &= np.linalg.norm(opposite - registered, axis=1) < _FARTHEST_OPPOSITE
    averaged: Array = np.where(both[:, np.newaxis], 0.5 * (registered + opposite), registered)
    return averaged


def mirrored_vertices(
    faces: Triangles, n_vertices: int, seeds: Iterable[Sequence[int]]
) -> Integers | None:
    """Return the opposite of each vertex if a mesh is its own mirror image, else None.

    `seeds` are pairs of edges to try, (a, b, a', b'). Vertices of smaller separate parts stay where
    they are.
    """
    beyond = _third_corners(faces)
    main = int(np.bincount(vertex_components(faces, n_vertices)[faces[:, 0]]).max())
    for seed in seeds:
        image = _image_from_edge(beyond, main, seed)
        if image is not None and image.keys() == {*image.values()}:
            mirrored = np.arange(n_vertices)
            mirrored[list(image)] = list(image.values())
            return mirrored
    return None


def _third_corners(faces: Triangles) -> dict[_Edge, int]:
    """Return the third corner of the triangle at each directed edge."""
    beyond = {}
    for first, second, third in faces.tolist():
        beyond[first, second], beyond[second, third], beyond[third, first] = third, first, second
    return beyond


def _image_from_edge(
    beyond: Mapping[_Edge, int], n_faces: int, seed: Sequence[int]
) -> dict[int, int] | None:
    """Return the images of a connected part's vertices, from that of one edge.

    The third corner of a triangle goes to that of the triangle on the other side.
    """
    first, second, image_of_first, image_of_second = seed
    image = {first: image_of_first, second: image_of_second}
    queue, passed = [(first, second)], set[_Edge]()
    while queue:
        edge = queue.pop()
        if edge in passed or edge not in beyond:
            continue
        passed.add(edge)
        third = beyond[edge]
        opposite = beyond.get((image[edge[1]], image[edge[0]]))
        if opposite is None or image.setdefault(third, opposite) != opposite:
            return None
        queue += [(edge[0], third), (third, edge[1])]
        queue += [(third, edge[0]), (edge[1], third), (edge[1], edge[0])]
    is_whole = len(passed) >= 3 * n_faces - 1
    is_reflection = all(image.get(value, key) == key for key, value in image.items())
    is_one_to_one = len({*image.values()}) == len(image)
    return image if is_whole and is_reflection and is_one_to_one else None


def _seeds(faces: Triangles, opposite: Integers) -> list[list[int]]:
    """Return some edges and where they may be on the other side."""
    chosen = np.linspace(0, len(faces) - 1, min(_N_SEEDS, len(faces))).astype(np.int64)
    edges = faces[chosen, :2]
    seeds: list[list[int]] = np.concatenate([edges, opposite[edges]], axis=1).tolist()
    return seeds
