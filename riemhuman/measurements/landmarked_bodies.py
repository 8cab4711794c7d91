"""Surfaces over one template, with the landmarks, axes and parts that measurements refer to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Protocol

import autograd.numpy as np
import numpy as onp

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.bodies import BodyModel, joints_between
from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import apply_operator
from riemhuman.measurements._geodesics import Mesh, SurfacePoint
from riemhuman.measurements._sections import FOREIGN, LEFT_OUT, MEASURED, Cutter, weighted_vertices
from riemhuman.measurements._vertex_slopes import VertexSlopes
from riemhuman.surfaces.nearest_points import nearest_points

Place = str | Mapping[str, float]
"""A landmark, or an affine combination of landmarks such as ``{"hip": 0.5, "knee": 0.5}``."""

AXES = ("left", "up", "forward")


class LandmarkedTemplate(Protocol):
    """A template with landmarks, axes and parts: a `riemhuman.measurements.MeasurementSet`."""

    @property
    def landmarks(self) -> Mapping[str, tuple[Integers, Array]]: ...

    @property
    def frame(self) -> Sequence[str]: ...

    @property
    def axes(self) -> Array: ...

    @property
    def model(self) -> BodyModel | None: ...

    @property
    def vertices(self) -> Array: ...

    @property
    def faces(self) -> Triangles: ...

    @property
    def mesh(self) -> Mesh: ...

    @property
    def is_closed(self) -> bool: ...

    @property
    def axes_in_frame(self) -> Array: ...

    def in_parts(self, parts: tuple[str, ...]) -> Booleans: ...


class LandmarkedBodies:
    """The bodies that `Measurement.value` receives, with their landmarks, axes and parts.

    Parameters
    ----------
    measurement_set : MeasurementSet
        The landmarks and parts of the template.
    surfaces : array, shape (n, V, 3)
        Bodies over its template, metres, which autograd may trace.
    axes : {"body", "space"}
        Whether the axes move with the trunk of each body, or are those of the template.

    Attributes
    ----------
    set : MeasurementSet
    surfaces : array, shape (n, V, 3)

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> measurements = rh.measurements.open_measurements(model)
    >>> surfaces = model.template.vertices[None]
    >>> bodies = rh.measurements.LandmarkedBodies(measurements, surfaces, "space")
    >>> bodies.place("crown").shape, bodies.axis("up").tolist()
    ((1, 3), [[0.0, 1.0, 0.0]])
    """

    def __init__(self, measurement_set: LandmarkedTemplate, surfaces: Array, axes: str) -> None:
        self.set = measurement_set
        self.surfaces = surfaces
        self._axes_setting = axes
        self._positions: dict[str, Array] = {}
        self._numbers = onp.arange(len(surfaces))[:, None]

    def moved(self, surfaces: Array) -> LandmarkedBodies:
        """Return other surfaces with the same landmarks and parts.

        Parameters
        ----------
        surfaces : array, shape (n, V, 3)
            Bodies, metres, which autograd may trace.
        """
        return LandmarkedBodies(self.set, surfaces, self._axes_setting)

    def place(self, place: Place) -> Array:
        """Return the position of a place on each body, shape (n, 3).

        Parameters
        ----------
        place : str or mapping of str to float
            A landmark, or landmarks with weights.
        """
        if isinstance(place, Mapping):
            total = sum(place.values())
            position = np.zeros(3)
            for name, weight in place.items():
                position = position + weight / total * self.place(name)
            return position
        if place not in self._positions:
            vertices, weights = self.set.landmarks[place]
            combination = self._numbers, vertices[None], weights[None]
            self._positions[place] = weighted_vertices(self.surfaces, *combination)
        return self._positions[place]

    def pull_place(self, place: Place, upstream: Array, slopes: VertexSlopes) -> None:
        """Add the derivatives by vertices, given those by a place, shape (n, 3).

        Parameters
        ----------
        place : str or mapping of str to float
            As for `place`.
        upstream : array, shape (n, 3)
        slopes : VertexSlopes
        """
        if isinstance(place, Mapping):
            total = sum(place.values())
            for name, weight in place.items():
                self.pull_place(name, weight / total * upstream, slopes)
        else:
            vertices, weights = self.set.landmarks[place]
            slopes.add(self._numbers, vertices, weights[:, None] * upstream[:, None])

    def axis(self, axis: str | Sequence[Place]) -> Array:
        """Return the unit vectors of an axis of each body, shape (n, 3).

        Parameters
        ----------
        axis : {"left", "up", "forward"} or sequence of places
            An axis of the bodies, the direction from one place to another, or the normal of the
            plane through three places.
        """
        if isinstance(axis, str):
            return self._axes[..., AXES.index(axis)]
        steps = self._steps(axis)
        return _unit(steps[0] if len(steps) == 1 else np.cross(steps[0], steps[1]))

    def _steps(self, axis: Sequence[Place]) -> list[Array]:
        """Return the vectors from the first place of an axis to the others."""
        return [self.place(end) - self.place(axis[0]) for end in axis[1:]]

    def pull_axis(self, axis: str | Sequence[Place], upstream: Array, slopes: VertexSlopes) -> None:
        """Add the derivatives by vertices, given those by an axis, shape (n, 3).

        Parameters
        ----------
        axis : {"left", "up", "forward"} or sequence of places
            As for `axis`.
        upstream : array, shape (n, 3)
        slopes : VertexSlopes
        """
        if isinstance(axis, str):
            if self._axes_setting != "space":
                # The axis is the sum of the frame's columns with these weights.
                weights = self.set.axes_in_frame[:, AXES.index(axis)]
                bottom, top, right, left = self._frame_places()
                pulls = _pull_frame(bottom, top, right, left, weights[:, None, None] * upstream)
                for name, pull in zip(self.set.frame, pulls, strict=True):
                    self.pull_place(name, pull, slopes)
            return
        steps = self._steps(axis)
        if len(steps) == 1:
            of_steps = [_pull_unit(steps[0], upstream)]
        else:
            pull = _pull_unit(_cross(steps[0], steps[1]), upstream)
            of_steps = [_cross(steps[1], pull), _cross(pull, steps[0])]
        for end, pull in zip(axis[1:], of_steps, strict=True):
            self.pull_place(end, pull, slopes)
            self.pull_place(axis[0], -pull, slopes)

    @cached_property
    def _axes(self) -> Array:
        """Left, up and forward of every body as columns, shape (n, 3, 3)."""
        if self._axes_setting == "space":
            return onp.asarray(self.set.axes) + np.zeros((len(self.surfaces), 1, 1))
        # The axes lie in this frame as the template's axes lie in the frame of its landmarks.
        return np.matmul(axes_of_frame(*self._frame_places()), self.set.axes_in_frame)

    def _frame_places(self) -> list[Array]:
        return [self.place(name) for name in self.set.frame]

    def cutter(self, parts: tuple[str, ...], leave_out: tuple[str, ...]) -> Cutter:
        """Return the triangles that a plane may cut, for sections of parts of the body.

        Parameters
        ----------
        parts : tuple of str
            Parts on which the line is measured; if empty, the whole body.
        leave_out : tuple of str
            Parts that the line may cross.
        """
        mesh = self.set.mesh
        cutters = mesh.cutters
        if (parts, leave_out) not in cutters:
            roles = onp.full(len(self.set.faces), FOREIGN, dtype=onp.uint8)
            roles[self.set.in_parts(parts)] = MEASURED
            if leave_out:
                roles[self.set.in_parts(leave_out)] = LEFT_OUT
            starts = onp.flatnonzero(roles == MEASURED)
            cutters[parts, leave_out] = mesh.faces, mesh.neighbours, roles, starts
        return cutters[parts, leave_out]

    def bones(self, first: str, last: str) -> tuple[str, ...]:
        """Return the names of the joints on the path from one joint to another.

        Parameters
        ----------
        first, last : str
            Joints of the body model.
        """
        model = self.set.model
        if model is None:
            raise ArgumentError("bones need a body model; the template of the set is a surface")
        names = model.joint_names
        path = joints_between(model.parents, names.index(first), names.index(last))
        return tuple(names[number] for number in path)

    def on_surface(self, place: Place) -> SurfacePoint:
        """Return the point of the template nearest to a place: its triangle and coordinates.

        Parameters
        ----------
        place : str or mapping of str to float
            As for `place`.
        """
        points = self.set.mesh.places  # those found before
        key = place if isinstance(place, str) else tuple(place.items())
        if key not in points:
            template = LandmarkedBodies(self.set, self.set.vertices[onp.newaxis], "space")
            nearest, _ = nearest_points(template.place(place), self.set.vertices, self.set.faces)
            points[key] = int(nearest.triangles[0]), nearest.barycentric[0]
        return points[key]

    @cached_property
    def lowest(self) -> Integers:
        """Number of the lowest vertex of each body along the axis "up", shape (n, 1)."""
        up = values_of(self.axis("up"))[:, :, None]
        numbers: Integers = onp.matmul(values_of(self.surfaces), up).argmin(axis=1)
        return numbers

    @cached_property
    def floor(self) -> Array:
        """Coordinate of the lowest vertex of each body along the axis "up", shape (n,)."""
        combination = self._numbers, self.lowest, onp.ones((1, 1))
        lowest = weighted_vertices(self.surfaces, *combination)
        return np.sum(lowest * self.axis("up"), axis=-1)

    def pull_height(self, top: Place, bottom: Place | None, slopes: VertexSlopes) -> None:
        """Add the derivatives by vertices of the height of one place above another, or the floor.

        Parameters
        ----------
        top : str or mapping of str to float
            As for `place`.
        bottom : str or mapping of str to float, optional
            As for `place`; by default the floor.
        slopes : VertexSlopes
        """
        up = self.axis("up")
        self.pull_place(top, up, slopes)
        if bottom is None:
            slopes.add(self._numbers, self.lowest, -up[:, None])
            low = self.surfaces[self._numbers[:, 0], self.lowest[:, 0]]
        else:
            self.pull_place(bottom, -up, slopes)
            low = self.place(bottom)
        self.pull_axis("up", self.place(top) - low, slopes)

    @cached_property
    def volumes(self) -> Array:
        """Volumes that closed surfaces enclose, shape (n,)."""
        # By Euler's theorem, a homogeneous function of degree three is a third of the product of
        # its slopes with the coordinates. About the mean vertex, these lose the fewest digits.
        centred = self.surfaces - np.mean(self.surfaces, axis=1, keepdims=True)
        return np.sum(centred * self.volume_slopes, axis=(-2, -1)) / 3.0

    @cached_property
    def volume_slopes(self) -> Array:
        """Derivatives of the volumes of closed surfaces by the vertices, shape (n, V, 3)."""
        # The pyramid over a triangle grows by a third of its area as one of its vertices rises.
        return apply_operator(self.set.mesh.corners.T, self._double_normals) / 6.0

    @cached_property
    def _sides(self) -> tuple[Array, Array]:
        """Sides of all triangles, from the first corner to the second and the third, (n, F, 3)."""
        sides = apply_operator(self.set.mesh.sides, self.surfaces)
        n_faces = len(self.set.faces)
        return sides[:, :n_faces], sides[:, n_faces:]

    @cached_property
    def _double_normals(self) -> Array:
        """Normals of all triangles, twice as long as these are large, shape (n, F, 3)."""
        return _cross(*self._sides)

    @cached_property
    def triangle_areas(self) -> Array:
        """Areas of all triangles, shape (n, F)."""
        return 0.5 * _norms(self._double_normals)[..., 0]

    def areas(self, faces: Triangles) -> Array:
        """Return the sum of the areas of some triangles, shape (n,).

        Parameters
        ----------
        faces : array of int, shape (k, 3)
            Triangles: numbers of their vertices.
        """
        a, b, c = (self.surfaces[:, corners] for corners in faces.T)
        return 0.5 * np.sum(_norms(_cross(b - a, c - a)), axis=(-2, -1))

    def area_slopes(self, chosen: Booleans) -> Array:
        """Return the derivatives of the sum of the areas of some triangles, shape (n, V, 3).

        Parameters
        ----------
        chosen : array of bool, shape (F,)
            The triangles.
        """
        second, third = self._sides
        areas = self.triangle_areas
        halves = onp.divide(chosen, 4.0 * areas, out=onp.zeros_like(areas), where=areas > 0.0)
        normals = halves[..., None] * self._double_normals
        by_sides = onp.concatenate([_cross(third, normals), _cross(normals, second)], axis=1)
        return apply_operator(self.set.mesh.sides.T, by_sides)


def _cross(a: Array, b: Array) -> Array:
    """Return cross products, without the checks and copies of `np.cross`."""
    (a_x, a_y, a_z), (b_x, b_y, b_z) = ((v[..., 0], v[..., 1], v[..., 2]) for v in (a, b))
    return np.stack([a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x], axis=-1)


def axes_of_frame(bottom: Array, top: Array, right: Array, left: Array) -> Array:
    """Return axes to the left, up and forward of four landmarks, as columns, shape (..., 3, 3)."""
    up = _unit(top - bottom)
    side = left - right
    side = _unit(side - np.sum(side * up, axis=-1, keepdims=True) * up)
    return np.stack([side, up, np.cross(side, up)], axis=-1)


def _unit(vectors: Array) -> Array:
    return vectors / _norms(vectors)


def _norms(vectors: Array) -> Array:
    return np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))


def _pull_unit(vectors: Array, upstream: Array) -> Array:
    """Return derivatives by vectors, given those by the unit vectors along them."""
    units = _unit(vectors)
    slopes: Array = (upstream - _along(upstream, units) * units) / _norms(vectors)
    return slopes


def _along(a: Array, b: Array) -> Array:
    products: Array = onp.sum(a * b, axis=-1, keepdims=True)
    return products


def _pull_frame(
    bottom: Array, top: Array, right: Array, left: Array, upstream: Array
) -> tuple[Array, Array, Array, Array]:
    """Return derivatives by the landmarks of a frame, given those by its axes, (3, n, 3)."""
    up, width = _unit(top - bottom), left - right
    raw_side = width - _along(width, up) * up
    of_side, of_up, of_forward = upstream
    pull = _pull_unit(raw_side, of_side + onp.cross(up, of_forward))
    of_width = pull - _along(pull, up) * up
    of_up = of_up + onp.cross(of_forward, _unit(raw_side))
    of_up = of_up - _along(width, up) * pull - _along(pull, up) * width
    of_height = _pull_unit(top - bottom, of_up)
    return -of_height, of_height, -of_width, of_width
