"""Measurement sets: measurements with the landmarks and parts of one template, and their files."""

from __future__ import annotations

import json
import os
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, partial
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, ArrayLike, Booleans, Integers, JSONRecord, Triangles
from riemhuman.bodies import BodyModel, correspondence_matrix
from riemhuman.checks import (
    checked,
    choice,
    each,
    instance,
    integer_array,
    items_of,
    one_of,
    real_array,
    refuse_type,
)
from riemhuman.checks.labels import texts_of
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, shown
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io.files import file_path, format_errors, read_bytes, write_text
from riemhuman.measurements._geodesics import Mesh
from riemhuman.measurements._sections import neighbours_of
from riemhuman.measurements.definitions import (
    Length,
    Measurement,
    measurement_from_dict,
    nearest_name,
)
from riemhuman.measurements.landmarked_bodies import LandmarkedBodies, axes_of_frame
from riemhuman.surfaces.template import Template

DATA = Path(__file__).parent / "data"

_FORMAT = 1
_RESOLUTIONS = ("full", "coarse")
# Weights of a landmark come from files with six digits.
_WEIGHT_TOLERANCE = 1e-3


def some_measurements(values: Iterable[object], name: str) -> tuple[object, ...]:
    """Check measurements and names of measurements."""
    entries = items_of(values, name, "a list of measurements")
    for entry in entries:
        if not isinstance(entry, (Measurement, str)):
            refuse_type(entry, name, "names or objects of Measurement")
    return entries


