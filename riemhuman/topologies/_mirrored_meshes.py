"""Opposite vertices of symmetric meshes, and how maps use them.

In go two meshes of which one is registered to the other; out come the numbers of the opposite
vertices, -1 where there is none, and maps that treat both sides alike.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.bodies import BodyModel
from riemhuman.kernels.rotations import nearest_rotations
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.surfaces.measures import vertex_components
from riemhuman.surfaces.nearest_points import nearest_points
from riemhuman.topologies._vertex_places import FilledPart, joined_components, place_vertices

# Edges from which a mirror symmetry of a mesh is sought.
_N_SEEDS = 60
# Separate parts are no mirror images if their vertices are farther apart, in radii of the part:
# a sphere's net of triangles can often be twisted onto another's.
_MOST_TWISTED = 0.25
# Opposite places that are farther apart are not averaged, metres.
_FARTHEST_OPPOSITE = 0.03

_Edge = tuple[int, int]


@dataclass(frozen=True, eq=False)
class MirrorImages:
    """The opposite of each vertex on both meshes, or -1 if there is none."""

    template: Integers  # (n_template_vertices,)
    model: Integers  # (n_model_vertices,)


def find_images(
    reference: Array, faces: Triangles, registered: Array, model: BodyModel
) -> MirrorImages | None:
    """Return opposite vertices of a mesh and of the model registered to it, if both have them."""
    rest = model.template.vertices
    opposite = cKDTree(rest).query(rest * [-1.0, 1.0, 1.0])[1]
    model_image = mirrored_vertices(model.faces, len(rest), _seeds(model.faces, opposite))
    if model_image is None:
        return None
    model_image = with_separate_parts(model_image, model.faces, rest)
    if np.any(model_image < 0):
        return None
    on_model = nearest_points(reference, registered, model.faces)[0]
    corners = model.faces[on_model.triangles]
    mirrored = np.einsum("nk,nkx->nx", on_model.barycentric, registered[model_image[corners]])
    near = cKDTree(reference).query(mirrored)[1]
    image = mirrored_vertices(faces, len(reference), _seeds(faces, near))
    return None if image is None else MirrorImages(image, model_image)


def mirrored_vertices(
    faces: Triangles, n_vertices: int, seeds: Iterable[Sequence[int]]
) -> Integers | None:
    """Return the opposite of each vertex if a mesh is its own mirror image, else None.

    `seeds` are pairs of edges to try, (a, b, a', b'). Vertices of smaller separate parts get -1.
    """
    beyond = _third_corners(faces)
    main = int(np.bincount(vertex_components(faces, n_vertices)[faces[:, 0]]).max())
    for seed in seeds:
        image = _image_from_edge(beyond, main, seed)
        if image is not None and image.keys() == {*image.values()}:
            mirrored = np.full(n_vertices, -1)
            mirrored[list(image)] = list(image.values())
            return mirrored
    return None


def with_separate_parts(image: Integers, faces: Triangles, points: Array) -> Integers:
    """Return opposite vertices of separate parts, too, such as eyeballs.

    `points`, shape (V, 3), are nearly symmetric about x = 0. Parts that are no mirror image of
    another part, or of themselves, keep -1.
    """
    completed = image.copy()
    component = vertex_components(faces, len(points))
    candidates = np.intersect1d(np.flatnonzero(image < 0), faces)
    if not len(candidates):
        return completed
    beyond = _third_corners(faces)
    reflected = points * [-1.0, 1.0, 1.0]
    near = candidates[cKDTree(points[candidates]).query(reflected)[1]]
    for label in np.unique(component[candidates]):
        part_faces = faces[component[faces[:, 0]] == label]
        if completed[part_faces[0, 0]] >= 0:
            continue
        # A sphere has many mirror images: use the nearest one.
        nearest, shortest = None, _MOST_TWISTED
        for seed in _seeds(part_faces, near):
            matched_vertices = _image_from_edge(beyond, len(part_faces), seed)
            if matched_vertices is None:
                continue
            ones, others = np.array([*matched_vertices]), np.array([*matched_vertices.values()])
            distance = _difference_in_shape(reflected[ones], points[others])
            if distance < shortest and np.all(completed[others] < 0):
                nearest, shortest = (ones, others), distance
        if nearest is not None:
            ones, others = nearest
            completed[ones], completed[others] = others, ones
    return completed


def _difference_in_shape(first: Array, second: Array) -> float:
    """Return the mean distance of points, whose centres are aligned, in radii."""
    first, second = first - first.mean(axis=0), second - second.mean(axis=0)
    radius = np.linalg.norm(second, axis=1).mean()
    distance = np.linalg.norm(first - second, axis=1).mean()
    return float(distance / max(radius, np.finfo(float).tiny))


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


def symmetric_places(
    reference: Array,
    faces: Triangles,
    registered: Array,
    model_faces: Triangles,
    images: MirrorImages,
) -> Array:
    """Return the model's surface on a mesh in any pose, with places averaged over both sides."""
    image, model_image = images.template, images.model
    image = np.where(image < 0, np.arange(len(image)), image)
    everywhere = np.ones(len(reference), dtype=bool)
    places, heights, gaps = place_vertices(registered, model_faces, reference, faces, everywhere)
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


def symmetric_points(points: Array, image: Integers, faces: Triangles) -> Array:
    """Return points with opposite ones averaged about x = 0; those without an opposite stay.

    Separate parts that are opposite each other get the shape of one of them: the mean of two
    eyeballs that are turned differently is smaller than either.
    """
    mirror = np.array([-1.0, 1.0, 1.0])
    averaged = np.where(
        (image >= 0)[:, np.newaxis], 0.5 * (points + points[image] * mirror), points
    )
    component = joined_components(points, faces)
    opposite = np.where(image >= 0, component[image], component)
    for label in np.unique(component[component < opposite]):
        part = np.flatnonzero((component == label) & (component < opposite))
        before, after = points[part], averaged[part]
        middle = after.mean(axis=0)
        before, after = before - before.mean(axis=0), after - middle
        averaged[part] = before @ nearest_rotations(after.T @ before).T + middle
        averaged[image[part]] = averaged[part] * mirror
    return averaged


def on_both_sides(chosen: Booleans, image: Integers) -> Booleans:
    """Return which vertices are chosen, shape (V,), themselves or on the other side."""
    either: Booleans = chosen | ((image >= 0) & chosen[image])
    return either


def symmetric_parts(parts: Sequence[FilledPart], image: Integers) -> tuple[FilledPart, ...]:
    """Return parts whose anchors on one side are opposite those on the other."""
    numbers = {frozenset(part.vertices.tolist()): number for number, part in enumerate(parts)}
    mended = list(parts)
    for number, part in enumerate(parts):
        opposite = numbers.get(frozenset(image[part.vertices].tolist()))
        anchors = part.anchors[image[part.anchors] >= 0]
        if opposite is None or not len(anchors):
            continue
        if opposite == number:
            anchors = np.union1d(anchors, image[anchors])
            mended[number] = replace(part, anchors=anchors)
        elif opposite > number:
            mended[number] = replace(part, anchors=anchors)
            mended[opposite] = replace(parts[opposite], anchors=np.sort(image[anchors]))
    return tuple(mended)
