"""The template T, a triangle mesh: every registered surface is a map f: T -> R^3."""

from __future__ import annotations

import os
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from riemhuman.arrays import Array, Integers, Points, Triangles
from riemhuman.checks import (
    check_human_size,
    check_resolution,
    integer_array,
    is_human_size,
    real_array,
)
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.io.mesh_arrays import (
    check_faces,
    check_mesh,
    distinct_pairs,
    face_difference,
    read_only,
    triangle_sides,
)
from riemhuman.io.mesh_seams import Seams, common_seams, find_seams
from riemhuman.io.meshes import (
    as_arrays,
    load_mesh,
    save_mesh,
    to_trimesh,
)
from riemhuman.kernels.surface import cotangent_laplacian, doubled_area_vectors
from riemhuman.surfaces._heat import HeatFlow, TriangleHeat
from riemhuman.surfaces._poisson import PoissonInterpolator
from riemhuman.surfaces.measures import body_size, is_closed

if TYPE_CHECKING:
    import trimesh

# A triangle is flat if its height is within rounding of zero: relative to its longest side, or to
# the coordinates from which it was computed.
_FLAT_HEIGHT = 1e-12
_ROUNDING = 4 * np.finfo(np.float64).eps


class Template:
    """A triangle mesh; quantities that depend only on the mesh are computed once.

    Each triangle t carries an orthonormal frame in which its corners are (0, 0), (u2, 0) and
    (u3, v3). A surface f is linear on it, with derivatives

        f_u = (q2 - q1) / u2,    f_v = (q3 - q1) / v3 - u3 / (v3 u2) (q2 - q1),

    where q1, q2, q3 are the corners of the triangle on f [1]_.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        Vertex positions, in metres; or, without `faces`, a mesh of trimesh or PyVista.
    faces : array_like, shape (F, 3), optional
        Vertex indices of each triangle, counted from 0. The mesh may be open or non-manifold. A
        vertex that no triangle uses is allowed, and the metrics ignore it.

    Raises
    ------
    DegenerateSurfaceError
        If a triangle has no area. Slivers are allowed; collinear corners are not.

    References
    ----------
    .. [1] Pierson, Daoudi, Tumpach, "A Riemannian Framework for Analysis of Human Body Surface",
       WACV 2022, supplement; corrected: u3 / v3 is the cotangent of the angle at the first corner.

    Examples
    --------
    >>> template = rh.Template([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> template.face_areas.tolist()
    [0.5]
    """

    def __init__(self, vertices: object, faces: ArrayLike | None = None) -> None:
        if faces is None:
            vertices, faces = as_arrays(vertices)
        points, triangles = check_mesh(vertices, faces)
        check_resolution(points, "vertices", getattr(vertices, "dtype", None))
        check_faces(
            np.any(triangles == np.roll(triangles, 1, axis=1), axis=1),
            triangles,
            "refers to the same vertex twice; the corners of a triangle must differ",
        )
        self._vertices = read_only(points.copy())
        # Compiled loops expect one memory layout, whatever that of the argument.
        self._faces = read_only(np.ascontiguousarray(triangles))
        self._face_areas, self._frame_coefficients = _areas_and_frames(self._vertices, self._faces)

    @classmethod
    def from_file(cls, path: str | os.PathLike[str], *, seams: str = "keep") -> Template:
        """Read a template from a mesh file, see `riemhuman.load_mesh`, in its order of vertices.

        Parameters
        ----------
        path : path_like
        seams : {"keep", "join"}
            See `riemhuman.load_mesh`.
        """
        vertices, faces = load_mesh(path, seams=seams)
        try:
            return cls(vertices, faces)
        except ArgumentError as error:
            raise type(error)(f"{os.fspath(path)}: {error}") from error

    def join_seams(self, points: ArrayLike | None = None) -> tuple[Template, Seams]:
        """Return the template without vertices duplicated along seams, and the map to it and back.

        Exporters duplicate vertices where texture coordinates or normals jump. Distances ignore
        such seams; solvers that move every vertex would tear them, and issue a warning.

        Parameters
        ----------
        points : array_like, shape (..., V, 3), optional
            Surfaces in which the seams must also coincide to be joined.

        Returns
        -------
        template : Template
            With W vertices.
        seams : Seams
            ``seams.join(points)`` has shape (..., W, 3), ``seams.split(joined)`` (..., V, 3).
        """
        seams = self.seams
        if points is not None:
            seams = common_seams(seams, self.check_points(points), self.faces)
        return Template(seams.join(self.vertices), seams.faces), seams

    def to_trimesh(self, points: ArrayLike | None = None) -> trimesh.Trimesh:
        """Return the template, or a surface registered to it, as a trimesh mesh.

        Parameters
        ----------
        points : array_like, shape (V, 3), optional
            The surface; by default the template itself.
        """
        surface = self.vertices if points is None else self.check_points(points)
        return to_trimesh(surface, self.faces)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the template to a PLY, OBJ, OFF or GLB file.

        Parameters
        ----------
        path : path_like
            The mesh file, whose suffix gives its format.
        """
        save_mesh(path, self.vertices, self.faces)

    @property
    def vertices(self) -> Array:
        """Vertex positions, shape (V, 3), read-only, in metres."""
        return self._vertices

    @property
    def faces(self) -> Triangles:
        """Vertex indices of each triangle, shape (F, 3), read-only int64."""
        return self._faces

    @property
    def n_vertices(self) -> int:
        """Number of vertices V."""
        return len(self._vertices)

    @property
    def n_faces(self) -> int:
        """Number of triangles F."""
        return len(self._faces)

    @property
    def face_areas(self) -> Array:
        """Triangle areas w_t, shape (F,), read-only, in square metres."""
        return self._face_areas

    @property
    def frame_coefficients(self) -> Array:
        """The numbers (1/u2, 1/v3, u3/(v3 u2)) of each triangle, shape (F, 3), read-only."""
        return self._frame_coefficients

    @cached_property
    def vertex_areas(self) -> Array:
        """A third of the area of the triangles around each vertex, shape (V,), read-only."""
        return read_only(self._areas_around_vertices(self.faces))

    @cached_property
    def edges(self) -> Integers:
        """Each undirected edge once, lower vertex index first, shape (E, 2), read-only int64."""
        return read_only(distinct_pairs(np.sort(triangle_sides(self.faces), axis=1))[0])

    @cached_property
    def is_closed(self) -> bool:
        """Whether every edge belongs to two triangles, which pass it in opposite directions."""
        return is_closed(self.faces)

    @cached_property
    def body_size(self) -> tuple[float, float]:
        """Largest extent in metres, and volume in cubic metres, NaN if open or flat."""
        return body_size(self.vertices, self.faces if self.is_closed else None)

    @cached_property
    def seams(self) -> Seams:
        """Pairs of border edges that coincide, see `riemhuman.io.find_seams`."""
        return find_seams(self.vertices, self.faces)

    @property
    def joined_faces(self) -> Triangles:
        """Triangles over the first copy of every vertex that seams double, shape (F, 3)."""
        return self.seams.first_copies[self.faces] if self.seams else self.faces

    @cached_property
    def differential_operator(self) -> sparse.csr_array:
        """Sparse matrix of shape (2F, V): row t yields f_u, row F + t yields f_v of triangle t."""
        first, second, third = self.faces.T
        inverse_u2, inverse_v3, shear = self.frame_coefficients.T
        along_u = np.arange(self.n_faces)
        along_v = along_u + self.n_faces
        return sparse.csr_array(
            (
                np.concatenate([-inverse_u2, inverse_u2, shear - inverse_v3, -shear, inverse_v3]),
                (
                    np.concatenate([along_u, along_u, along_v, along_v, along_v]),
                    np.concatenate([first, second, first, second, third]),
                ),
            ),
            shape=(2 * self.n_faces, self.n_vertices),
        )

    @cached_property
    def assembler(self) -> TriangleAssembler:
        """Assembler of triangle matrices into sparse (3V, 3V) matrices."""
        return TriangleAssembler(self.faces, self.n_vertices)

    @cached_property
    def interpolator(self) -> PoissonInterpolator:
        """Interpolator of surfaces over this template by their deformation gradients."""
        return PoissonInterpolator(
            self.joined_faces,
            self.differential_operator,
            self.face_areas,
            self.seams.first_copies if self.seams else None,
        )

    @cached_property
    def heat(self) -> TriangleHeat:
        """The flow of heat between the triangles, also across seams."""
        return TriangleHeat(self.vertices, self.joined_faces, self.face_areas)

    @cached_property
    def vertex_heat(self) -> HeatFlow:
        """The flow of heat between the vertices, with only the first copies along seams."""
        faces = self.joined_faces
        masses = self._areas_around_vertices(faces)
        return HeatFlow(masses, cotangent_laplacian(self.vertices, faces))

    @cached_property
    def averaging_operator(self) -> sparse.csr_array:
        """Sparse matrix of shape (V, F): averages of triangles around vertices, by area."""
        corners, masses = self.joined_faces.ravel(), self.vertex_heat.masses
        shares = self._areas_at_corners / masses[corners]
        triangles = np.repeat(np.arange(self.n_faces), 3)
        shape = (self.n_vertices, self.n_faces)
        return sparse.csr_array((shares, (corners, triangles)), shape=shape)

    @property
    def _areas_at_corners(self) -> Array:
        """A third of its area for each corner of each triangle, shape (3F,)."""
        return np.repeat(self.face_areas / 3, 3)

    def _areas_around_vertices(self, faces: Triangles) -> Array:
        areas = np.bincount(faces.ravel(), self._areas_at_corners, minlength=self.n_vertices)
        return areas.astype(np.float64, copy=False)

    def __reduce__(self) -> tuple[object, ...]:
        # Cached properties are left out, since some cannot be pickled.
        return type(self), (self._vertices, self._faces)

    def check_points(self, points: ArrayLike, name: str = "points") -> Array:
        """Return surfaces as a float64 array after checking that they fit this template.

        Parameters
        ----------
        points : array_like, shape (..., V, 3)
        name : str, for messages
        """
        dtype = getattr(points, "dtype", None)
        points = real_array(points, name, ("n_vertices", 3))
        check_resolution(points, name, dtype)
        if points.shape[-2] != self.n_vertices:
            raise ArgumentError(
                f"{name} has {points.shape[-2]} vertices per surface (shape {points.shape}); "
                f"the template has {self.n_vertices}"
            )
        return points

    def check_faces(self, faces: ArrayLike, name: str = "faces") -> None:
        """Raise an error unless triangles are those of the template.

        Parameters
        ----------
        faces : array_like, shape (F, 3)
        name : str, for messages
        """
        difference = face_difference(integer_array(faces, name, ("n_faces", 3)), self.faces)
        if difference:
            raise ArgumentError(f"{name} must be the triangles of the template: {difference}")

    def __repr__(self) -> str:
        return f"Template(n_vertices={self.n_vertices}, n_faces={self.n_faces})"


def _areas_and_frames(vertices: Array, faces: Triangles) -> tuple[Array, Array]:
    """Return triangle areas and frame coefficients; raise if a triangle has no area."""
    _refuse_flat(vertices, faces)
    corners = vertices[faces]
    first_edge = corners[:, 1] - corners[:, 0]
    second_edge = corners[:, 2] - corners[:, 0]
    double_areas = np.linalg.norm(doubled_area_vectors(vertices, faces), axis=1)
    u2 = np.linalg.norm(first_edge, axis=1)
    u3 = np.sum(first_edge * second_edge, axis=1) / u2
    v3 = double_areas / u2
    frames = np.stack([1 / u2, 1 / v3, u3 / (v3 * u2)], axis=1)
    return read_only(double_areas / 2), read_only(frames)


def _refuse_flat(vertices: Array, faces: Triangles) -> None:
    """Raise an error if a triangle has no area."""
    corners = vertices[faces]
    double_areas = np.linalg.norm(doubled_area_vectors(vertices, faces), axis=1)
    sides = corners - np.roll(corners, 1, axis=1)
    longest = np.linalg.norm(sides, axis=2).max(axis=1)
    rounding = _ROUNDING * np.abs(corners).max(axis=(1, 2))
    is_flat = double_areas <= longest * (_FLAT_HEIGHT * longest + rounding)
    if is_flat.any():
        first = int(is_flat.argmax())
        raise DegenerateSurfaceError(
            f"the template has {int(is_flat.sum())} of {len(faces)} triangles without area, the "
            f"first at index {first} with vertices {tuple(faces[first].tolist())}; every triangle "
            "must have area"
        )


class TriangleAssembler:
    """Sums 9 x 9 matrices of triangles into sparse (3V, 3V) matrices of one pattern."""

    def __init__(self, faces: Triangles, n_vertices: int) -> None:
        self._size = 3 * n_vertices
        # Each pair (v, w) of vertices that share a triangle has a block of 3 x 3 entries. Pairs
        # are sorted, so the blocks of v lie side by side in the rows 3v, 3v + 1 and 3v + 2.
        faces = faces.astype(np.int64)
        pairs = faces[:, :, None] * n_vertices + faces[:, None, :]
        keys, block_of_pair = np.unique(pairs, return_inverse=True)
        row_vertex, column_vertex = np.divmod(keys, n_vertices)
        n_blocks = np.bincount(row_vertex, minlength=n_vertices)
        # The number of blocks before those of v: 9 entries each.
        n_before = np.concatenate([[0], np.cumsum(n_blocks)])[row_vertex]
        place_in_row = np.arange(len(keys)) - n_before
        first_entry = 9 * n_before + 3 * place_in_row
        row, column = np.arange(3)[:, None], np.arange(3)
        row_length = 3 * n_blocks[row_vertex, None, None]
        entries = first_entry[:, None, None] + row * row_length + column
        self._columns = np.empty(entries.size, dtype=np.int32)
        self._columns[entries] = 3 * column_vertex[:, None, None] + column
        row_ends = np.cumsum(np.repeat(3 * n_blocks, 3))
        self._row_ends = np.concatenate([[0], row_ends]).astype(np.int32)
        # From (triangle, corner, corner, x, x) to the order (corner, x, corner, x) of matrices.
        self._positions = entries[block_of_pair.reshape(pairs.shape)].swapaxes(2, 3).ravel()

    def assemble(self, blocks: Array) -> sparse.csr_array:
        """Return the sum of the matrices of all triangles."""
        entries = np.bincount(self._positions, blocks.ravel(), minlength=len(self._columns))
        shape = (self._size, self._size)
        return sparse.csr_array((entries, self._columns, self._row_ends), shape=shape)


def check_body_sizes(points: Points, template: Template, name: str) -> None:
    """Raise an error if surfaces, shape (..., V, 3), have sizes that no human body has.

    If the template has no such size either, it is no body in metres: a hand, or a template in
    another unit. All sizes are then accepted.
    """
    if not is_human_size(*template.body_size):
        return
    for index in np.ndindex(points.shape[:-2]):
        place = f"{name}[{', '.join(map(str, index))}]" if index else name
        extent, volume = body_size(points[index], template.faces if template.is_closed else None)
        if extent > 0.0:  # else it is collapsed
            check_human_size(extent, volume, place)