@checked(
    template=instance((Template, BodyModel)),
    measurements=each(instance(Measurement), "a list of measurements"),
    landmarks=instance(Mapping, "a mapping of names to landmarks"),
    parts=instance(Mapping, "a mapping of names to triangles"),
    frame=partial(texts_of, expected="four landmarks"),
    axes=partial(real_array, shape=(3, 3), batched=False),
    standard_pose=instance(Mapping, "a mapping of joints to poses"),
)
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

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> rh.measurements.open_measurements(model).with_measurements(["stature", "hip girth"])
    <MeasurementSet: 2 measurements, 171 landmarks, 1,202 vertices>
    """

    template: Template | BodyModel
    measurements: Sequence[Measurement]
    landmarks: Mapping[str, tuple[Integers, Array]] = field(default_factory=dict)
    parts: Mapping[str, Integers] = field(default_factory=dict)
    frame: Sequence[str] = ()
    axes: Array = field(default_factory=lambda: np.eye(3))
    standard_pose: Mapping[str, ArrayLike] = field(default_factory=dict)

    def __post_init__(self) -> None:
        marks = {name: self._checked_landmark(name, m) for name, m in self.landmarks.items()}
        if self.model is not None:
            for name, row in zip(self.model.joint_names, self.model.joint_regressor, strict=True):
                vertices = np.flatnonzero(row)
                marks.setdefault(name, (vertices, row[vertices]))
            for name in self.standard_pose:
                nearest_name(name, "joint", self.model.joint_names)
        parts = {
            name: integer_array(faces, f"part {name!r}", ("n_triangles",))
            for name, faces in self.parts.items()
        }
        for name, faces in parts.items():
            _check_numbers(f"part {name!r} has triangle", faces, len(self.faces))
        object.__setattr__(self, "landmarks", marks)
        object.__setattr__(self, "parts", parts)
        if not np.allclose(self.axes.T @ self.axes, np.eye(3), atol=1e-6):
            raise ArgumentError(f"axes must be orthonormal; found {self.axes.tolist()}")
        for name in self.frame:
            nearest_name(name, "landmark", marks)
        if len(self.frame) not in (0, 4):
            raise ArgumentError(f"frame must name four landmarks; found {list(self.frame)}")
        self._check_measurements()

    def _checked_landmark(self, name: str, mark: Sequence[ArrayLike]) -> tuple[Integers, Array]:
        pair = items_of(mark, f"landmark {name!r}", "a pair of vertices and weights")
        if len(pair) != 2:
            raise ArgumentError(
                f"landmark {name!r} must be a pair of vertices and weights; found {len(pair)} items"
            )
        vertices = integer_array(pair[0], f"vertices of landmark {name!r}", ("n",))
        weights = real_array(pair[1], f"weights of landmark {name!r}", ("n",), batched=False)
        if vertices.shape != weights.shape or abs(weights.sum() - 1.0) > _WEIGHT_TOLERANCE:
            raise ArgumentError(
                f"landmark {name!r} must have one weight for each vertex, with sum 1; found "
                f"vertices of shape {vertices.shape} and weights with sum {weights.sum():g}"
            )
        _check_numbers(f"landmark {name!r} is at vertex", vertices, self.n_vertices)
        # Dividing by a sum of one would change the last digits each time a file is read.
        total = float(weights.sum())
        return vertices, weights / total if abs(total - 1.0) > 1e-12 else weights

    def _check_measurements(self) -> None:
        """Raise an error if two have one name, or if one refers to what the set lacks."""
        repeated = [name for name, count in Counter(self.names).items() if count > 1]
        if repeated:
            raise ArgumentError(f"two measurements have the name {repeated[0]!r}")
        for measurement in self.measurements:
            for place in measurement.places:
                shares = {place: 1.0} if isinstance(place, str) else place
                for name in shares:
                    if name not in self.landmarks:
                        nearest_name(name, f"landmark for {measurement.name!r},", self.landmarks)
                if not abs(sum(shares.values())) > _WEIGHT_TOLERANCE:
                    raise ArgumentError(
                        "weights of a place must be numbers that do not sum to zero; found "
                        f"{shown(place)} for {measurement.name!r}"
                    )
            for name in measurement.part_names:
                nearest_name(name, f"part for {measurement.name!r},", self.parts)
            if isinstance(measurement, Length) and measurement.path == "joints":
                if self.model is None:
                    raise ArgumentError("lengths along joints need a body model; found a surface")
                for joint in measurement.along:
                    nearest_name(str(joint), "joint", self.model.joint_names)

    def __repr__(self) -> str:
        return (
            f"<MeasurementSet: {len(self.measurements)} measurements, {len(self.landmarks)} "
            f"landmarks, {self.n_vertices:,} vertices>"
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return tuple(measurement.name for measurement in self.measurements)

    @property
    def model(self) -> BodyModel | None:
        """The body model, or None if the template is a surface."""
        return self.template if isinstance(self.template, BodyModel) else None

    @cached_property
    def surface(self) -> Template:
        """The template as a surface, also for a body model."""
        return _surface_of(self.template)

    @cached_property
    def space(self) -> AlignedSurfaces:
        """Bodies of any size that have the template's triangles."""
        return AlignedSurfaces(self.surface, equip=False, scale=None)

    @cached_property
    def pose_metric(self) -> ElasticMetric:
        """The metric by which poses of these bodies are compared."""
        return ElasticMetric(self.space, 0.0, 0.0, 1.0)

    @property
    def vertices(self) -> Array:
        """Vertices of the template, shape (V, 3)."""
        return self.surface.vertices

    @property
    def faces(self) -> Triangles:
        """Triangles, shape (F, 3)."""
        return self.surface.faces

    @property
    def n_vertices(self) -> int:
        """Number of vertices V."""
        return self.surface.n_vertices

    @cached_property
    def mesh(self) -> Mesh:
        """Vertices, triangles and their neighbours."""
        # Copied, because loops would be compiled again for read-only arrays.
        return Mesh(self.vertices, self.faces.copy(), neighbours_of(self.faces))

    @cached_property
    def is_closed(self) -> bool:
        """Whether every edge has two triangles."""
        return bool((self.mesh.neighbours >= 0).all())

    @cached_property
    def volume(self) -> float:
        """Volume that the template encloses, cubic metres, if it is closed."""
        return float(LandmarkedBodies(self, self.vertices[np.newaxis], "space").volumes[0])

    @cached_property
    def axes_in_frame(self) -> Array:
        """Axes of the template in the frame of its landmarks, shape (3, 3)."""
        marks = [self.landmarks[name] for name in self.frame]
        places = [weights @ self.vertices[vertices] for vertices, weights in marks]
        return axes_of_frame(*places).T @ self.axes

    @cached_property
    def standard_pose_vector(self) -> Array:
        """Axis-angle vectors of all joints in the standard pose, shape (J, 3), radians."""
        names = self.model.joint_names if self.model else ()
        return np.array([self.standard_pose.get(name, np.zeros(3)) for name in names])

    def in_parts(self, parts: tuple[str, ...]) -> Booleans:
        """Return which triangles belong to some parts, shape (F,).

        Parameters
        ----------
        parts : tuple of str
            Names of parts; if empty, the whole body.
        """
        is_inside = np.full(len(self.faces), not parts)
        for name in parts:
            is_inside[self.parts[name]] = True
        return is_inside

    @checked(measurements=some_measurements)
    def with_measurements(self, measurements: Iterable[Measurement | str]) -> MeasurementSet:
        """Return the same landmarks and parts with other measurements.

        Parameters
        ----------
        measurements : iterable of Measurement or str
            New measurements, or names of this set's.
        """
        by_name = dict(zip(self.names, self.measurements, strict=True))
        chosen = tuple(
            by_name[nearest_name(entry, "measurement", by_name)]
            if isinstance(entry, str)
            else entry
            for entry in measurements
        )
        # All else stays the same, also data prepared for the surface, such as strips of paths.
        changed = copy(self)
        object.__setattr__(changed, "measurements", chosen)
        vars(changed).pop("names", None)
        changed._check_measurements()
        return changed

    def mapped(
        self, template: Template | BodyModel, correspondence: ArrayLike | sparse.csr_array
    ) -> MeasurementSet:
        """Return the measurements for another template.

        The axes and the rotations of the standard pose stay the same. A body model that lacks some
        of the joints is measured in its rest pose.

        Parameters
        ----------
        template : Template or BodyModel
            The other template. For lengths along joints it must be a body model that has joints of
            these names.
        correspondence : array_like of int, pair, or sparse matrix
            Where each vertex of this template lies on the other, such as
            `rh.surfaces.nearest_points` returns it, as for `rh.bodies.correspondence_matrix`.
        """
        surface = _surface_of(template)
        matrix = correspondence_matrix(surface, correspondence)
        if matrix.shape[0] != self.n_vertices:
            raise ArgumentError(
                f"correspondence must say where {self.n_vertices} vertices lie; found "
                f"{matrix.shape[0]}"
            )
        joints = template.joint_names if isinstance(template, BodyModel) else ()
        landmarks = {}
        for name, (vertices, weights) in self.landmarks.items():
            if name not in joints:
                row = sparse.csr_array(weights @ matrix[vertices])
                landmarks[name] = row.indices.astype(np.int64), row.data
        # A triangle belongs to the parts of this template's triangle with the nearest centroid.
        tree = cKDTree((matrix @ surface.vertices)[self.faces].mean(axis=1))
        nearest = tree.query(surface.vertices[surface.faces].mean(axis=1))[1]
        parts = {name: np.flatnonzero(self.in_parts((name,))[nearest]) for name in self.parts}
        has_all = all(joint in joints for joint in self.standard_pose)
        standard_pose = self.standard_pose if has_all else {}
        return MeasurementSet(
            template, self.measurements, landmarks, parts, self.frame, self.axes, standard_pose
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write measurements, landmarks and parts as a JSON file.

        Parameters
        ----------
        path : path_like
            File to write; an existing file is replaced.
        """
        joints = self.model.joint_names if self.model else ()
        record: JSONRecord = {
            "format": _FORMAT,
            "n_vertices": self.n_vertices,
            "n_faces": len(self.faces),
            "measurements": [measurement.to_dict() for measurement in self.measurements],
            "landmarks": {
                name: {"vertices": vertices.tolist(), "weights": weights.tolist()}
                for name, (vertices, weights) in self.landmarks.items()
                if name not in joints
            },
            "parts": {name: _as_runs(faces) for name, faces in self.parts.items()},
            "frame": list(self.frame),
            "axes": self.axes.tolist(),
            "standard_pose": {n: np.asarray(v).tolist() for n, v in self.standard_pose.items()},
        }
        write_text(path, _as_json(record))

    @classmethod
    def load(cls, path: str | os.PathLike[str], template: Template | BodyModel) -> MeasurementSet:
        """Read measurements, landmarks and parts from a JSON file.

        Parameters
        ----------
        path : path_like
            A file that `save` wrote.
        template : Template or BodyModel
            Template of the file, with the same numbers of vertices and triangles.
        """
        surface, file = _surface_of(template), file_path(path)
        with format_errors(file, "definitions of measurements"):
            record = json.loads(read_bytes(file))
            if (record["n_vertices"], record["n_faces"]) != (surface.n_vertices, surface.n_faces):
                raise ArgumentError(
                    f"it is for {record['n_vertices']} vertices and {record['n_faces']} triangles; "
                    f"the template has {surface.n_vertices} and {surface.n_faces}"
                )
            definitions = [measurement_from_dict(entry) for entry in record["measurements"]]
            marks = record["landmarks"].items()
            landmarks = {name: (mark["vertices"], mark["weights"]) for name, mark in marks}
            count = surface.n_faces
            parts = {name: _from_runs(runs, count) for name, runs in record["parts"].items()}
            return cls(
                template,
                definitions,
                landmarks,
                parts,
                record["frame"],
                record["axes"],
                record["standard_pose"],
            )


def _surface_of(template: Template | BodyModel) -> Template:
    if isinstance(template, BodyModel):
        return template.template
    if not isinstance(template, Template):
        refuse_type(template, "model", "a BodyModel, a Template or a resolution")
    return template


def _check_numbers(what: str, numbers: Integers, count: int) -> None:
    wrong = numbers[(numbers < 0) | (numbers >= count)]
    if wrong.size:
        raise ArgumentError(f"{what} {wrong[0]}; there are {count}")


def _as_json(record: JSONRecord) -> str:
    """Return JSON with a line for each measurement, landmark and part, for legible changes."""
    blocks = []
    for key, value in record.items():
        if key == "measurements":
            entries = [json.dumps(entry, ensure_ascii=False) for entry in value]
            text = _in_lines("[", entries, "]")
        elif isinstance(value, dict):
            entries = [f"{json.dumps(name)}: {json.dumps(entry)}" for name, entry in value.items()]
            text = _in_lines("{", entries, "}")
        else:
            text = json.dumps(value)
        blocks.append(f' "{key}": {text}')
    return "{\n" + ",\n".join(blocks) + "\n}\n"


def _in_lines(opening: str, entries: Sequence[str], closing: str) -> str:
    if not entries:
        return opening + closing
    lines = ",\n".join(f"  {entry}" for entry in entries)
    return f"{opening}\n{lines}\n {closing}"


def _as_runs(numbers: Integers) -> list[list[int]]:
    """Return whole numbers as the first and last of each run of consecutive ones."""
    ordered = np.unique(numbers)
    breaks = np.flatnonzero(np.diff(ordered) > 1)
    firsts = np.concatenate([ordered[:1], ordered[breaks + 1]])
    lasts = np.concatenate([ordered[breaks], ordered[-1:]])
    runs: list[list[int]] = np.stack([firsts, lasts], axis=1).tolist()
    return runs


def _from_runs(runs: Sequence[Sequence[int]], count: int) -> Integers:
    for run in runs:
        _check_numbers("a part has triangle", np.array(run), count)
    ranges = [np.arange(first, last + 1) for first, last in runs]
    return np.concatenate(ranges) if ranges else np.empty(0, dtype=np.int64)


@checked(pose=choice("standing", "seated"))
def open_measurements(
    model: BodyModel | Template | str = "full", pose: str = "standing"
) -> MeasurementSet | None:
    """Return the measurements of the open body model.

    Parameters
    ----------
    model : BodyModel, Template, "full" or "coarse"
        The open model or a template with the same triangles, or a resolution of the model.
    pose : {"standing", "seated"}
        Whether the set holds the measurements of people who stand, or of people who sit with their
        forearms forward; its standard pose is the corresponding pose.

    Returns
    -------
    MeasurementSet or None
        The set of the open model of that resolution; None for other triangles.

    Examples
    --------
    >>> rh.measurements.open_measurements("coarse").names[:2]
    ('stature', 'cervical height')
    """
    if isinstance(model, str):
        return _load_open_set(one_of(model, "model", _RESOLUTIONS), pose)
    faces = _surface_of(model).faces
    for resolution in _RESOLUTIONS:
        if np.array_equal(load_open_model(resolution).faces, faces):
            return _load_open_set(resolution, pose)
    return None


@cache
def load_json(name: str) -> JSONRecord:
    """Return what a file of this subpackage's data holds."""
    record: JSONRecord = json.loads((DATA / name).read_text(encoding="utf-8"))
    return record


@cache
def _load_open_set(resolution: str, pose: str) -> MeasurementSet:
    if pose == "standing":
        path = DATA / f"open_body_{resolution}.json"
        return MeasurementSet.load(path, load_open_model(resolution))
    seated = load_json("seated.json")
    definitions = [measurement_from_dict(entry) for entry in seated["measurements"]]
    standing = _load_open_set(resolution, "standing")
    return replace(standing, measurements=definitions, standard_pose=seated["standard_pose"])
