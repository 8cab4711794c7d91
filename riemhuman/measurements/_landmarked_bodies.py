"""Surfaces over one template, with the landmarks, axes and parts that measurements refer to."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy import ndarray

from riemhuman.bodies import joints_between
from riemhuman.checks import values_of
from riemhuman.measurements._geodesics import SurfacePoint
from riemhuman.measurements._sections import FOREIGN, LEFT_OUT, WANTED, Cutter, weighted_vertices
from riemhuman.surfaces.nearest_points import nearest_points

Place = str | Mapping[str, float]
"""A landmark, or an affine combination of landmarks such as ``{"hip": 0.5, "knee": 0.5}``."""

AXES = ("left", "up", "forward")


class LandmarkedBodies:
    """Surfaces, shape (n, V, 3) in metres, with landmarks, and axes of the "body" or in "space"."""

    def __init__(self, description: Any, surfaces: Any, axes: str) -> None:
        self.set, self.surfaces, self._frames = description, surfaces, axes
        self._positions: dict[str, Any] = {}
        self._numbers = onp.arange(len(surfaces))[:, None]

    def place(self, place: Place) -> Any:
        """Return the position of a place on each body, shape (n, 3)."""
        if isinstance(place, Mapping):
            total = sum(place.values())
            return sum(weight / total * self.place(name) for name, weight in place.items())
        if place not in self._positions:
            vertices, weights = self.set.landmarks[place]
            combination = self._numbers, vertices[None], weights[None]
            self._positions[place] = weighted_vertices(self.surfaces, *combination)
        return self._positions[place]

    def axis(self, axis: Any) -> Any:
        """Return an axis of the bodies, or the unit vectors that two or three places define."""
        if isinstance(axis, str):
            return self._axes[..., AXES.index(axis)]
        start, *ends = axis
        steps = [self.place(end) - self.place(start) for end in ends]
        return _unit(steps[0] if len(steps) == 1 else np.cross(*steps))

    @cached_property
    def _axes(self) -> Any:
        """Left, up and forward of every body as columns, shape (n, 3, 3)."""
        if self._frames == "space":
            return onp.asarray(self.set.axes) + np.zeros((len(self.surfaces), 1, 1))
        # The axes lie in this frame as the template's axes lie in the frame of its landmarks.
        places = (self.place(name) for name in self.set.frame)
        return np.matmul(axes_of_frame(*places), self.set.axes_in_frame)

    def cutter(self, parts: tuple[str, ...], leave_out: tuple[str, ...]) -> Cutter:
        """Return the triangles that a plane may cut: of parts, all if empty, and those left out."""
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
        """Return the names of the joints on the path from one joint to another."""
        names = self.set.model.joint_names
        path = joints_between(self.set.model.parents, names.index(first), names.index(last))
        return tuple(names[number] for number in path)

    def on_surface(self, place: Place) -> SurfacePoint:
        """Return the point of the template nearest to a place: its triangle and coordinates."""
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
    def floor(self) -> Any:
        """Coordinate of the lowest vertex of each body along the axis "up", shape (n,)."""
        up = self.axis("up")
        heights = onp.matmul(values_of(self.surfaces), values_of(up)[:, :, None])
        combination = self._numbers, heights.argmin(axis=1), onp.ones((1, 1))
        return np.sum(weighted_vertices(self.surfaces, *combination) * up, axis=-1)

    @cached_property
    def volumes(self) -> Any:
        """Volumes that closed surfaces enclose, shape (n,)."""
        # About the mean vertex, where products of coordinates lose the fewest digits.
        centred = self.surfaces - np.mean(self.surfaces, axis=1, keepdims=True)
        a, b, c = _corners(centred, self.set.faces)
        return np.sum(a * np.cross(b, c), axis=(-2, -1)) / 6.0

    def areas(self, faces: ndarray) -> Any:
        """Return the sum of the areas of some triangles, shape (n,)."""
        a, b, c = _corners(self.surfaces, faces)
        return 0.5 * np.sum(np.sqrt(np.sum(np.cross(b - a, c - a) ** 2, axis=-1)), axis=-1)


def _corners(surfaces: Any, faces: ndarray) -> tuple[Any, Any, Any]:
    return surfaces[:, faces[:, 0]], surfaces[:, faces[:, 1]], surfaces[:, faces[:, 2]]


def axes_of_frame(bottom: Any, top: Any, right: Any, left: Any) -> Any:
    """Return axes to the left, up and forward of four landmarks, as columns, shape (..., 3, 3)."""
    up = _unit(top - bottom)
    side = left - right
    side = _unit(side - np.sum(side * up, axis=-1, keepdims=True) * up)
    return np.stack([side, up, np.cross(side, up)], axis=-1)


def _unit(vectors: Any) -> Any:
    return vectors / np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
