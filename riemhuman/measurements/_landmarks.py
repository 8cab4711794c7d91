"""What measurements refer to: the landmarks, axes and parts of a template."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from riemhuman.arrays import Array, Booleans, Integers, Triangles
from riemhuman.bodies import BodyModel
from riemhuman.measurements._geodesics import Mesh

Place = str | Mapping[str, float]
"""A landmark, or an affine combination of landmarks such as ``{"hip": 0.5, "knee": 0.5}``."""

AXES = ("left", "up", "forward")


class LandmarkedTemplate(Protocol):
    """A template with landmarks, axes and parts: a `riemhuman.measurements.MeasurementSet`."""

    @property
    def landmarks(self) -> Mapping[str, tuple[Integers, Array]]: ...

    @property
    def frame(self) -> Sequence[str]: ...

    @property
    def axes(self) -> Array: ...

    @property
    def model(self) -> BodyModel | None: ...

    @property
    def vertices(self) -> Array: ...

    @property
    def faces(self) -> Triangles: ...

    @property
    def mesh(self) -> Mesh: ...

    @property
    def is_closed(self) -> bool: ...

    @property
    def axes_in_frame(self) -> Array: ...

    def in_parts(self, parts: tuple[str, ...]) -> Booleans: ...
