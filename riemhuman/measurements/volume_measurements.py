"""Volumes, masses and areas."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

from riemhuman.checks import real_number
from riemhuman.measurements.landmarks import LandmarkedBodies
from riemhuman.measurements.measurement import Measurement, names_of_parts

DENSITY = 1000.0
"""Density of a body in kg/m³: that of water, from which the body's differs by a few per cent."""


@dataclass(frozen=True, kw_only=True)
class Volume(Measurement):
    """The volume that the surface encloses; the surface must be closed.

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
        Name, the standard that defines it, and a remark.
    density : float
        Kilograms per cubic metre.

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
    """The area of the surface or of parts of it.

    Parameters
    ----------
    name, standard, note : str
        Name, the standard that defines it, and a remark.
    parts : sequence of str
        Parts of the body; by default the whole body.

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
        object.__setattr__(self, "parts", names_of_parts(self.parts, "parts"))

    @property
    def parts_named(self) -> tuple[str, ...]:
        return self.parts

    def value(self, bodies: LandmarkedBodies) -> Any:
        return bodies.areas(self.parts)
