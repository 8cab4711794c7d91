"""Girths, breadths and depths: measurements of plane sections."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import one_of
from riemhuman.errors import ArgumentError
from riemhuman.measurements.landmarks import LandmarkedBodies, Place
from riemhuman.measurements.measurement import Measurement, names_of_parts
from riemhuman.measurements.sections import EXTENT, HULL, LENGTH

AXES = ("up", "left", "forward")


@dataclass(frozen=True, kw_only=True)
class PlaneSection(Measurement):
    """A measurement of the section of the body by a plane.

    Parameters
    ----------
    name, standard, note : str
        Name, the standard that defines it, and a remark.
    at : str or mapping of str to float
        A place in the plane: a landmark, or landmarks with weights. The section nearest to it is
        measured.
    normal : str or pair of places
        Normal of the plane: "up", "left", "forward", or the direction from one place to another,
        such as along a bone.
    parts : sequence of str
        Parts of the body that are measured; by default the whole body.
    leave_out : sequence of str
        Parts that the loop passes over without being measured, such as arms that touch the chest.
    """

    at: Place
    normal: Any = "up"
    parts: tuple[str, ...] = ()
    leave_out: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "parts", names_of_parts(self.parts, "parts"))
        object.__setattr__(self, "leave_out", names_of_parts(self.leave_out, "leave_out"))
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

    def section(self, bodies: LandmarkedBodies) -> tuple[ndarray, int]:
        """Return the section of the first body, or why there is none.

        Parameters
        ----------
        bodies : LandmarkedBodies
            The bodies.

        Returns
        -------
        points : array, shape (k, 3)
            The section; empty if there is none.
        status : int
            0, or why there is none, see `riemhuman.measurements.sections`.
        """
        return bodies.section(self.parts, self.leave_out, self.at, self.normal)


@dataclass(frozen=True, kw_only=True)
class Girth(PlaneSection):
    """The length of the loop around a part of the body.

    Parameters
    ----------
    name, standard, note : str
        Name, the standard that defines it, and a remark.
    at : str or mapping of str to float
        A place in the plane: a landmark, or landmarks with weights. The loop nearest to it is
        measured.
    normal : str or pair of places
        Normal of the plane: "up", "left", "forward", or the direction from one place to another,
        such as along a bone.
    parts : sequence of str
        Parts of the body that are measured; by default the whole body.
    leave_out : sequence of str
        Parts that the loop passes over without being measured; they require ``hull=True``.
    hull : bool
        Whether to measure the convex hull of the loop, as a tape that spans hollows does.

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
            raise ArgumentError(f"{self.name!r} has leave_out; it needs hull=True")

    def value(self, bodies: LandmarkedBodies) -> Any:
        return self._size(bodies, HULL if self.hull else LENGTH, "up")

    def curves(self, bodies: LandmarkedBodies) -> list[Any]:
        return [bodies.tape(self.section(bodies)[0], self.hull)]


@dataclass(frozen=True, kw_only=True)
class Breadth(PlaneSection):
    """The extent of a section of the body from side to side.

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
        loop, axis = self.section(bodies)[0], bodies.axis(self._direction)[0]
        middle = loop.mean(axis=0)
        ends = ((loop - middle) @ axis).min(), ((loop - middle) @ axis).max()
        return [middle + np.array(ends)[:, None] * axis]


@dataclass(frozen=True, kw_only=True)
class Depth(Breadth):
    """The extent of a section of the body from back to front.

    Examples
    --------
    >>> import riemhuman as rh
    >>> chest = rh.measurements.Depth(name="chest depth", at="under_bust", parts=["trunk"])
    >>> chest.to_dict()["kind"]
    'Depth'
    """

    _direction: ClassVar[str] = "forward"
