"""Surfaces registered to a template."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.arrays import Array, Booleans, Points, TangentVectors
from riemhuman.checks import (
    SCALES,
    Rng,
    check_resolution,
    check_same_scale,
    checked,
    choice,
    generator,
    instance,
    longest_side,
    real_array,
    real_number,
    values_of,
)
from riemhuman.errors import ArgumentError, SeamWarning, warn
from riemhuman.geometry.manifold import SurfaceSpace, sample_count, stack_samples
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.surface_metric import ElasticMetric
from riemhuman.io import as_arrays
from riemhuman.io.mesh_arrays import face_difference
from riemhuman.io.mesh_seams import common_seams
from riemhuman.kernels import surface
from riemhuman.surfaces.template import Template
from riemhuman.terms._sums import nearly_degenerate

# Share of the largest displacement by which both sides of a seam may differ.
_TEAR = 1e-6


class AlignedSurfaces(SurfaceSpace):
    """Maps f: T → R³ that are linear on the triangles of a template T.

    A point holds the vertices of a surface in the template's order. The points are an open subset
    of the vector space of all (V, 3) arrays, so any such array is a tangent vector. Surfaces with
    triangles of zero area lie on its boundary. All methods that take points also accept meshes of
    trimesh, PyVista and meshio with the template's triangles.

    Parameters
    ----------
    template : Template
    equip : bool
        Whether to equip the manifold with `ElasticMetric`.
    scale : {"template"} or None
        "template" raises an error for surfaces that are more than eight times larger or smaller
        than the template, which must be in another unit; None accepts any size.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> space.shape
    (1202, 3)
    >>> g, n = space.to_fields(bodies[0])
    >>> g.shape, n.shape
    ((2400, 2, 2), (2400, 3))
    """

    @checked(
        template=instance(Template, "a Template, such as that of a data set"),
        scale=choice(*SCALES),
    )
    def __init__(
        self, template: Template, equip: bool = True, *, scale: str | None = "template"
    ) -> None:
        self.template, self.scale = template, scale
        self._side = longest_side(template.vertices)
        super().__init__(3 * template.n_vertices, (template.n_vertices, 3), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        return ElasticMetric

    def belongs(self, point: Points, atol: float = 1e-9) -> Booleans:
        point, finite = self._candidates(point, "point")
        degenerate = nearly_degenerate(point.reshape(-1, *self.shape), self.template)
        return finite & ~np.any(degenerate, axis=-1).reshape(point.shape[:-2])

    def to_tangent(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        return real_array(vector, "vector", self.shape)

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> Array:
        count = sample_count(n_samples)
        noise = generator(rng).uniform(-1.0, 1.0, (count, 3, 3))
        maps = np.eye(3) + 0.2 * real_number(bound, "bound", minimum=0.0) * noise
        return stack_samples(self.template.vertices @ maps, n_samples)

    def face_areas(self, point: Points) -> Array:
        """Return the areas of the triangles of surfaces, square metres, shape (..., F).

        Gradients are 0 where a triangle has no area.

        Parameters
        ----------
        point : array, shape (..., V, 3)
        """
        normals = self.normals(point)
        return surface.square_root(surface.dot(normals, normals))

    def normals(self, point: Points) -> Array:
        """Return the normals of triangles, as long as their areas, shape (..., F, 3).

        Parameters
        ----------
        point : array, shape (..., V, 3)
        """
        area_vectors = np.cross(*self.partial_derivatives(self.check_point(point)))
        return self.template.face_areas[:, None] * area_vectors

    def to_fields(self, f: Points) -> tuple[Array, Array]:
        """Return Φ(f) = (g, n), the metric field and the normal field (equation 1).

        Surfaces with triangles of zero area raise DegenerateSurfaceError, here and wherever normals
        are needed.

        Parameters
        ----------
        f : array, shape (..., V, 3)

        Returns
        -------
        g : array, shape (..., F, 2, 2)
            First fundamental forms in the orthonormal frames of the template's triangles.
        n : array, shape (..., F, 3)
            Unit normals.
        """
        derivatives = self.partial_derivatives(f)
        return surface.first_fundamental_form(*derivatives), self._normals(*derivatives)

    def as_array(self, points: object, name: str = "points") -> object:
        if isinstance(points, (list, tuple)):
            arrays = [self.as_array(point, f"{name}[{k}]") for k, point in enumerate(points)]
            pairs = zip(arrays, points, strict=True)
            if any(array is not point for array, point in pairs):  # at least one is a mesh
                return np.stack(arrays)  # type: ignore[arg-type]  # NumPy refuses what is no array
            return points
        if not hasattr(points, "faces") and not hasattr(points, "cells"):
            return points
        vertices, faces = as_arrays(points)
        difference = face_difference(faces, self.template.faces)
        if difference is None and len(vertices) != self.template.n_vertices:
            difference = f"{len(vertices)} vertices found, {self.template.n_vertices} expected"
        if difference is not None:
            raise ArgumentError(
                f"{name} must be a mesh with the triangles of the template ({difference}); "
                "register it first: riemhuman.registration.ScanRegistration(model).solve(mesh)"
            )
        return vertices

    def check_point(self, point: object, name: str = "point") -> Array:
        if not isinstance(point, ndarray):
            point = self.as_array(point, name)
        dtype = getattr(point, "dtype", None)
        point = real_array(point, name, self.shape, rows=True)
        if self.scale is not None:
            check_same_scale(values_of(point), self._side, name, "the template")
        check_resolution(point, name, dtype)
        return point

    def check_scale(self, point: Points, name: str = "point") -> None:
        check_resolution(point, name)
        if self.scale is not None:
            check_same_scale(values_of(point), self._side, name, "the template")

    def warn_of_tears(self, points: Points, directions: TangentVectors | None = None) -> None:
        seams = self.template.seams
        if not seams:
            return
        seams = common_seams(seams, points, self.faces)
        copies = seams.first_copies
        if directions is not None:
            fields = directions.reshape(-1, *self.shape)
            gaps = np.abs(fields[:, copies] - fields).max()
            if gaps <= _TEAR * np.abs(fields).max():
                return
        if seams:
            warn(
                f"the template has {seams.n_copies} duplicated vertices along seams, where it "
                "will tear. Join them with template, seams = template.join_seams(); "
                "seams.join(points) joins them in surfaces, and seams.split(points) splits them "
                "again",
                SeamWarning,
            )
