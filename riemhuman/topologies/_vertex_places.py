"""Places of one mesh's vertices on another mesh, and what has no place there.

In go two meshes in the same pose; out come `VertexPlaces`, which carry the vertices of one along
with other bodies of the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.io.mesh_arrays import distinct_pairs, triangle_sides
from riemhuman.io.mesh_seams import find_seams
from riemhuman.kernels.rotations import nearest_rotations
from riemhuman.kernels.surface import unit_vectors, vertex_normals
from riemhuman.surfaces.measures import triangle_areas, vertex_components
from riemhuman.surfaces.nearest_points import SurfacePoints, nearest_points_around

# A vertex farther from the other surface has no counterpart there, metres.
FARTHEST = 0.012
# The radius of the sphere of normals when places are searched: a palm and the thigh that it
# touches look different ways.
_NORMAL_METRES = 0.03
_N_NEAR = 8
# Rounds after which a vertex lies above its place, along the smooth normal there.
_N_ROUNDS = 8
# Separate parts with a smaller share of the area are no limbs: eyeballs, teeth, nails.
_SMALL_PART = 0.02
# Known vertices that carry a part without counterpart.
_N_ANCHORS = 60


@dataclass(frozen=True, eq=False)
class FilledPart:
    """A part of a mesh without counterpart, which moves with its surroundings."""

    name: str
    vertices: Integers  # (n,)
    anchors: Integers  # (k,) vertices with counterpart around it


@dataclass(frozen=True, eq=False)
class VertexPlaces:
    """Places of the vertices of a target mesh on a source mesh.

    A vertex lies at a height above a point of the source, along the interpolated normal. On other
    bodies, this offset turns with the neighbourhoods of the corners of the triangle, and grows with
    the local size of the source.

    Where weights were learned, as from a coarser source, they take the place of the offset.
    """

    faces: Triangles  # (F, 3) of the source
    n_source: int
    places: SurfacePoints  # of the target's vertices
    heights: Array  # (n,) metres, in the reference
    source: Array  # (n_source, 3) the reference surface of the source
    target: Array  # (n, 3) that of the target, in the same pose
    target_faces: Triangles
    parts: tuple[FilledPart, ...]
    columns: Integers | None = None  # (n, k) vertices of the source that are combined
    weights: Array | None = None  # (n, k)

    @cached_property
    def matrix(self) -> sparse.csr_array:
        """The matrix (n, n_source) that interpolates at the places."""
        corners = self.faces[self.places.triangles]
        return self._combining(corners, self.places.barycentric)

    @cached_property
    def reconstruction(self) -> sparse.csr_array | None:
        """The matrix (n, n_source) of the weights that were learned, or None."""
        if self.columns is None or self.weights is None:
            return None
        return self._combining(self.columns, self.weights)

    def _combining(self, columns: Integers, weights: Array) -> sparse.csr_array:
        rows = np.repeat(np.arange(len(columns)), columns.shape[1])
        entries = (weights.ravel(), (rows, columns.ravel()))
        return sparse.csr_array(entries, shape=(len(columns), self.n_source))

    @cached_property
    def _sizes(self) -> Array:
        return self._local_sizes(self.source)

    @cached_property
    def _normals(self) -> Array:
        return vertex_normals(self.source, self.faces)[:, np.newaxis, :]

    @cached_property
    def _around(self) -> sparse.csr_array:
        """The matrix (n, F) of the triangles at the corners of each place."""
        corner = self.faces.ravel()
        entries = np.ones(len(corner)), (corner, np.arange(len(corner)) // 3)
        at_vertices = sparse.csr_array(entries, shape=(self.n_source, len(self.faces)))
        at_places: sparse.csr_array = (abs(self.matrix) @ at_vertices).tocsr()
        return at_places

    @cached_property
    def _fillings(self) -> list[_Filling]:
        return [_make_filling(self.target, self.target_faces, part) for part in self.parts]

    def apply(self, surface: Array) -> Array:
        """Return the target's vertices for a surface of the source, shape (n_source, 3)."""
        points: Array
        if self.reconstruction is None:
            points = self._carried(surface)
        else:
            points = self.reconstruction @ surface
        for filling in self._fillings:
            points[filling.vertices] = filling.fill(points)
        return points

    def _carried(self, surface: Array) -> Array:
        """Return the target's vertices above their places."""
        # An offset is carried by the rotations of the corners: where the source bends, the height
        # along the normal alone would not follow the curve between its vertices.
        rotations = self._vertex_rotations(surface)
        blended = (self.matrix @ rotations.reshape(-1, 9)).reshape(-1, 3, 3)
        carried = np.einsum("nxy,ny->nx", rotations, self.source)
        offsets = np.einsum("nxy,ny->nx", blended, self.target) - self.matrix @ carried
        factors = self._local_sizes(surface) / self._sizes
        points: Array = self.matrix @ surface + factors[:, np.newaxis] * offsets
        return points

    @cached_property
    def _edges(self) -> Integers:
        """The vertices at both ends of each edge, in both directions, shape (E, 2)."""
        sides = triangle_sides(self.faces)
        return distinct_pairs(np.concatenate([sides, sides[:, ::-1]]))[0]

    def _vertex_rotations(self, surface: Array) -> Array:
        """Return rotations around the vertices from the reference, shape (n_source, 3, 3)."""
        start, end = self._edges.T
        before = self.source[end] - self.source[start]
        after = surface[end] - surface[start]
        products = after[:, :, np.newaxis] * before[:, np.newaxis, :]
        spread = np.zeros((self.n_source, 3, 3))
        np.add.at(spread, start, products)
        # Neighbours in a plane would not tell which side is outside.
        normals = vertex_normals(surface, self.faces)[:, :, np.newaxis] * self._normals
        size = np.linalg.norm(spread.reshape(-1, 9), axis=1)
        return nearest_rotations(spread + size[:, np.newaxis, np.newaxis] * normals)

    def _local_sizes(self, surface: Array) -> Array:
        areas = self._around @ triangle_areas(surface, self.faces)
        sizes: Array = np.sqrt(np.maximum(areas, np.finfo(float).tiny))
        return sizes


