"""Surfaces over one template, with the landmarks, axes and parts that measurements refer to."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy import ndarray

from riemhuman.checks import values_of
from riemhuman.measurements.geodesics import geodesic_lengths, geodesic_path
from riemhuman.measurements.sections import section_sizes

Place = str | Mapping[str, float]
"""A landmark, or an affine combination of landmarks such as ``{"hip": 0.5, "knee": 0.5}``."""

_AXES = {"left": 0, "up": 1, "forward": 2}


class LandmarkedBodies:
    """Surfaces over one template, with landmarks, axes and parts by name.

    Autograd can differentiate places, axes, lengths, areas and volumes by the surfaces.

    Parameters
    ----------
    description : MeasurementSet
        Landmarks, axes and parts of the template.
    surfaces : array, shape (n, V, 3)
        Vertices, metres.
    axes : {"body", "space"}
        Whether the axes move with the trunk of each body, or are those of the template in space.
    """

    def __init__(self, description: Any, surfaces: Any, axes: str) -> None:
        self._set, self._surfaces, self._frames = description, surfaces, axes
        self._known: dict[Any, Any] = {}

    def place(self, place: Place) -> Any:
        """Return the position of a landmark or of an affine combination of landmarks.

        Parameters
        ----------
        place : str or mapping of str to float
            The place.

        Returns
        -------
        array, shape (n, 3)
        """
        if isinstance(place, Mapping):
            total = sum(place.values())
            return sum(weight / total * self.place(name) for name, weight in place.items())
        if place not in self._known:
            vertices, weights = self._set.landmarks[place]
            self._known[place] = np.sum(weights[:, None] * self._surfaces[:, vertices], axis=1)
        return self._known[place]

    def axis(self, axis: Any) -> Any:
        """Return an axis of the bodies, or the direction from one place to another.

        Parameters
        ----------
        axis : str or pair of places
            "up", "left", "forward", or two places.

        Returns
        -------
        array, shape (n, 3)
            Unit vectors.
        """
        if isinstance(axis, str):
            return self._axes[..., _AXES[axis]]
        one, other = axis
        return _unit(self.place(other) - self.place(one))

    @cached_property
    def _axes(self) -> Any:
        """Left, up and forward of every body as columns, shape (n, 3, 3)."""
        own = onp.asarray(self._set.axes)
        if self._frames == "space":
            return own + np.zeros((len(self._surfaces), 1, 1))
        bottom, top, right, left = (self.place(name) for name in self._set.frame)
        # The axes lie in this frame as the template's axes lie in the frame of its landmarks.
        return np.matmul(_frame(bottom, top, right, left), self._set.axes_in_frame)

    def section_sizes(
        self, parts: Any, leave_out: Any, at: Place, normal: Any, direction: Any, kind: int
    ) -> Any:
        """Return sizes of plane sections, see `riemhuman.measurements.sections`.

        Parameters
        ----------
        parts, leave_out : tuple of str
            Parts that are measured, and parts that the loop passes over.
        at : place
            A place in the plane.
        normal : str or pair of places
            Normal of the plane.
        direction : array, shape (n, 3)
            Unit vectors along which extents are measured.
        kind : int
            `LENGTH`, `HULL` or `EXTENT`.

        Returns
        -------
        array, shape (n,)
            Metres; NaN where there is no section.
        """
        cutter = self._set.cutter(parts, leave_out)
        plane = self.place(at), self.axis(normal)
        return section_sizes(self._surfaces, *plane, direction, cutter, kind)

    def section(self, parts: Any, leave_out: Any, at: Place, normal: Any) -> tuple[ndarray, int]:
        """Return a section of the first body, or why there is none.

        Parameters
        ----------
        parts, leave_out : tuple of str
            Parts that are measured, and parts that the loop passes over.
        at : place
            A place in the plane.
        normal : str or pair of places
            Normal of the plane.

        Returns
        -------
        points : array, shape (k, 3)
            The section; empty if there is none.
        status : int
            0, or why there is none, see `Cutter.section`.
        """
        cutter = self._set.cutter(parts, leave_out)
        return cutter.section(self._surfaces[0], self.place(at)[0], self.axis(normal)[0])

    def tape(self, loop: ndarray, hull: bool) -> ndarray:
        """Return a section or its convex hull as a closed curve.

        Parameters
        ----------
        loop : array, shape (k, 3)
            Points of the section.
        hull : bool
            Whether to return the convex hull.

        Returns
        -------
        array, shape (m, 3)
            The last point is the first.
        """
        if hull and len(loop) > 2:
            from scipy.spatial import ConvexHull

            middle = loop.mean(axis=0)
            _, _, axes = onp.linalg.svd(loop - middle, full_matrices=False)
            loop = loop[ConvexHull((loop - middle) @ axes[:2].T).vertices]
        return onp.concatenate([loop, loop[:1]])

    def floor(self) -> Any:
        """Return the coordinate of the lowest vertex along the axis "up".

        Returns
        -------
        array, shape (n,)
        """
        if "floor" not in self._known:
            up = self.axis("up")
            heights = np.matmul(self._surfaces, up[:, :, None])[..., 0]
            self._known["floor"] = np.min(heights, axis=-1)
        return self._known["floor"]

    def bones(self, first: str, last: str) -> tuple[str, ...]:
        """Return the names of the joints on the path from one joint to another.

        Parameters
        ----------
        first, last : str
            Names of joints.

        Returns
        -------
        tuple of str
        """
        return self._set.bones(first, last)

    def geodesic_lengths(self, one: Place, other: Place) -> Any:
        """Return the lengths of geodesics along the surfaces.

        Parameters
        ----------
        one, other : place
            The ends.

        Returns
        -------
        array, shape (n,)
        """
        start, end = self._set.on_surface(one), self._set.on_surface(other)
        return geodesic_lengths(self._surfaces, start, end, self._set.mesh)

    def geodesic(self, one: Place, other: Place) -> ndarray:
        """Return a geodesic along the first surface.

        Parameters
        ----------
        one, other : place
            The ends.

        Returns
        -------
        array, shape (k, 3)
        """
        start, end = self._set.on_surface(one), self._set.on_surface(other)
        return geodesic_path(values_of(self._surfaces)[0], start, end, self._set.mesh)

    def volumes(self) -> Any:
        """Return the volumes that closed surfaces enclose.

        Returns
        -------
        array, shape (n,)
            Cubic metres.
        """
        if "volume" not in self._known:
            # About the mean vertex, where products of coordinates lose the fewest digits.
            middle = np.mean(self._surfaces, axis=1, keepdims=True)
            a, b, c = self._corners(self._set.faces, self._surfaces - middle)
            self._known["volume"] = np.sum(a * np.cross(b, c), axis=(-2, -1)) / 6.0
        return self._known["volume"]

    def areas(self, parts: tuple[str, ...]) -> Any:
        """Return the areas of some parts of the surfaces.

        Parameters
        ----------
        parts : tuple of str
            Names of parts; if empty, the whole body.

        Returns
        -------
        array, shape (n,)
            Square metres.
        """
        faces = self._set.faces[self._set.in_parts(parts)]
        a, b, c = self._corners(faces, self._surfaces)
        return 0.5 * np.sum(np.sqrt(np.sum(np.cross(b - a, c - a) ** 2, axis=-1)), axis=-1)

    @staticmethod
    def _corners(faces: ndarray, surfaces: Any) -> tuple[Any, Any, Any]:
        return surfaces[:, faces[:, 0]], surfaces[:, faces[:, 1]], surfaces[:, faces[:, 2]]


def axes_in_frame(places: ndarray, axes: ndarray) -> ndarray:
    """Return the axes of a template in the frame of its landmarks.

    Parameters
    ----------
    places : array, shape (4, 3)
        The landmarks: bottom, top, right and left.
    axes : array, shape (3, 3)
        Left, up and forward as columns.

    Returns
    -------
    array, shape (3, 3)
    """
    return _frame(*(place[None] for place in places))[0].T @ axes


def _frame(bottom: Any, top: Any, right: Any, left: Any) -> Any:
    up = _unit(top - bottom)
    side = left - right
    side = _unit(side - np.sum(side * up, axis=-1, keepdims=True) * up)
    return np.stack([side, up, np.cross(side, up)], axis=-1)


def _unit(vectors: Any) -> Any:
    return vectors / np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
