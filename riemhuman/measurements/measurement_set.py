"""Measurement sets: measurements with the landmarks and parts of one template."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.bodies import BodyModel, correspondence_matrix, joints_between
from riemhuman.errors import ArgumentError
from riemhuman.measurements.definitions import nearest_name
from riemhuman.measurements.geodesics import Mesh, SurfacePoint
from riemhuman.measurements.landmarks import Place, axes_in_frame
from riemhuman.measurements.measurement import Measurement
from riemhuman.measurements.moved_landmarks import (
    Landmark,
    check_numbers,
    checked_landmark,
    moved_landmarks,
    nearest_triangles,
    on_triangle,
)
from riemhuman.measurements.sections import FOREIGN, LEFT_OUT, WANTED, Cutter, neighbours_of
from riemhuman.measurements.set_files import read_set, write_set
from riemhuman.surfaces.nearest_places import nearest_places
from riemhuman.surfaces.template import Template


@dataclass(frozen=True, eq=False, repr=False)
class MeasurementSet:
    """Measurements with the landmarks and parts of a template.

    Parameters
    ----------
    template : Template or BodyModel
        Vertices and triangles. The joints of a body model are also landmarks, by their names.
    measurements : sequence of Measurement
        The measurements; their names must differ.
    landmarks : mapping of str to pair of array_like, shape (n,)
        Numbers of vertices, and weights that sum to one.
    parts : mapping of str to array of int
        Numbers of triangles.
    frame : sequence of str
        Four landmarks with which the axes of a body move: bottom, top, right and left of the trunk.
    axes : array_like, shape (3, 3)
        Left, up and forward of the template, as columns; by default x, y and z.
    standard_pose : mapping of str to array_like, shape (3,)
        Axis-angle rotations of joints from the rest pose to the standard pose, radians; zero for
        joints that are not named.

    Raises
    ------
    ArgumentError
        If two measurements share a name, a number of a vertex or triangle is out of range, or a
        name is unknown; the message offers the nearest names.

    Examples
    --------
    >>> import riemhuman as rh
    >>> model = rh.datasets.load_open_model("coarse")
    >>> rh.measurements.open_measurements(model)
    <MeasurementSet: 32 measurements, 48 landmarks, 1,202 vertices>
    """

    template: Template | BodyModel
    measurements: Sequence[Measurement]
    landmarks: Mapping[str, Landmark] = field(default_factory=dict)
    parts: Mapping[str, ndarray] = field(default_factory=dict)
    frame: Sequence[str] = ()
    axes: Any = field(default_factory=lambda: np.eye(3))
    standard_pose: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        marks = {
            name: checked_landmark(name, mark, self.n_vertices)
            for name, mark in self.landmarks.items()
        }
        if isinstance(self.template, BodyModel):
            regressor = self.template.joint_regressor
            for name, row in zip(self.template.joint_names, regressor, strict=True):
                vertices = np.flatnonzero(row)
                marks.setdefault(name, (vertices, row[vertices]))
            for name in self.standard_pose:
                nearest_name(name, "joint", self.template.joint_names)
        parts = {name: np.asarray(faces, dtype=np.int64) for name, faces in self.parts.items()}
        for name, faces in parts.items():
            check_numbers(f"part {name!r} has triangle", faces, len(self.faces))
        object.__setattr__(self, "landmarks", marks)
        object.__setattr__(self, "parts", parts)
        object.__setattr__(self, "axes", np.asarray(self.axes, dtype=np.float64))
        object.__setattr__(self, "measurements", tuple(self.measurements))
        self._check_names()

    def _check_names(self) -> None:
        names = [measurement.name for measurement in self.measurements]
        if len(set(names)) < len(names):
            twice = next(name for name in names if names.count(name) > 1)
            raise ArgumentError(f"two measurements are called {twice!r}")
        for name in self.frame:
            nearest_name(name, "landmark", self.landmarks)
        if len(self.frame) not in (0, 4):
            raise ArgumentError(f"frame must name four landmarks; found {list(self.frame)}")
        for measurement in self.measurements:
            for place in measurement.places:
                for name in (place,) if isinstance(place, str) else place:
                    nearest_name(name, f"landmark for {measurement.name!r},", self.landmarks)
            for name in measurement.parts_named:
                nearest_name(name, f"part for {measurement.name!r},", self.parts)
            if getattr(measurement, "path", "") == "joints":
                self.bones(*measurement.places)  # type: ignore[arg-type]

    def __repr__(self) -> str:
        return (
            f"<MeasurementSet: {len(self.measurements)} measurements, {len(self.landmarks)} "
            f"landmarks, {self.n_vertices:,} vertices>"
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return tuple(measurement.name for measurement in self.measurements)

    @property
    def model(self) -> BodyModel | None:
        """The body model, or None if the template is a surface."""
        return self.template if isinstance(self.template, BodyModel) else None

    @property
    def vertices(self) -> ndarray:
        """Vertices of the template, shape (V, 3)."""
        return self._surface.vertices

    @property
    def faces(self) -> ndarray:
        """Triangles, shape (F, 3)."""
        return self._surface.faces

    @property
    def n_vertices(self) -> int:
        """Number of vertices V."""
        return self._surface.n_vertices

    @property
    def _surface(self) -> Template:
        return self.template.template if isinstance(self.template, BodyModel) else self.template

    @cached_property
    def mesh(self) -> Mesh:
        """Vertices, triangles and their neighbours."""
        return Mesh(self.vertices, self.faces, neighbours_of(self.faces))

    @cached_property
    def is_closed(self) -> bool:
        """Whether every edge has two triangles."""
        return bool((self.mesh.neighbours >= 0).all())

    @cached_property
    def axes_in_frame(self) -> ndarray:
        """Axes of the template in the frame of its landmarks, shape (3, 3)."""
        marks = [self.landmarks[name] for name in self.frame]
        places = [weights @ self.vertices[vertices] for vertices, weights in marks]
        return axes_in_frame(np.array(places), self.axes)

    @cached_property
    def _cutters(self) -> dict[Any, Cutter]:
        return {}

    def cutter(self, parts: tuple[str, ...], leave_out: tuple[str, ...] = ()) -> Cutter:
        """Return the triangles that a plane may cut.

        Parameters
        ----------
        parts, leave_out : tuple of str
            Parts that are measured, all if empty, and parts that the loop passes over.

        Returns
        -------
        Cutter
        """
        key = (parts, leave_out)
        if key not in self._cutters:
            roles = np.full(len(self.faces), FOREIGN, dtype=np.uint8)
            roles[self.in_parts(parts)] = WANTED
            if leave_out:
                roles[self.in_parts(leave_out)] = LEFT_OUT
            self._cutters[key] = Cutter(self.faces, self.mesh.neighbours, roles)
        return self._cutters[key]

    def in_parts(self, parts: tuple[str, ...]) -> ndarray:
        """Return which triangles belong to some parts.

        Parameters
        ----------
        parts : tuple of str
            Names of parts; if empty, the whole body.

        Returns
        -------
        array of bool, shape (F,)
        """
        chosen = np.full(len(self.faces), not parts)
        for name in parts:
            chosen[self.parts[name]] = True
        return chosen

    def bones(self, first: str, last: str) -> tuple[str, ...]:
        """Return the names of the joints on the path from one joint to another.

        Parameters
        ----------
        first, last : str
            Names of joints.

        Returns
        -------
        tuple of str

        Raises
        ------
        ArgumentError
            If the template is not a body model, or has no such joint.
        """
        if self.model is None:
            raise ArgumentError("lengths along joints need a body model; found a surface")
        names = self.model.joint_names
        ends = (names.index(nearest_name(joint, "joint", names)) for joint in (first, last))
        return tuple(names[number] for number in joints_between(self.model.parents, *ends))

    def on_surface(self, place: Place) -> SurfacePoint:
        """Return the triangle that a place lies in, with barycentric coordinates.

        Parameters
        ----------
        place : str or mapping of str to float
            The place. If it lies off the surface, the nearest point of the template replaces it.

        Returns
        -------
        pair of int and array, shape (3,)
        """
        combined = {place: 1.0} if isinstance(place, str) else place
        vertices = np.concatenate([self.landmarks[name][0] for name in combined])
        weights = np.concatenate([w * self.landmarks[name][1] for name, w in combined.items()])
        return on_triangle((vertices, weights / weights.sum()), self._surface)

    def with_measurements(self, measurements: Iterable[Measurement | str]) -> MeasurementSet:
        """Return the same landmarks and parts with other measurements.

        Parameters
        ----------
        measurements : iterable of Measurement or str
            New measurements, or names of measurements of this set.

        Returns
        -------
        MeasurementSet

        Raises
        ------
        ArgumentError
            If a name is unknown, or a measurement refers to an unknown landmark, part or joint.
        """
        own = dict(zip(self.names, self.measurements, strict=True))
        chosen = [
            own[nearest_name(entry, "measurement", own)] if isinstance(entry, str) else entry
            for entry in measurements
        ]
        return replace(self, measurements=chosen)

    def mapped(
        self,
        template: Template | BodyModel,
        correspondence: Any,
        *,
        standard_pose: Mapping[str, Any] | None = None,
        axes: Any = None,
    ) -> MeasurementSet:
        """Return the measurements for another template.

        Parameters
        ----------
        template : Template or BodyModel
            The other template. For lengths along joints it must be a body model that has joints of
            these names.
        correspondence : array_like of int, pair, or sparse matrix
            Where each vertex of this template lies on the other: numbers of vertices, shape (V,); a
            pair of numbers of triangles, shape (V,), and barycentric coordinates, shape (V, 3); or
            a matrix whose rows sum to one. See `correspondence_to`.
        standard_pose : mapping of str to array_like, shape (3,), optional
            Standard pose of the other body model; by default the same rotations if it has all
            their joints, else its rest pose.
        axes : array_like, shape (3, 3), optional
            Left, up and forward of the other template, as columns; by default the same.

        Returns
        -------
        MeasurementSet

        Raises
        ------
        ArgumentError
            If the correspondence does not fit the templates.
        """
        other = template.template if isinstance(template, BodyModel) else template
        matrix = correspondence_matrix(other, correspondence)
        if matrix.shape[0] != self.n_vertices:
            raise ArgumentError(
                f"correspondence must say where {self.n_vertices} vertices lie; found "
                f"{matrix.shape[0]}"
            )
        names = template.joint_names if isinstance(template, BodyModel) else ()
        marks = {name: mark for name, mark in self.landmarks.items() if name not in names}
        nearest = nearest_triangles(matrix @ other.vertices, self.faces, other)
        parts = {name: np.flatnonzero(self.in_parts((name,))[nearest]) for name in self.parts}
        if standard_pose is None:
            known = all(joint in names for joint in self.standard_pose)
            standard_pose = self.standard_pose if known else {}
        return MeasurementSet(
            template,
            self.measurements,
            moved_landmarks(marks, matrix),
            parts,
            self.frame,
            self.axes if axes is None else axes,
            standard_pose,
        )

    def correspondence_to(
        self, template: Template | BodyModel, registered: ndarray | None = None
    ) -> tuple[ndarray, ndarray]:
        """Return the points of another template nearest to the vertices of this one.

        Parameters
        ----------
        template : Template or BodyModel
            The other template.
        registered : array, shape (V, 3), optional
            This template registered to the other one; by default the template as it is.

        Returns
        -------
        triangles : array of int, shape (V,)
            Numbers of triangles.
        coordinates : array, shape (V, 3)
            Barycentric coordinates.
        """
        other = template.template if isinstance(template, BodyModel) else template
        points = self.vertices if registered is None else np.asarray(registered, dtype=np.float64)
        places, _ = nearest_places(points, other.vertices, other.faces)
        return places.triangles, places.barycentric

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write measurements, landmarks and parts as a JSON file.

        Parameters
        ----------
        path : path_like
            File to write; an existing file is replaced.

        Raises
        ------
        FileError
            If it cannot be written.
        """
        joints = self.model.joint_names if self.model else ()
        own = {name: mark for name, mark in self.landmarks.items() if name not in joints}
        write_set(path, self, own)

    @classmethod
    def load(cls, path: str | os.PathLike[str], template: Template | BodyModel) -> MeasurementSet:
        """Read measurements, landmarks and parts from a JSON file.

        Parameters
        ----------
        path : path_like
            A file that `save` wrote.
        template : Template or BodyModel
            Template of the file, with as many vertices and triangles.

        Returns
        -------
        MeasurementSet

        Raises
        ------
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If the file does not hold measurements, or is for another template.
        """
        surface = template.template if isinstance(template, BodyModel) else template
        sizes = surface.n_vertices, surface.n_faces
        return read_set(path, sizes, lambda fields: cls(template, **fields))