@dataclass(frozen=True, eq=False)
class _Filling:
    """A part that moves by the similarity of its anchors, and elastically where it is attached."""

    vertices: Integers  # (n,) of the part
    anchors: Integers  # (k,) vertices with counterpart around it
    ring: Integers  # (r,) vertices next to it
    extension: Array  # (n, r) matrix that extends values on the ring into the part
    # In the reference:
    part_points: Array  # (n, 3)
    anchor_points: Array  # (k, 3)
    ring_points: Array  # (r, 3)

    def fill(self, points: Array) -> Array:
        """Return the positions of the part, (n, 3), from those of the vertices around it."""
        moved = points[self.anchors]
        before, after = self.anchor_points.mean(axis=0), moved.mean(axis=0)
        centred, moved = self.anchor_points - before, moved - after
        rotation = nearest_rotations(moved.T @ centred)
        scale = np.linalg.norm(moved) / max(float(np.linalg.norm(centred)), np.finfo(float).tiny)
        ring = scale * (self.ring_points - before) @ rotation.T + after
        part: Array = scale * (self.part_points - before) @ rotation.T + after
        filled: Array = part + self.extension @ (points[self.ring] - ring)
        return filled


def _make_filling(target: Array, faces: Triangles, part: FilledPart) -> _Filling:
    """Return how a part of a target mesh follows its surroundings."""
    ring, extension = _harmonic_extension(target, faces, part.vertices)
    return _Filling(
        vertices=part.vertices,
        anchors=part.anchors,
        ring=ring,
        extension=extension,
        part_points=target[part.vertices],
        anchor_points=target[part.anchors],
        ring_points=target[ring],
    )


def _harmonic_extension(
    target: Array, faces: Triangles, vertices: Integers
) -> tuple[Integers, Array]:
    """Return the vertices around a part, and the matrix that extends values there into it."""
    inside = np.zeros(len(target), dtype=bool)
    inside[vertices] = True
    sides = triangle_sides(faces)
    sides = sides[inside[sides].any(axis=1)]
    lengths = np.linalg.norm(target[sides[:, 0]] - target[sides[:, 1]], axis=1)
    longest = float(lengths.max(initial=0.0))
    weights = 1.0 / np.maximum(lengths, max(1e-3 * longest, np.finfo(float).tiny))
    shape = (len(target), len(target))
    graph = sparse.csr_array((weights, (sides[:, 0], sides[:, 1])), shape=shape)
    graph = (graph + graph.T).tocsr()
    ring = np.setdiff1d(np.unique(sides), vertices)
    if not len(ring):
        return ring, np.zeros((len(vertices), 0))
    links = graph[vertices]
    # A vertex of no triangle is linked to nothing, and is carried by the anchors alone.
    degrees = links.sum(axis=1) + 1e-9 * weights.max()
    inner = sparse.diags_array(degrees) - links[:, vertices]
    extension: Array = splu(inner.tocsc()).solve(links[:, ring].toarray())
    return ring, extension


