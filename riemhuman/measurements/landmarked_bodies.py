"""Surfaces over one template, with the landmarks, axes and parts that measurements refer to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import autograd.numpy as np
import numpy as onp
from numpy import ndarray

from riemhuman.arrays import Array
from riemhuman.bodies import joints_between
from riemhuman.checks import values_of
from riemhuman.errors import ArgumentError
from riemhuman.measurements._geodesics import SurfacePoint
from riemhuman.measurements._landmarks import AXES, LandmarkedTemplate, Place
from riemhuman.measurements._sections import FOREIGN, LEFT_OUT, WANTED, Cutter, weighted_vertices
from riemhuman.surfaces.nearest_points import nearest_points


class LandmarkedBodies:
    """Bodies that are measured, with landmarks, axes and parts: what `Measurement.value` is given.

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
        self.set, self.surfaces, self._frames = measurement_set, surfaces, axes
        self._positions: dict[str, Array] = {}
        self._numbers = onp.arange(len(surfaces))[:, None]

    def place(self, place: Place) -> Array:
        """Return the position of a place on each body, shape (n, 3).

        Parameters
        ----------
        place : str or mapping of str to float
            A landmark, or landmarks with weights.
        """
        if isinstance(place, Mapping):
            total = sum(place.values())
            first, *others = (weight / total * self.place(n) for n, weight in place.items())
            return sum(others, first)
        if place not in self._positions:
            vertices, weights = self.set.landmarks[place]
            combination = self._numbers, vertices[None], weights[None]
            self._positions[place] = weighted_vertices(self.surfaces, *combination)
        return self._positions[place]

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
        start, *ends = axis
        steps = [self.place(end) - self.place(start) for end in ends]
        return _unit(steps[0] if len(steps) == 1 else np.cross(*steps))

    @cached_property
    def _axes(self) -> Array:
        """Left, up and forward of every body as columns, shape (n, 3, 3)."""
        if self._frames == "space":
            return onp.asarray(self.set.axes) + np.zeros((len(self.surfaces), 1, 1))
        # The axes lie in this frame as the template's axes lie in the frame of its landmarks.
        places = (self.place(name) for name in self.set.frame)
        return np.matmul(axes_of_frame(*places), self.set.axes_in_frame)

    def cutter(self, parts: tuple[str, ...], leave_out: tuple[str, ...]) -> Cutter:
        """Return the triangles that a plane may cut, for sections of parts of the body.

        Parameters
        ----------
        parts : tuple of str
            Parts whose line is wanted; if empty, the whole body.
        leave_out : tuple of str
            Parts that the line may cross.
        """
        mesh, cutters = self.set.mesh, self.set.mesh.cutters
        if (parts, leave_out) not in cutters:
            roles = onp.full(len(self.set.faces), FOREIGN, dtype=onp.uint8)
            roles[self.set.in_parts(parts)] = WANTED
            if leave_out:
                roles[self.set.in_parts(leave_out)] = LEFT_OUT
            wanted = onp.flatnonzero(roles == WANTED)
            cutters[parts, leave_out] = mesh.faces, mesh.neighbours, roles, wanted
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
        known, description = self.set.mesh.places, self.set
        key = place if isinstance(place, str) else tuple(place.items())
        if key not in known:
            template = LandmarkedBodies(description, description.vertices[onp.newaxis], "space")
            nearest, _ = nearest_points(
                template.place(place), description.vertices, description.faces
            )
            known[key] = int(nearest.triangles[0]), nearest.barycentric[0]
        return known[key]

    @cached_property
    def floor(self) -> Array:
        """Coordinate of the lowest vertex of each body along the axis "up", shape (n,)."""
        up = self.axis("up")
        heights = onp.matmul(values_of(self.surfaces), values_of(up)[:, :, None])
        combination = self._numbers, heights.argmin(axis=1), onp.ones((1, 1))
        return np.sum(weighted_vertices(self.surfaces, *combination) * up, axis=-1)

    @cached_property
    def volumes(self) -> Array:
        """Volumes that closed surfaces enclose, shape (n,)."""
        # About the mean vertex, where products of coordinates lose the fewest digits.
        centred = self.surfaces - np.mean(self.surfaces, axis=1, keepdims=True)
        a, b, c = _corners(centred, self.set.faces)
        return np.sum(a * np.cross(b, c), axis=(-2, -1)) / 6.0

    def areas(self, faces: ndarray) -> Array:
        """Return the sum of the areas of some triangles, shape (n,).

        Parameters
        ----------
        faces : array of int, shape (k, 3)
            Triangles: numbers of their vertices.
        """
        a, b, c = _corners(self.surfaces, faces)
        return 0.5 * np.sum(np.sqrt(np.sum(np.cross(b - a, c - a) ** 2, axis=-1)), axis=-1)


def _corners(surfaces: Array, faces: ndarray) -> tuple[Array, Array, Array]:
    return surfaces[:, faces[:, 0]], surfaces[:, faces[:, 1]], surfaces[:, faces[:, 2]]


def axes_of_frame(bottom: Array, top: Array, right: Array, left: Array) -> Array:
    """Return axes to the left, up and forward of four landmarks, as columns, shape (..., 3, 3)."""
    up = _unit(top - bottom)
    side = left - right
    side = _unit(side - np.sum(side * up, axis=-1, keepdims=True) * up)
    return np.stack([side, up, np.cross(side, up)], axis=-1)


def _unit(vectors: Array) -> Array:
    return vectors / np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
