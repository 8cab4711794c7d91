"""Definitions of measurements: small declarative objects that JSON can hold.

A measurement knows landmarks, axes and parts by name; `riemhuman.measurements.MeasurementSet` says
where they are on a template. A place is a landmark, or an affine combination of landmarks, such as
``{"right_shoulder": 0.5, "right_elbow": 0.5}``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, asdict, dataclass, field, fields
from difflib import get_close_matches
from itertools import pairwise
from typing import TYPE_CHECKING, Any, ClassVar

import autograd.numpy as np

from riemhuman.checks import one_of, real_number
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.measurements.sections import EXTENT, HULL, LENGTH

if TYPE_CHECKING:
    from riemhuman.measurements.landmarks import LandmarkedBodies

Place = str | Mapping[str, float]
AXES = ("up", "left", "forward")
PATHS = ("straight", "surface", "joints")

DENSITY = 1000.0
"""Density of a body in kg/m³: that of water, from which people with air in their lungs differ by
a few per cent."""


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """The base class of measurements.

    Parameters
    ----------
    name : str
        Its name in tables.
    standard : str
        The standard that defines it, where there is one.
    note : str
        What is to be known about it.

    Examples
    --------
    >>> import riemhuman as rh
    >>> isinstance(rh.measurements.Height(name="stature", at="crown"), rh.measurements.Measurement)
    True
    """

    name: str
    standard: str = ""
    note: str = ""
    units: ClassVar[str] = "m"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name:
            raise ArgumentTypeError(f"name must be a text; found {self.name!r}")

    @property
    def places(self) -> tuple[Place, ...]:
        """Places it is taken at."""
        return ()

    @property
    def parts_named(self) -> tuple[str, ...]:
        """Parts of the body it refers to."""
        return ()

    def value(self, bodies: LandmarkedBodies) -> Any:
        """Return the values of bodies, differentiable by autograd.

        Parameters
        ----------
        bodies : LandmarkedBodies
            Bodies with landmarks.

        Returns
        -------
        array, shape (n,)
            NaN where it cannot be taken.
        """
        raise NotImplementedError

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        """Return where the tape runs on the first of the bodies.

        Parameters
        ----------
        bodies : LandmarkedBodies
            Bodies with landmarks.

        Returns
        -------
        curves : list of array, shape (k, 3)
            Empty for volumes and areas.
        """
        return []

    def to_dict(self) -> dict[str, Any]:
        """Return it as JSON has it, with its kind.

        Returns
        -------
        dict
        """
        plain = {f.name: f.default for f in fields(self) if f.default is not MISSING}
        record = {k: v for k, v in asdict(self).items() if k not in plain or v != plain[k]}
        return {
            "kind": type(self).__name__,
            **{k: _listed(v) for k, v in record.items() if v != ()},
        }


@dataclass(frozen=True, kw_only=True)
class PlaneSection(Measurement):
    """A measurement taken of a plane section through a place.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    at : str or mapping of str to float
        A place in the plane.
    normal : str or pair of places
        Normal of the plane: "up" for level planes, "left", "forward", or from one place to another,
        for planes perpendicular to a bone.
    parts : sequence of str
        Parts of the body that the loop may run over; all of the body by default.
    leave_out : sequence of str
        Parts that are cut away from the loop, such as arms that hang at the chest.
    """

    at: Place
    normal: Any = "up"
    parts: tuple[str, ...] = ()
    leave_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "parts", _names(self.parts, "parts"))
        object.__setattr__(self, "leave_out", _names(self.leave_out, "leave_out"))
        if isinstance(self.normal, str):
            one_of(self.normal, "normal", AXES)
        elif not isinstance(self.normal, Sequence) or len(self.normal) != 2:
            raise ArgumentError(f"normal must be an axis or two places; found {self.normal!r}")
        else:
            object.__setattr__(self, "normal", tuple(self.normal))

    @property
    def places(self) -> tuple[Place, ...]:
        bone = () if isinstance(self.normal, str) else tuple(self.normal)
        return (self.at, *bone)

    @property
    def parts_named(self) -> tuple[str, ...]:
        return (*self.parts, *self.leave_out)

    def _size(self, bodies: LandmarkedBodies, kind: int, direction: str) -> Any:
        return bodies.section_sizes(
            self.parts, self.leave_out, self.at, self.normal, bodies.axis(direction), kind
        )

    def _loop(self, bodies: LandmarkedBodies) -> Any:
        return bodies.section(self.parts, self.leave_out, self.at, self.normal)


@dataclass(frozen=True, kw_only=True)
class Girth(PlaneSection):
    """The length of a loop around a part of the body.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    at : str or mapping of str to float
        A place in the plane of the loop.
    normal : str or pair of places
        Normal of the plane: "up" for level planes, "left", "forward", or from one place to another,
        for planes perpendicular to a bone.
    parts : sequence of str
        Parts of the body that the loop may run over; all of the body by default.
    leave_out : sequence of str
        Parts that are cut away from the loop, such as arms; they ask for a hull.
    hull : bool
        Whether the tape spans hollows: the length of the convex hull of the loop.

    Examples
    --------
    >>> import riemhuman as rh
    >>> rh.measurements.Girth(name="waist girth", at="waist", parts=["trunk"], hull=True).hull
    True
    """

    hull: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.leave_out and not self.hull:
            raise ArgumentError(f"{self.name!r} leaves parts out; its tape needs hull=True")

    def value(self, bodies: LandmarkedBodies) -> Any:
        return self._size(bodies, HULL if self.hull else LENGTH, "up")

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        return [bodies.tape(self._loop(bodies), self.hull)]


@dataclass(frozen=True, kw_only=True)
class Breadth(PlaneSection):
    """The extent of a section of the body from side to side.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    at : str or mapping of str to float
        A place in the plane of the section.
    normal : str or pair of places
        Normal of the plane, as of `Girth`.
    parts, leave_out : sequence of str
        Parts that the section runs over, and parts that are cut away from it.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> hips = rh.measurements.Breadth(name="hip breadth", at="left_buttock", parts=["trunk"])
    >>> own = rh.measurements.Measurements(bodies.model, [hips])
    >>> own.names, own.units
    (('hip breadth',), ('m',))
    """

    _direction: ClassVar[str] = "left"

    def value(self, bodies: LandmarkedBodies) -> Any:
        return self._size(bodies, EXTENT, self._direction)

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        loop, axis = self._loop(bodies), bodies.axis(self._direction)[0]
        middle = loop.mean(axis=0)
        ends = ((loop - middle) @ axis).min(), ((loop - middle) @ axis).max()
        return [middle + np.array(ends)[:, None] * axis]


@dataclass(frozen=True, kw_only=True)
class Depth(Breadth):
    """The extent of a section of the body from back to front.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    at : str or mapping of str to float
        A place in the plane of the section.
    normal : str or pair of places
        Normal of the plane, as of `Girth`.
    parts, leave_out : sequence of str
        Parts that the section runs over, and parts that are cut away from it.

    Examples
    --------
    >>> import riemhuman as rh
    >>> chest = rh.measurements.Depth(name="chest depth", at="under_bust", parts=["trunk"])
    >>> chest.to_dict()["kind"]
    'Depth'
    """

    _direction: ClassVar[str] = "forward"


@dataclass(frozen=True, kw_only=True)
class Height(Measurement):
    """The height of a place above the floor, along the standing axis.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    at : str or mapping of str to float
        The place.
    above : str or mapping of str to float, optional
        Another place to measure from; by default the floor, at the lowest vertex.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> crown = rh.measurements.Height(name="stature", at="crown")
    >>> own = rh.measurements.Measurements(bodies.model, [crown])
    >>> round(float(own.measure(bodies[0])["stature"]), 2)
    1.85
    """

    at: Place
    above: Any = None

    @property
    def places(self) -> tuple[Place, ...]:
        return (self.at,) if self.above is None else (self.at, self.above)

    def value(self, bodies: LandmarkedBodies) -> Any:
        up = bodies.axis("up")
        height = np.sum(bodies.place(self.at) * up, axis=-1)
        if self.above is not None:
            return height - np.sum(bodies.place(self.above) * up, axis=-1)
        return height - bodies.floor()

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        top = bodies.place(self.at)[0]
        return [np.stack([top, top - self.value(bodies)[0] * bodies.axis("up")[0]])]


@dataclass(frozen=True, kw_only=True)
class Length(Measurement):
    """The length of a way from place to place.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    along : sequence of places
        Two places or more. Of "joints", the first and the last joint.
    path : {"straight", "surface", "joints"}
        Straight from place to place; along the shortest path on the surface between them; or from
        joint to joint of the body model's tree.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> leg = rh.measurements.Length(name="leg", along=["left_hip", "left_ankle"], path="joints")
    >>> own = rh.measurements.Measurements(bodies.model, [leg])
    >>> own.measure(bodies.points[:2]).values.shape
    (2, 1)
    """

    along: tuple[Place, ...]
    path: str = "straight"

    def __post_init__(self) -> None:
        super().__post_init__()
        one_of(self.path, "path", PATHS)
        if isinstance(self.along, (str, Mapping)) or len(self.along) < 2:
            raise ArgumentError(f"along must hold two places or more; found {self.along!r}")
        object.__setattr__(self, "along", tuple(self.along))
        if self.path == "joints" and (
            len(self.along) != 2 or not all(isinstance(place, str) for place in self.along)
        ):
            raise ArgumentError(f"along must hold two names of joints; found {self.along!r}")

    @property
    def places(self) -> tuple[Place, ...]:
        return self.along

    def _stations(self, bodies: LandmarkedBodies) -> tuple[Place, ...]:
        if self.path == "joints":
            first, last = self.along
            return bodies.bones(str(first), str(last))
        return self.along

    def value(self, bodies: LandmarkedBodies) -> Any:
        stations = self._stations(bodies)
        pairs = pairwise(stations)
        if self.path == "surface":
            return sum(bodies.geodesic_lengths(*pair) for pair in pairs)
        steps = (bodies.place(one) - bodies.place(other) for one, other in pairs)
        return sum(np.sqrt(np.sum(step**2, axis=-1)) for step in steps)

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        stations = self._stations(bodies)
        if self.path == "surface":
            pairs = pairwise(stations)
            return [bodies.geodesic(*pair) for pair in pairs]
        return [np.stack([bodies.place(place)[0] for place in stations])]


@dataclass(frozen=True, kw_only=True)
class Volume(Measurement):
    """The volume inside the surface, which must be closed.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> own = rh.measurements.Measurements(bodies.model, [rh.measurements.Volume(name="volume")])
    >>> own.units
    ('m³',)
    """

    units: ClassVar[str] = "m³"

    def value(self, bodies: LandmarkedBodies) -> Any:
        return bodies.volumes()


@dataclass(frozen=True, kw_only=True)
class Mass(Measurement):
    """An estimate of the body mass: the volume times a density.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    density : float
        Kilograms a cubic metre.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> mass = rh.measurements.Mass(name="mass, estimated", density=1010.0)
    >>> own = rh.measurements.Measurements(bodies.model, [mass])
    >>> own.units
    ('kg',)
    """

    density: float = DENSITY
    units: ClassVar[str] = "kg"

    def __post_init__(self) -> None:
        super().__post_init__()
        real_number(self.density, "density", minimum=0.0, strict=True)

    def value(self, bodies: LandmarkedBodies) -> Any:
        return self.density * bodies.volumes()


@dataclass(frozen=True, kw_only=True)
class Area(Measurement):
    """The area of the surface, or of some parts of it.

    Parameters
    ----------
    name, standard, note : str
        Its name, where it is defined, and what is to be known about it.
    parts : sequence of str
        Parts of the body; all of it by default.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> arm = rh.measurements.Area(name="left arm", parts=["left arm"])
    >>> own = rh.measurements.Measurements(bodies.model, [arm])
    >>> own.units
    ('m²',)
    """

    parts: tuple[str, ...] = field(default=())
    units: ClassVar[str] = "m²"

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "parts", _names(self.parts, "parts"))

    @property
    def parts_named(self) -> tuple[str, ...]:
        return self.parts

    def value(self, bodies: LandmarkedBodies) -> Any:
        return bodies.areas(self.parts)


KINDS = {
    kind.__name__: kind for kind in (Girth, Length, Height, Breadth, Depth, Volume, Mass, Area)
}
"""Kinds of measurements by name."""


def measurement_from_dict(record: Mapping[str, Any]) -> Measurement:
    """Return the measurement that a record of JSON describes.

    Parameters
    ----------
    record : mapping
        Its kind, and the parameters of that.

    Returns
    -------
    Measurement

    Raises
    ------
    ArgumentError
        If the kind or a parameter is unknown, with the nearest one that is known, or one is missing
        or out of its range.
    ArgumentTypeError
        If it is no record.

    Examples
    --------
    >>> import riemhuman as rh
    >>> record = {"kind": "Height", "name": "stature", "at": "crown"}
    >>> rh.measurements.measurement_from_dict(record).at
    'crown'
    """
    if not isinstance(record, Mapping):
        raise ArgumentTypeError(f"a measurement must be a record; found {record!r}")
    known = dict(record)
    kind = KINDS[nearest_name(str(known.pop("kind", "")), "kind of measurement", KINDS)]
    for name in known:
        nearest_name(name, f"parameter of {kind.__name__}", [f.name for f in fields(kind)])
    try:
        return kind(**known)
    except TypeError as error:
        if isinstance(error, ArgumentTypeError):
            raise
        raise ArgumentError(f"a {kind.__name__} cannot be made of {record!r}: {error}") from error


def nearest_name(name: str, what: str, known: Sequence[str] | Mapping[str, Any]) -> str:
    """Return a name that is known.

    Parameters
    ----------
    name : str
        The name.
    what : str
        What it is a name of, for messages.
    known : sequence of str
        All there are.

    Returns
    -------
    str
        The name itself.

    Raises
    ------
    ArgumentError
        If it is not known; the message offers those that are spelt alike.
    """
    if name in known:
        return name
    near = get_close_matches(name, list(known), n=3, cutoff=0.5)
    offered = f"did you mean {' or '.join(map(repr, near))}?" if near else ""
    listed = offered or f"there are {', '.join(map(repr, known)) or 'none'}"
    raise ArgumentError(f"there is no {what} {name!r}; {listed}")


def _names(value: Any, name: str) -> tuple[str, ...]:
    if isinstance(value, str) or not all(isinstance(part, str) for part in value):
        raise ArgumentTypeError(f"{name} must be a list of names; found {value!r}")
    return tuple(value)


def _listed(value: Any) -> Any:
    """Return tuples as lists, as JSON gives them back."""
    if isinstance(value, (tuple, list)):
        return [_listed(entry) for entry in value]
    return dict(value) if isinstance(value, Mapping) else value