def place_vertices(
    target: Array,
    target_faces: Triangles,
    source: Array,
    faces: Triangles,
    usable: Booleans,
) -> tuple[SurfacePoints, Array, Array]:
    """Return places, heights and distances of a mesh's vertices on another that shares its pose.

    Triangles with a corner that is not usable, shape (n_source,), are no places. Each vertex lies
    at its height along the interpolated normal, not on the perpendicular of the triangle.
    """
    allowed = faces[usable[faces].all(axis=1)]
    numbers = np.flatnonzero(usable[faces].all(axis=1))
    used = np.unique(allowed)
    target_normals = vertex_normals(target, target_faces)
    normals = vertex_normals(source, faces)
    tree = cKDTree(np.concatenate([source[used], _NORMAL_METRES * normals[used]], axis=1))
    count = min(_N_NEAR, len(used))

    def nearest(queries: Array) -> tuple[SurfacePoints, Array]:
        both = np.concatenate([queries, _NORMAL_METRES * target_normals], axis=1)
        near = used[tree.query(both, k=range(1, count + 1))[1]]
        return nearest_points_around(queries, near, source, allowed)

    places, distances = nearest(target)
    heights = np.zeros(len(target))
    for _ in range(_N_ROUNDS):
        corners = allowed[places.triangles]
        points = np.einsum("nk,nkx->nx", places.barycentric, source[corners])
        along = unit_vectors(np.einsum("nk,nkx->nx", places.barycentric, normals[corners]))
        heights = np.einsum("nx,nx->n", target - points, along)
        # Slower where the normal turns fast: a full step may then overshoot.
        places, _ = nearest(target - 0.9 * heights[:, np.newaxis] * along)
    corners = allowed[places.triangles]
    points = np.einsum("nk,nkx->nx", places.barycentric, source[corners])
    along = unit_vectors(np.einsum("nk,nkx->nx", places.barycentric, normals[corners]))
    heights = np.einsum("nx,nx->n", target - points, along)
    return SurfacePoints(numbers[places.triangles], places.barycentric), heights, distances


def find_without_counterpart(vertices: Array, faces: Triangles, distances: Array) -> Booleans:
    """Return which vertices of a mesh have no counterpart at these distances, shape (V,)."""
    far = distances > FARTHEST
    component = joined_components(vertices, faces)
    areas = np.bincount(
        component[faces[:, 0]], triangle_areas(vertices, faces), minlength=component.max() + 1
    )
    shares = np.bincount(component, far) / np.bincount(component)
    # Eyeballs are near the lids in front; what hardly belongs to a surface is not part of it.
    inner = (areas < _SMALL_PART * areas.sum()) & (shares > 0.4)
    loose = ~np.isin(np.arange(len(vertices)), faces)
    without: Booleans = far | inner[component] | loose
    return without


def joined_components(vertices: Array, faces: Triangles) -> Integers:
    """Return the part of every vertex; those on both sides of a seam are in one."""
    seams = find_seams(vertices, faces)
    if not seams:
        return vertex_components(faces, len(vertices))
    joined: Integers = vertex_components(seams.faces, len(seams.originals))[seams.joined_vertices]
    return joined


def filled_parts(
    vertices: Array,
    faces: Triangles,
    without: Booleans,
    owners: Integers,
    joint_names: Sequence[str],
    leftward: Array,
) -> tuple[FilledPart, ...]:
    """Return the connected parts of a mesh without counterpart, the largest first.

    `owners`, shape (V,), are the joints of the nearest places on the model, and `leftward`, shape
    (V,), is positive on the body's left.
    """
    component = joined_components(vertices, faces)
    chosen = np.flatnonzero(without)
    sides = triangle_sides(faces)
    sides = sides[without[sides].all(axis=1)]
    labels = vertex_components(sides, len(vertices))[chosen]
    # Several pieces that are separate from the body, such as a row of teeth, are one part.
    whole = np.bincount(component, without) == np.bincount(component)
    labels = np.where(whole[component[chosen]], len(vertices) + component[chosen], labels)
    known = np.flatnonzero(~without)
    tree = cKDTree(vertices[known])
    parts, taken = [], dict[str, int]()
    groups = [chosen[labels == label] for label in np.unique(labels)]
    for numbers in sorted(groups, key=len, reverse=True):
        joint = joint_names[int(np.bincount(owners[numbers]).argmax())]
        separate = bool(whole[component[numbers[0]]])
        name = _part_name(vertices[numbers], joint, separate, float(leftward[numbers].mean()))
        taken[name] = taken.get(name, 0) + 1
        count = min(_N_ANCHORS, len(known))
        near = tree.query(vertices[numbers], k=range(1, min(4, count) + 1))[1].ravel()
        around = tree.query(vertices[numbers].mean(axis=0), k=range(1, count + 1))[1]
        anchors = known[np.union1d(near, around)]
        unique = name if taken[name] == 1 else f"{name} {taken[name]}"
        parts.append(FilledPart(unique, numbers, anchors))
    return tuple(parts)


def _part_name(points: Array, joint: str, separate: bool, left: float) -> str:
    """Return the name of a part: an eyeball is a sphere in the head."""
    radii = np.linalg.norm(points - points.mean(axis=0), axis=1)
    is_ball = len(points) > 20 and np.std(radii) < 0.15 * np.mean(radii)
    if separate and joint in ("head", "neck") and is_ball and 0.005 < np.mean(radii) < 0.025:
        return f"{'left' if left > 0 else 'right'} eyeball"
    where = joint.replace("_", " ")
    return f"separate part of the {where}" if separate else f"inside of the {where}"
