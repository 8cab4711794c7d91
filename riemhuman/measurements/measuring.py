"""Values of measurements of bodies, with names, units and derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from autograd import make_vjp
from numpy import ndarray

from riemhuman.bodies import BodyModel
from riemhuman.checks import one_of, real_array
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.extensions import extensions
from riemhuman.kernels.threads import in_chunks
from riemhuman.measurements.definitions import nearest_name
from riemhuman.measurements.landmarks import LandmarkedBodies
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.measurements.open_body import open_measurements
from riemhuman.measurements.section_measurements import PlaneSection
from riemhuman.measurements.sections import MEETS_OTHER_PART, MISSES
from riemhuman.measurements.standard_pose import in_standard_pose
from riemhuman.measurements.volume_measurements import Mass, Volume
from riemhuman.optional import import_optional
from riemhuman.surfaces.template import Template
from riemhuman.units import likely_units

POSES = ("as is", "standard")
AXES = ("body", "space")
# Vertices of the bodies that are measured together: their temporary arrays stay in the cache.
_VERTICES = 20_000
# Number of bodies from which on threads share the work.
_THREADED = 64
# Number of vertices that the size of a body is estimated from.
_N_SAMPLES = 256
_REASONS = {
    MISSES: "its plane misses {parts}",
    MEETS_OTHER_PART: "its loop leaves {parts} and meets another part of the body; list that part "
    "in leave_out, or measure at another place or in another pose",
}
_OPEN = "its loop around {parts} meets a boundary or a defect of the mesh"


@dataclass(frozen=True, eq=False)
class MeasuredBodies:
    """Measurements of bodies.

    Attributes
    ----------
    names : tuple of str
        Names of the measurements.
    values : array, shape (..., M)
        Values in the units of `units`; NaN where a measurement is not defined.
    units : tuple of str
        Unit of each measurement: "m", "m²", "m³" or "kg".
    gradient : array, shape (..., M, V, 3), optional
        Derivatives of the values by the vertices, if they were requested.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measured = rh.measurements.Measurements(bodies.model).measure(bodies[0])
    >>> round(float(measured["stature"]), 2)
    1.85
    """

    names: tuple[str, ...]
    values: ndarray
    units: tuple[str, ...]
    gradient: ndarray | None = None

    def __getitem__(self, name: str) -> ndarray:
        """Return the values of one measurement, shape (...)."""
        return self.values[..., self.names.index(nearest_name(name, "measurement", self.names))]

    def __repr__(self) -> str:
        n_bodies = int(np.prod(self.values.shape[:-1]))
        return f"<MeasuredBodies: {len(self.names)} measurements of {n_bodies} bodies>"

    def to_dict(self) -> dict[str, ndarray]:
        """Return the values by name, each of shape (...).

        Returns
        -------
        dict of str to array
        """
        return {name: self.values[..., k] for k, name in enumerate(self.names)}

    def to_frame(self, index: Sequence[Any] | None = None) -> Any:
        """Return a pandas table with one row per body and one column per measurement.

        Parameters
        ----------
        index : sequence, optional
            Names of the bodies; by default their numbers.

        Returns
        -------
        pandas.DataFrame

        Raises
        ------
        MissingDependencyError
            If pandas is not installed.
        """
        pandas = import_optional("pandas", "tables")
        columns = [f"{n} ({u})" for n, u in zip(self.names, self.units, strict=True)]
        return pandas.DataFrame(
            self.values.reshape(-1, len(self.names)), columns=columns, index=index
        )


class Measurements:
    """Measurements of bodies that are registered to one template.

    Parameters
    ----------
    model : BodyModel, Template or MeasurementSet
        The body model or template of the bodies; or a set, which includes its template.
    definitions : MeasurementSet, path_like, or sequence of Measurement or str, optional
        The measurements: a set on this template, a JSON file of a set, or a sequence of new
        measurements and of names of the open body model's. By default the open body model's
        measurements and those that other packages add, see `riemhuman.extensions`.

    Raises
    ------
    ArgumentError
        If there are no measurements for this template, or a name is unknown.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measured = rh.measurements.Measurements(bodies.model).measure(bodies.points[:3])
    >>> measured["stature"].round(2)
    array([1.85, 1.84, 1.83])
    """

    def __init__(
        self,
        model: BodyModel | Template | MeasurementSet,
        definitions: Any = None,
    ) -> None:
        own: MeasurementSet | None
        if isinstance(model, MeasurementSet):
            own = model
        elif isinstance(definitions, MeasurementSet):
            own, definitions = definitions, None
            _check_fits(own, model)
        elif isinstance(definitions, (str, Path)):
            own, definitions = MeasurementSet.load(definitions, model), None
        else:
            own = open_measurements(model)
            if own is None and definitions is not None:
                own = MeasurementSet(model, ())
            elif own is not None and definitions is None:
                others = [define() for define in extensions("measurements").values()]
                definitions = [*own.measurements, *others]
        if own is None:
            raise ArgumentError(
                f"there are no measurements for {model!r}; give definitions, or map those of the "
                "open body model to it, see MeasurementSet.mapped"
            )
        self.definitions = own if definitions is None else own.with_measurements(definitions)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the measurements."""
        return self.definitions.names

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each measurement."""
        return tuple(measurement.units for measurement in self.definitions.measurements)

    def __repr__(self) -> str:
        return f"<Measurements: {', '.join(self.names)}>"

    def measure(
        self,
        points: Any,
        *,
        pose: str = "as is",
        axes: str = "body",
        gradient: bool = False,
        missing: str = "raise",
    ) -> MeasuredBodies:
        """Measure bodies.

        Parameters
        ----------
        points : array_like, shape (..., V, 3)
            Bodies, metres.
        pose : {"as is", "standard"}
            Whether bodies are measured as they stand, or after `in_standard_pose`, which needs a
            body model.
        axes : {"body", "space"}
            Whether the axes move with the trunk of each body, or are those of the template in
            space. Bodies in the standard pose are measured along the axes of the template.
        gradient : bool
            Whether to return derivatives by the vertices; only for bodies as they stand.
        missing : {"raise", "nan"}
            Whether a measurement that is not defined raises an error or gives NaN.

        Returns
        -------
        MeasuredBodies

        Raises
        ------
        ArgumentError
            If the shape is wrong, the bodies are in other units than metres, or a measurement is
            not defined; the message says why.
        DegenerateSurfaceError
            If a volume or mass is requested and the template has boundaries.
        """
        one_of(pose, "pose", POSES)
        one_of(missing, "missing", ("raise", "nan"))
        one_of(axes, "axes", AXES)
        points = real_array(points, "points", (self.definitions.n_vertices, 3))
        lead = points.shape[:-2]
        surfaces = points.reshape(-1, *points.shape[-2:])
        _refuse_other_units(surfaces)
        self._check_closed()
        if pose == "standard":
            if gradient:
                raise ArgumentError('gradient requires pose="as is"; found pose="standard"')
            surfaces, axes = in_standard_pose(self.definitions, surfaces), "space"
        if not self.definitions.frame:
            axes = "space"
        shape = (*lead, len(self.names))
        values = np.empty((len(surfaces), len(self.names)))
        slopes = np.empty((*values.shape, *points.shape[-2:])) if gradient else None
        size = max(1, _VERTICES // points.shape[-2])

        def task(first: int, last: int) -> None:
            for k in range(first, last, size):
                part = slice(k, min(k + size, last))
                values[part], own = self._measure(surfaces[part], axes, gradient)
                if slopes is not None:
                    slopes[part] = own

        in_chunks(task, len(surfaces), threaded=len(surfaces) >= _THREADED)
        if missing == "raise" and np.isnan(values).any():
            self._refuse_missing(surfaces, values, axes)
        if slopes is not None:
            slopes = slopes.reshape(*shape, *points.shape[-2:])
        return MeasuredBodies(self.names, values.reshape(shape), self.units, slopes)

    def tapes(self, surface: Any, *, axes: str = "body") -> dict[str, list[ndarray]]:
        """Return the tapes of all measurements on one body as it stands.

        Parameters
        ----------
        surface : array_like, shape (V, 3)
            The body, metres.
        axes : {"body", "space"}
            Axes, as for `measure`.

        Returns
        -------
        dict of str to list of array, shape (k, 3)
            Curves by name; empty for volumes, areas and measurements that are not defined.
        """
        shape = (self.definitions.n_vertices, 3)
        surface = real_array(surface, "surface", shape, batched=False)
        axes = one_of(axes, "axes", AXES) if self.definitions.frame else "space"
        bodies = LandmarkedBodies(self.definitions, surface[np.newaxis], axes)
        found = {}
        for measurement in self.definitions.measurements:
            taken = not np.isnan(measurement.value(bodies)[0])
            found[measurement.name] = [
                np.asarray(curve) for curve in (measurement.curves(bodies) if taken else [])
            ]
        return found

    def _measure(
        self, surfaces: ndarray, axes: str, gradient: bool
    ) -> tuple[ndarray, ndarray | None]:
        measurements = self.definitions.measurements
        if not gradient:
            bodies = LandmarkedBodies(self.definitions, surfaces, axes)
            values = [measurement.value(bodies) for measurement in measurements]
            return np.stack(values, axis=-1), None
        values, slopes = [], []
        for measurement in measurements:
            pull_back, value = make_vjp(
                lambda moved, taken=measurement: taken.value(
                    LandmarkedBodies(self.definitions, moved, axes)
                )
            )(surfaces)
            values.append(value)
            slopes.append(pull_back(np.ones(len(surfaces))))
        return np.stack(values, axis=-1), np.stack(slopes, axis=1)

    def _check_closed(self) -> None:
        for measurement in self.definitions.measurements:
            if isinstance(measurement, (Volume, Mass)) and not self.definitions.is_closed:
                raise DegenerateSurfaceError(
                    f"{measurement.name!r} needs a closed surface; the template has boundaries"
                )

    def _refuse_missing(self, surfaces: ndarray, values: ndarray, axes: str) -> None:
        number, which = (int(i) for i in np.argwhere(np.isnan(values))[0])
        measurement = self.definitions.measurements[which]
        where = f"{measurement.name!r} cannot be taken of body {number}: "
        if not isinstance(measurement, PlaneSection):
            raise ArgumentError(f"{where}there is no path along the surface")
        bodies = LandmarkedBodies(self.definitions, surfaces[[number]], axes)
        _, status = measurement.section(bodies)
        parts = " and ".join(measurement.parts) or "the surface"
        raise ArgumentError(where + _REASONS.get(status, _OPEN).format(parts=parts))


def as_mapping(values: Any, names: Sequence[str]) -> dict[str, float]:
    """Return values of measurements by name, after checking the names.

    Parameters
    ----------
    values : mapping of str to float
        Values by name.
    names : sequence of str
        Known names.

    Returns
    -------
    dict of str to float

    Raises
    ------
    ArgumentError
        If there are no values, or a name is unknown; the message offers the nearest names.
    """
    if not isinstance(values, Mapping) or not values:
        raise ArgumentError(f"values must map names of measurements to numbers; found {values!r}")
    return {nearest_name(name, "measurement", names): float(v) for name, v in values.items()}


def _check_fits(own: MeasurementSet, model: BodyModel | Template) -> None:
    surface = model.template if isinstance(model, BodyModel) else model
    if not np.array_equal(surface.faces, own.faces):
        raise ArgumentError(f"definitions are for {own!r}; the model is {model!r}")


def _refuse_other_units(surfaces: ndarray) -> None:
    """Refuse bodies in other units, such as millimetres; accept sizes of a body in no unit."""
    if not surfaces.size:
        return
    some = surfaces[:, :: max(1, surfaces.shape[1] // _N_SAMPLES)]
    extents = np.ptp(some, axis=1).max(axis=1)
    for number, extent in enumerate(extents):
        units = likely_units(float(extent))
        if units and "metres" not in units:
            raise ArgumentError(
                f"points[{number}] is {extent:.4g} long, as a body in {' or '.join(units)} is; "
                "measurements need bodies in metres"
            )
