"""Kinds of measurements: records of parameters that JSON can hold.

A measurement refers to landmarks, axes and parts by name; a
`riemhuman.measurements.MeasurementSet` locates them on a template.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from difflib import get_close_matches
from functools import partial
from itertools import pairwise
from typing import ClassVar

import autograd.numpy as np
from autograd.core import make_vjp

from riemhuman.arrays import Array, JSONRecord, JSONValue
from riemhuman.checks import (
    checked,
    choice,
    flag,
    items_of,
    one_of,
    positive,
    refuse_type,
    values_of,
)
from riemhuman.checks.labels import texts_of
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    DegenerateSurfaceError,
    UnknownNameError,
    shown,
)
from riemhuman.extensions import extensions
from riemhuman.measurements._geodesics import geodesics
from riemhuman.measurements._sections import (
    MEETS_OTHER_PART,
    MISSES,
    OPEN,
    Lines,
    section,
    straight_lines,
)
from riemhuman.measurements._vertex_slopes import VertexSlopes, fixed
from riemhuman.measurements.landmarked_bodies import AXES, LandmarkedBodies, Place

# Density of a body in kg/m³: that of water; a body's differs by a few per cent.
DENSITY = 1000.0

Parts = tuple[str, ...]
Places = tuple[Place, ...]
Axis = str | Places

_PATHS = ("straight", "surface", "joints")

# Classes of measurements by their `kind`, and then by the modules that define them.
_CLASSES: dict[str, dict[str, type[Measurement]]] = {}


def _add_kind(cls: type[Measurement]) -> None:
    """Let files name a class; a class defined again in its module replaces the earlier one."""
    classes = _CLASSES.setdefault(cls.kind, {})
    if __name__ in classes and cls.__module__ != __name__:
        raise ArgumentError(
            f"the library already has measurements of kind {cls.kind!r}; declare another `kind` "
            f"in the class {cls.__qualname__} of {cls.__module__}"
        )
    classes[cls.__module__] = cls


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """The base class of measurements.

    Your own measurement is a frozen dataclass that derives from this class. It defines `value` and,
    for pictures, `lines`. If its fields name landmarks and parts, it defines `places` and
    `part_names`, so that a `MeasurementSet` can look them up. If its value may be NaN, it defines
    `why_missing`. If fields need checks or are tuples (which JSON returns as lists), it defines a
    ``__post_init__`` that calls the one of this class.

    Files of a `MeasurementSet` store `kind`, by default the name of the class, and its fields,
    which must be representable in JSON. To read such a file, the class must have been defined or
    imported, or be named by an installed package, see `riemhuman.extensions`.

    Parameters
    ----------
    name : str
        Name in tables.
    standard : str
        The standard that defines it, such as "ISO 8559-1".
    note : str
        A remark.
    equivalents : mapping of str to str
        What others call it, such as ``{"ANSUR II": "stature"}``; "≈ " before a name marks a
        measurement that differs slightly, as the note says.

    Attributes
    ----------
    units : str
        Units of the values; an attribute of the class.
    kind : str
        Name of the class in files.

    Examples
    --------
    >>> isinstance(rh.measurements.Height(name="stature", at="crown"), rh.measurements.Measurement)
    True
    """

    name: str
    standard: str = ""
    note: str = ""
    equivalents: Mapping[str, str] = field(default_factory=dict)
    units: ClassVar[str] = "m"
    kind: ClassVar[str] = "Measurement"
    _is_traced: ClassVar[bool] = False

    def __init_subclass__(cls, **settings: object) -> None:
        super().__init_subclass__(**settings)
        if "value" in vars(cls):
            # For user-defined values, autograd computes the derivatives.
            cls._is_traced = "_slopes" not in vars(cls)
        if "kind" not in vars(cls):
            cls.kind = cls.__name__
        if not cls.kind.startswith("_"):
            _add_kind(cls)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ArgumentTypeError(f"name must be a non-empty string; found {shown(self.name)}")

    @property
    def places(self) -> tuple[Place, ...]:
        """Places that the measurement refers to."""
        return ()

    @property
    def part_names(self) -> tuple[str, ...]:
        """Parts of the body that the measurement refers to."""
        return ()

    def value(self, bodies: LandmarkedBodies) -> Array:
        """Return the measurement of each body, NaN where it is not defined, shape (n,).

        Parameters
        ----------
        bodies : LandmarkedBodies
        """
        lengths = [path.lengths for path in self._paths(bodies)]
        return sum(lengths[1:], start=lengths[0])

    def value_and_slopes(self, bodies: LandmarkedBodies) -> tuple[Array, VertexSlopes]:
        """Return the measurement of each body and its derivatives by the vertices.

        Parameters
        ----------
        bodies : LandmarkedBodies
        """
        if not self._is_traced:
            return self._slopes(bodies)
        pull_back, value = make_vjp(lambda moved: self.value(bodies.moved(moved)), bodies.surfaces)
        slopes = VertexSlopes(bodies.surfaces.shape)
        slopes.add_of_all(pull_back(np.ones(len(bodies.surfaces))))
        return value, slopes

    def _slopes(self, bodies: LandmarkedBodies) -> tuple[Array, VertexSlopes]:
        """Return `value` and its derivatives, written out; a class defines both of them or none."""
        slopes = VertexSlopes(bodies.surfaces.shape)
        paths = self._paths(bodies)
        for path in paths:
            path.pull_lengths(slopes)
        lengths = [path.lengths for path in paths]
        return sum(lengths[1:], start=lengths[0]), slopes

    def lines(self, bodies: LandmarkedBodies) -> list[Array]:
        """Return the measurement lines on the first body, each of shape (k, 3).

        Parameters
        ----------
        bodies : LandmarkedBodies
        """
        return [path.points[path.bodies == 0] for path in self._paths(bodies)]

    def _paths(self, bodies: LandmarkedBodies) -> list[Lines]:
        """Return the lines whose lengths add up to the measurement."""
        return []

    def why_missing(self, bodies: LandmarkedBodies) -> str:
        """Return why the measurement of the first body is not defined.

        Parameters
        ----------
        bodies : LandmarkedBodies
        """
        return "there is no path along the surface"

    def to_dict(self) -> JSONRecord:
        """Return the record for JSON: the kind, and the parameters other than defaults."""
        defaults = {f.name: f.default for f in fields(self)} | {"equivalents": {}}
        record: JSONRecord = {"kind": self.kind}
        for name, value in asdict(self).items():
            if value != defaults[name]:
                record[name] = list(value) if isinstance(value, tuple) else value
        return record


_some_parts = partial(texts_of, expected="a list of names")


def _several_places(places: Sequence[Place], name: str) -> Places:
    several = items_of(places, name, "a list of two or more places")
    if len(several) < 2:
        raise ArgumentError(f"{name} must hold two or more places; found {shown(places)}")
    return several


def _an_axis(axis: str | Sequence[Place], name: str) -> Axis:
    if isinstance(axis, str):
        return str(one_of(axis, name, AXES))
    if not isinstance(axis, Sequence) or len(axis) not in (2, 3):
        raise ArgumentError(f"{name} must be an axis or two or three places; found {shown(axis)}")
    return tuple(axis)


def _places_of(axis: Axis | None) -> Places:
    """Return the landmarks that an axis refers to; none if it is an axis of the body."""
    return axis if isinstance(axis, tuple) else ()


@checked(normal=_an_axis, parts=_some_parts, leave_out=_some_parts)
@dataclass(frozen=True, kw_only=True)
class _PlaneSection(Measurement):
    """A measurement of the section of the body by a plane."""

    at: Place
    normal: Axis = "up"
    parts: Parts = ()
    leave_out: Parts = ()

    @property
    def places(self) -> Places:
        return (self.at, *_places_of(self.normal))

    @property
    def part_names(self) -> Parts:
        return (*self.parts, *self.leave_out)

    def why_missing(self, bodies: LandmarkedBodies) -> str:
        parts = " and ".join(self.parts) or "the surface"
        return {
            MISSES: f"its plane misses {parts}",
            MEETS_OTHER_PART: f"its line leaves {parts} and meets another part of the body; list "
            "that part in leave_out, or measure at another place or in another pose",
            OPEN: f"its line around {parts} meets a boundary or a defect of the mesh",
        }[self._section(bodies).statuses[0]]

    def _section(self, bodies: LandmarkedBodies) -> Lines:
        return section(
            bodies.surfaces,
            bodies.place(self.at),
            bodies.axis(self.normal),
            bodies.cutter(self.parts, self.leave_out),
            (partial(bodies.pull_place, self.at), partial(bodies.pull_axis, self.normal)),
        )


@checked(hull=flag)
@dataclass(frozen=True, kw_only=True)
class Girth(_PlaneSection):
    """The length of the closed line around a part of the body, in a plane.

    Parameters
    ----------
    name, standard, note, equivalents
        As for `Measurement`.
    at : str or mapping of str to float
        A place in the plane: a landmark, or landmarks with weights. The line nearest to it is
        measured.
    normal : str or sequence of places
        Normal of the plane: "up", "left", "forward", the direction from one place to another, such
        as along a bone, or the normal of the plane through three places.
    parts : sequence of str
        Parts of the body that are measured; by default the whole body.
    leave_out : sequence of str
        Parts that the line crosses without being measured, such as arms that touch the chest; they
        require ``hull=True``.
    hull : bool
        Whether to measure the convex hull of the line, as a tape measure that spans hollows.

    Examples
    --------
    >>> rh.measurements.Girth(name="waist girth", at="waist", parts=["trunk"], hull=True).hull
    True
    """

    hull: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.leave_out and not self.hull:
            raise ArgumentError(f"{self.name!r} has leave_out; it needs hull=True")

    def _paths(self, bodies: LandmarkedBodies) -> list[Lines]:
        line = self._section(bodies)
        return [line.hulls(values_of(bodies.axis(self.normal))) if self.hull else line.closed()]


@checked()
@dataclass(frozen=True, kw_only=True)
class Breadth(_PlaneSection):
    """The extent of a section of the body from side to side.

    Parameters
    ----------
    name, standard, note, equivalents, at, normal, parts, leave_out
        As for `Girth`.

    Examples
    --------
    >>> rh.measurements.Breadth(name="hip breadth", at="left_buttock", parts=["trunk"]).parts
    ('trunk',)
    """

    _direction: ClassVar[str] = "left"

    def _paths(self, bodies: LandmarkedBodies) -> list[Lines]:
        pull = partial(bodies.pull_axis, self._direction)
        return [self._section(bodies).extents(bodies.axis(self._direction), pull)]


@checked()
@dataclass(frozen=True, kw_only=True)
class Depth(Breadth):
    """The extent of a section of the body from back to front.

    Parameters
    ----------
    name, standard, note, equivalents, at, normal, parts, leave_out
        As for `Girth`.

    Examples
    --------
    >>> rh.measurements.Depth(name="chest depth", at="under_bust", parts=["trunk"]).parts
    ('trunk',)
    """

    _direction: ClassVar[str] = "forward"


@dataclass(frozen=True, kw_only=True)
class Height(Measurement):
    """The height of a place above the floor, along the axis "up".

    Parameters
    ----------
    name, standard, note, equivalents
        As for `Measurement`.
    at : str or mapping of str to float
        The place: a landmark, or landmarks with weights.
    above : str or mapping of str to float, optional
        Place from which the height is measured; by default the floor, at the lowest vertex.

    Examples
    --------
    >>> rh.measurements.Height(name="stature", at="crown").to_dict()
    {'kind': 'Height', 'name': 'stature', 'at': 'crown'}
    """

    at: Place
    above: Place | None = None

    @property
    def places(self) -> Places:
        return (self.at,) if self.above is None else (self.at, self.above)

    def value(self, bodies: LandmarkedBodies) -> Array:
        up = bodies.axis("up")
        height = np.sum(bodies.place(self.at) * up, axis=-1)
        if self.above is not None:
            return height - np.sum(bodies.place(self.above) * up, axis=-1)
        return height - bodies.floor

    def _slopes(self, bodies: LandmarkedBodies) -> tuple[Array, VertexSlopes]:
        slopes = VertexSlopes(bodies.surfaces.shape)
        bodies.pull_height(self.at, self.above, slopes)
        return self.value(bodies), slopes

    def lines(self, bodies: LandmarkedBodies) -> list[Array]:
        top = bodies.place(self.at)[0]
        return [np.stack([top, top - self.value(bodies)[0] * bodies.axis("up")[0]])]


@checked(along=_several_places, path=choice(*_PATHS), axis=_an_axis)
@dataclass(frozen=True, kw_only=True)
class Length(Measurement):
    """The length of a path through places of the body.

    Parameters
    ----------
    name, standard, note, equivalents
        As for `Measurement`.
    along : sequence of places
        Two or more places in order; for the path "joints", the first and the last joint.
    path : {"straight", "surface", "joints"}
        Straight lines between the places, geodesics on the surface between them, or straight lines
        from joint to joint of the body model.
    axis : str or sequence of places, optional
        Axis along which straight lines are measured, as between the arms of a calliper, in the form
        of the normal of a `Girth`; by default they are measured along their own directions.

    Examples
    --------
    >>> rh.measurements.Length(name="leg", along=["left_hip", "left_ankle"], path="joints").along
    ('left_hip', 'left_ankle')
    """

    along: Places
    path: str = "straight"
    axis: Axis | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.path == "joints" and [type(place) for place in self.along] != [str, str]:
            raise ArgumentError(f"along must hold two names of joints; found {shown(self.along)}")

    @property
    def places(self) -> Places:
        return (*self.along, *_places_of(self.axis))

    def _paths(self, bodies: LandmarkedBodies) -> list[Lines]:
        if self.path == "surface":
            places = [bodies.on_surface(place) for place in self.along]
            return [
                geodesics(bodies.surfaces, start, end, bodies.set.mesh)
                for start, end in pairwise(places)
            ]
        stops = self.along
        if self.path == "joints":
            first, last = map(str, self.along)
            stops = bodies.bones(first, last)
        return [self._straight_line(bodies, start, end) for start, end in pairwise(stops)]

    def _straight_line(self, bodies: LandmarkedBodies, start: Place, end: Place) -> Lines:
        axis, pull_axis = None, fixed
        if self.axis is not None:
            axis, pull_axis = bodies.axis(self.axis), partial(bodies.pull_axis, self.axis)
        pulls = partial(bodies.pull_place, start), partial(bodies.pull_place, end), pull_axis
        return straight_lines(bodies.place(start), bodies.place(end), axis, pulls)


@dataclass(frozen=True, kw_only=True)
class Volume(Measurement):
    """The volume that the surface encloses; the surface must be closed.

    Parameters
    ----------
    name, standard, note, equivalents
        As for `Measurement`.

    Examples
    --------
    >>> rh.measurements.Volume(name="volume").units
    'm³'
    """

    units: ClassVar[str] = "m³"

    def value(self, bodies: LandmarkedBodies) -> Array:
        if not bodies.set.is_closed:
            raise DegenerateSurfaceError(
                f"{self.name!r} needs a closed surface; the template has boundaries"
            )
        return bodies.volumes

    def _slopes(self, bodies: LandmarkedBodies) -> tuple[Array, VertexSlopes]:
        slopes = VertexSlopes(bodies.surfaces.shape)
        values = self.value(bodies)
        slopes.add_of_all(bodies.volume_slopes)
        return values, slopes


@checked(density=positive)
@dataclass(frozen=True, kw_only=True)
class Mass(Volume):
    """An estimate of the body mass: the volume times a density.

    Parameters
    ----------
    name, standard, note, equivalents
        As for `Measurement`.
    density : float
        Kilograms per cubic metre.

    Examples
    --------
    >>> rh.measurements.Mass(name="mass, estimated", density=1010.0).units
    'kg'
    """

    density: float = DENSITY
    units: ClassVar[str] = "kg"

    def value(self, bodies: LandmarkedBodies) -> Array:
        return self.density * super().value(bodies)

    def _slopes(self, bodies: LandmarkedBodies) -> tuple[Array, VertexSlopes]:
        slopes = VertexSlopes(bodies.surfaces.shape)
        values = self.value(bodies)
        slopes.add_of_all(self.density * bodies.volume_slopes)
        return values, slopes


@checked(parts=_some_parts)
@dataclass(frozen=True, kw_only=True)
class Area(Measurement):
    """The area of the surface or of parts of it.

    Parameters
    ----------
    name, standard, note, equivalents
        As for `Measurement`.
    parts : sequence of str
        Parts of the body; by default the whole body.

    Examples
    --------
    >>> rh.measurements.Area(name="left arm", parts=["left arm"]).units
    'm²'
    """

    parts: Parts = ()
    units: ClassVar[str] = "m²"

    @property
    def part_names(self) -> Parts:
        return self.parts

    def value(self, bodies: LandmarkedBodies) -> Array:
        return np.sum(bodies.triangle_areas[:, bodies.set.in_parts(self.parts)], axis=-1)

    def _slopes(self, bodies: LandmarkedBodies) -> tuple[Array, VertexSlopes]:
        slopes = VertexSlopes(bodies.surfaces.shape)
        slopes.add_of_all(bodies.area_slopes(bodies.set.in_parts(self.parts)))
        return self.value(bodies), slopes


def _class_of(kind: str) -> type[Measurement]:
    """Return the class of a kind of measurements, also of an installed package."""
    if kind not in _CLASSES:
        extensions("measurements")  # importing the classes of installed packages adds their kinds
    if kind not in _CLASSES:
        try:
            nearest_name(kind, "kind of measurement", _CLASSES)
        except ArgumentError as error:
            raise ArgumentError(f"{error}; import a class of your own first") from None
    classes = _CLASSES[kind]
    if len(classes) > 1:
        raise ArgumentError(
            f"modules {' and '.join(classes)} both define measurements of kind {kind!r}; declare "
            "another `kind` in one of the classes"
        )
    return next(iter(classes.values()))


def measurement_from_dict(record: Mapping[str, JSONValue]) -> Measurement:
    """Return the measurement that a JSON record describes.

    Parameters
    ----------
    record : mapping
        The name of its class under "kind", see `Measurement`, and its parameters.

    Examples
    --------
    >>> record = {"kind": "Height", "name": "stature", "at": "crown"}
    >>> rh.measurements.measurement_from_dict(record).at
    'crown'
    """
    if not isinstance(record, Mapping):
        raise ArgumentTypeError(f"a measurement must be a mapping; found {shown(record)}")
    parameters = dict(record)
    cls = _class_of(str(parameters.pop("kind", "")))
    known = [field.name for field in fields(cls)]
    for name in parameters:
        nearest_name(name, f"parameter of {cls.__name__}", known)
    try:
        return cls(**parameters)
    except TypeError as error:
        if isinstance(error, ArgumentTypeError):
            raise
        raise ArgumentError(f"a {cls.__name__} cannot be made of {record!r}: {error}") from error


def nearest_name(name: str, what: str, names: Sequence[str] | Mapping[str, object]) -> str:
    """Return a name if it is among `names`; otherwise raise an error that offers the nearest ones.

    `what` says what has the name, in the message.
    """
    if not isinstance(name, str):
        refuse_type(name, f"the name of a {what}", "a text")
    if name in names:
        return name
    matches = get_close_matches(str(name), list(names), n=3, cutoff=0.5)
    if matches:
        advice = f"did you mean {' or '.join(map(repr, matches))}?"
    else:
        advice = f"there are {', '.join(map(repr, names)) or 'none'}"
    raise UnknownNameError(f"there is no {what} {name!r}; {advice}")
