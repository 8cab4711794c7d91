"""Heights and lengths between places of the body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import autograd.numpy as np

from riemhuman.checks import one_of
from riemhuman.errors import ArgumentError
from riemhuman.measurements.landmarks import LandmarkedBodies, Place
from riemhuman.measurements.measurement import Measurement

PATHS = ("straight", "surface", "joints")


@dataclass(frozen=True, kw_only=True)
class Height(Measurement):
    """The height of a place above the floor, along the axis "up".

    Parameters
    ----------
    name, standard, note : str
        Name, the standard that defines it, and a remark.
    at : str or mapping of str to float
        The place: a landmark, or landmarks with weights.
    above : str or mapping of str to float, optional
        Place from which the height is measured; by default the floor, at the lowest vertex.

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
    """The length of a path through places of the body.

    Parameters
    ----------
    name, standard, note : str
        Name, the standard that defines it, and a remark.
    along : sequence of places
        Two or more places in order; for the path "joints", the first and the last joint.
    path : {"straight", "surface", "joints"}
        Straight lines between the places, geodesics on the surface between them, or straight lines
        from joint to joint of the body model.

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
            raise ArgumentError(f"along must hold two or more places; found {self.along!r}")
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
