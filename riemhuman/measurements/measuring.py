"""Values of measurements of bodies, with names, units and derivatives."""

from __future__ import annotations

from collections.abc import ItemsView, Iterable, Iterator, KeysView, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Literal, overload

import numpy as np

from riemhuman.arrays import Array, ArrayLike
from riemhuman.bodies import BodyModel
from riemhuman.checks import (
    check_resolution,
    checked,
    choice,
    flag,
    mask,
    real_array,
    real_number,
    refuse_type,
)
from riemhuman.checks.memory import check_memory
from riemhuman.datasets import Bodies
from riemhuman.errors import ArgumentError, ArgumentTypeError, DegenerateSurfaceError, shown
from riemhuman.extensions import extensions
from riemhuman.kernels.threads import in_chunks
from riemhuman.measurements._vertex_slopes import VertexSlopes
from riemhuman.measurements.definitions import Measurement, nearest_name
from riemhuman.measurements.landmarked_bodies import LandmarkedBodies
from riemhuman.measurements.measurement_set import MeasurementSet, open_measurements
from riemhuman.measurements.standard_pose import in_standard_pose
from riemhuman.optional import import_optional
from riemhuman.surfaces.template import Template, check_body_sizes

if TYPE_CHECKING:
    import pandas

# Metres, kilograms and their kin; nothing of a body is larger.
_LARGEST = 1e6
_POSES = ("as is", "standard")
_FEWER = "measure fewer at a time"
_AXES = ("body", "space")
# Vertices of the bodies measured together, so that temporary arrays stay in the cache.
_VERTICES = 20_000
# Threads are faster from this many bodies on.
_THREADED = 64
# Largest share of a measurement, by its derivatives, that may depend on unseen vertices.
_MOST_UNSEEN = 0.05
# A girth that does not touch the fingers, and the landmark at their tips: closed
# fingers thicken the knuckles.
_FINGERS = {"hand girth": "right_dactylion"}


@dataclass(frozen=True, eq=False)
class BodySizes:
    """Measurements of bodies, a mapping of names to values.

    As in a data frame of pandas, `values` is the array; names are iterated, looked up and counted.

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
    why_missing : dict of (int, str) to str
        The reasons why values are NaN, by the index of the body and the name of the measurement.

    Examples
    --------
    See `Measurements`.
    """

    names: tuple[str, ...]
    values: Array
    units: tuple[str, ...]
    gradient: Array | None = None
    why_missing: Mapping[tuple[int, str], str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Array:
        """Return the values of one measurement, shape (...)."""
        return self.values[..., self.names.index(nearest_name(name, "measurement", self.names))]

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def keys(self) -> KeysView[str]:
        """Return the names of the measurements."""
        return self.to_dict().keys()

    def items(self) -> ItemsView[str, Array]:
        """Return the pairs of names and values, each of shape (...)."""
        return self.to_dict().items()

    def get(self, name: str, default: Array | None = None) -> Array | None:
        """Return the values of one measurement, shape (...), or the default without it.

        Parameters
        ----------
        name : str
        default : array, optional
        """
        return self.to_dict().get(name, default)

    def __repr__(self) -> str:
        n_bodies = int(np.prod(self.values.shape[:-1]))
        return f"<BodySizes: {len(self.names)} measurements of {n_bodies} bodies>"

    def to_dict(self) -> dict[str, Array]:
        """Return the values by name, each of shape (...)."""
        return {name: self.values[..., k] for k, name in enumerate(self.names)}

    def to_frame(self, names: Sequence[str] | None = None) -> pandas.DataFrame:
        """Return a pandas table with a row for each body and a column for each measurement.

        Parameters
        ----------
        names : sequence of str, optional
            Names of the bodies, such as `Bodies.ids`; by default their numbers.

        Raises
        ------
        MissingDependencyError
            If pandas is not installed.

        Examples
        --------
        >>> bodies = rh.datasets.load_open_bodies("coarse")[:2]
        >>> sizes = rh.measurements.Measurements(bodies.model).measure(bodies.points, missing="nan")
        >>> sizes.to_frame(bodies.ids)["volume"].round(3).tolist()
        [0.062, 0.062]
        """
        frames = import_optional("pandas", "tables")
        rows = self.values.reshape(-1, len(self.names))
        index = None if names is None else list(names)
        if index is not None and len(index) != len(rows):
            raise ArgumentError(
                f"names must hold one name for each of the {len(rows)} bodies; found {len(index)}"
            )
        return frames.DataFrame(rows, index=index, columns=list(self.names))


class Measurements:
    """Measurements of bodies that are registered to the same template.

    Parameters
    ----------
    model : BodyModel, Template, Bodies or MeasurementSet
        The body model or template of the bodies, or bodies that have one; or a set, which includes
        its template.
    definitions : path_like, or sequence of Measurement or str, optional
        The measurements: a JSON file of a set on this template, or new measurements and names of
        those of the set. By default the open body model's measurements and those that other
        packages add, see `riemhuman.extensions`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measured = rh.measurements.Measurements(bodies.model).measure(bodies.points[:3])
    >>> measured["stature"].round(2)
    array([1.72, 1.71, 1.7 ])
    """

    def __init__(
        self,
        model: BodyModel | Template | Bodies | MeasurementSet,
        definitions: Iterable[Measurement | str] | str | Path | None = None,
    ) -> None:
        if isinstance(model, Bodies):
            model = model.template if model.model is None else model.model
        self.definitions = _measurement_set(model, definitions)
        if not self.names:
            raise ArgumentError("definitions must hold at least one measurement; found none")

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

    @checked(
        pose=choice(*_POSES), axes=choice(*_AXES), gradient=flag, missing=choice("raise", "nan")
    )
    def measure(
        self,
        points: ArrayLike,
        *,
        pose: str = "as is",
        axes: str = "body",
        gradient: bool = False,
        missing: str = "raise",
        trusted_vertices: ArrayLike | None = None,
    ) -> BodySizes:
        """Measure bodies.

        Parameters
        ----------
        points : array_like, shape (..., V, 3)
            Bodies, metres. Bodies smaller or larger than any human raise an error.
        pose : {"as is", "standard"}
            Whether bodies are measured in their own pose, or after `in_standard_pose`, which needs
            a body model.
        axes : {"body", "space"}
            Whether the axes move with the trunk of each body, or are those of the template in
            space. Bodies in the standard pose are measured along the axes of the template.
        gradient : bool
            Whether to return derivatives with respect to the vertices; only for bodies in their own
            pose.
        missing : {"raise", "nan"}
            Whether a measurement that is not defined raises an error or gives NaN, with the reason
            in `why_missing`.
        trusted_vertices : array_like of bool, shape (..., V), optional
            Which vertices to trust, such as `rh.registration.RegisteredScan.trusted_vertices`. A
            measurement is not defined if more than a twentieth of it depends on other vertices, nor
            is the hand girth without the fingers, which may be closed.
        """
        dtype = getattr(points, "dtype", None)
        points = real_array(points, "points", (self.definitions.n_vertices, 3))
        check_resolution(points, "points", dtype)
        lead = points.shape[:-2]
        surfaces = points.reshape(-1, *points.shape[-2:])
        check_body_sizes(points, self.definitions.surface, "points")
        for number, surface in enumerate(surfaces):
            self._check_surface(surface, f"points[{number}]")
        if pose == "standard":
            if gradient:
                raise ArgumentError('gradient requires pose="as is"; found pose="standard"')
            surfaces = in_standard_pose(self.definitions, surfaces)
            axes = "space"
        if not self.definitions.frame:
            axes = "space"
        values = np.empty((len(surfaces), len(self.names)))
        if gradient:
            what = f"the derivatives of {len(self.names)} measurements of {len(surfaces):,} bodies"
            check_memory(8 * values.size * surfaces[:1].size, what, _FEWER)
        slopes = np.empty((*values.shape, *points.shape[-2:])) if gradient else None
        size = max(1, _VERTICES // points.shape[-2])

        def task(first: int, last: int) -> None:
            for k in range(first, last, size):
                part = slice(k, min(k + size, last))
                values[part], derivatives = values_of_bodies(
                    self.definitions, surfaces[part], axes, gradient
                )
                if slopes is not None:
                    slopes[part] = derivatives

        in_chunks(task, len(surfaces), threaded=len(surfaces) >= _THREADED)
        why_missing = self._why_missing(surfaces, values, axes)
        if trusted_vertices is not None:
            trusted = _checked_trust(trusted_vertices, points.shape[:-1])
            why_missing |= self._not_trusted(surfaces, trusted.reshape(len(surfaces), -1), axes)
            for number, name in why_missing:
                values[number, self.names.index(name)] = np.nan
        if missing == "raise" and why_missing:
            (number, name), reason = next(iter(why_missing.items()))
            raise ArgumentError(f"{name!r} cannot be taken of body {number}: {reason}")
        shape = (*lead, len(self.names))
        if slopes is not None:
            slopes = slopes.reshape(*shape, *points.shape[-2:])
        return BodySizes(self.names, values.reshape(shape), self.units, slopes, why_missing)

    @checked(axes=choice(*_AXES))
    def lines(self, surface: ArrayLike, *, axes: str = "body") -> dict[str, list[Array]]:
        """Return the measurement lines of one body as it stands.

        Parameters
        ----------
        surface : array_like, shape (V, 3)
            The body, metres.
        axes : {"body", "space"}
            Axes, as for `measure`.

        Returns
        -------
        dict of str to list of array, shape (k, 3)
            Empty lists for volumes, areas and measurements that are not defined.
        """
        shape = (self.definitions.n_vertices, 3)
        surface = real_array(surface, "surface", shape, batched=False)
        axes = axes if self.definitions.frame else "space"
        check_body_sizes(surface, self.definitions.surface, "surface")
        bodies = LandmarkedBodies(self.definitions, surface[np.newaxis], axes)
        lines = {}
        for measurement in self.definitions.measurements:
            is_defined = not np.isnan(measurement.value(bodies)[0])
            polylines = measurement.lines(bodies) if is_defined else []
            lines[measurement.name] = [np.asarray(line) for line in polylines]
        return lines

    def _check_surface(self, surface: Array, name: str) -> None:
        """Raise an error if a body is inside out."""
        if self.definitions.is_closed:
            template_volume = self.definitions.volume
            volume = LandmarkedBodies(self.definitions, surface[np.newaxis], "space").volumes[0]
            if not volume * template_volume > 0.0:
                raise DegenerateSurfaceError(
                    f"{name} encloses {volume:.3g} m³ and the template {template_volume:.3g} m³: "
                    "the body is inside out, as after a reflection, or has no extent"
                )

    def _not_trusted(
        self, surfaces: Array, trusted: Array, axes: str
    ) -> dict[tuple[int, str], str]:
        """Return reasons for measurements that depend too much on other vertices."""
        reasons = {}
        for number in np.flatnonzero(~trusted.all(axis=1)).tolist():
            _, slopes = values_of_bodies(self.definitions, surfaces[[number]], axes, gradient=True)
            weights = np.linalg.norm(slopes, axis=-1)[0]
            shares = weights[:, ~trusted[number]].sum(axis=1) / weights.sum(axis=1)
            for which in np.flatnonzero(shares > _MOST_UNSEEN):
                place = "path" if self.units[which] == "m" else "surface"
                reasons[number, self.names[which]] = (
                    f"{100 * shares[which]:.0f} % of its {place} lies on untrusted parts"
                )
            for name, landmark in _FINGERS.items():
                if name in self.names and landmark in self.definitions.landmarks:
                    vertices, _ = self.definitions.landmarks[landmark]
                    if not trusted[number, vertices].all():
                        reasons.setdefault((number, name), "untrusted fingers may be bent")
        return reasons

    def _why_missing(self, surfaces: Array, values: Array, axes: str) -> dict[tuple[int, str], str]:
        reasons = {}
        for number, which in np.argwhere(np.isnan(values)).tolist():
            measurement = self.definitions.measurements[which]
            bodies = LandmarkedBodies(self.definitions, surfaces[[number]], axes)
            reasons[number, measurement.name] = measurement.why_missing(bodies)
        return reasons


def _measurement_set(
    model: BodyModel | Template | MeasurementSet,
    definitions: Iterable[Measurement | str] | str | Path | None,
) -> MeasurementSet:
    """Return the set for the arguments of `Measurements`."""
    if isinstance(model, MeasurementSet):
        if isinstance(definitions, (str, Path)):
            expected = "measurements or names where model is a MeasurementSet"
            refuse_type(definitions, "definitions", expected)
        return model if definitions is None else model.with_measurements(definitions)
    if not isinstance(model, (BodyModel, Template)):
        refuse_type(model, "model", "a BodyModel, a Template, Bodies or a MeasurementSet")
    if isinstance(definitions, MeasurementSet):
        raise ArgumentTypeError("definitions must not be a MeasurementSet: pass that as model")
    if isinstance(definitions, (str, Path)):
        return MeasurementSet.load(definitions, model)
    open_set = open_measurements(model)
    if definitions is not None:
        measurement_set = open_set or MeasurementSet(model, ())
        return measurement_set.with_measurements(definitions)
    if open_set is None:
        raise ArgumentError(
            f"there are no measurements for {model!r}; pass definitions, or map those of "
            "the open body model to it with MeasurementSet.mapped"
        )
    added = [define() for define in extensions("measurements").values()]
    return open_set.with_measurements([*open_set.measurements, *added]) if added else open_set


@overload
def values_of_bodies(
    definitions: MeasurementSet, surfaces: Array, axes: str, gradient: Literal[True]
) -> tuple[Array, Array]: ...
@overload
def values_of_bodies(
    definitions: MeasurementSet, surfaces: Array, axes: str, gradient: bool
) -> tuple[Array, Array | None]: ...
def values_of_bodies(
    definitions: MeasurementSet, surfaces: Array, axes: str, gradient: bool
) -> tuple[Array, Array | None]:
    """Return values, shape (n, M), NaN if not defined, and their derivatives; nothing is checked.

    Parameters
    ----------
    definitions : MeasurementSet
    surfaces : array, shape (n, V, 3)
    axes : {"body", "space"}
    gradient : bool
        Whether to return derivatives, shape (n, M, V, 3); else None.
    """
    if not gradient:
        bodies = LandmarkedBodies(definitions, surfaces, axes)
        values = [measurement.value(bodies) for measurement in definitions.measurements]
        return np.stack(values, axis=-1), None
    measured, slopes = values_and_slopes(definitions, surfaces, axes)
    derivatives = np.stack([slope.by_vertex() for slope in slopes], axis=1)
    derivatives[np.isnan(measured)] = np.nan
    return measured, derivatives


def values_and_slopes(
    definitions: MeasurementSet, surfaces: Array, axes: str
) -> tuple[Array, list[VertexSlopes]]:
    """Return values, shape (n, M), NaN if not defined, and derivatives; nothing is checked."""
    bodies = LandmarkedBodies(definitions, surfaces, axes)
    pairs = [measurement.value_and_slopes(bodies) for measurement in definitions.measurements]
    return np.stack([value for value, _ in pairs], axis=-1), [slopes for _, slopes in pairs]


def _checked_trust(trusted_vertices: ArrayLike, shape: tuple[int, ...]) -> Array:
    trusted = mask(trusted_vertices, "trusted_vertices", (shape, shape[-1:]))
    return np.broadcast_to(trusted, shape)


def as_mapping(values: object, names: Sequence[str], *, may_miss: bool = False) -> dict[str, float]:
    """Return values of measurements by name; raise an error if there are none or unknown ones.

    Values that are NaN are refused too, unless some `may_miss`.
    """
    if hasattr(values, "to_dict"):  # a series of pandas, or measured bodies
        values = values.to_dict()
    if not isinstance(values, Mapping) or not values:
        raise ArgumentError(
            f"values must map names of measurements to numbers; found {shown(values)}"
        )
    named = {nearest_name(str(name), "measurement", names): v for name, v in values.items()}
    return {
        name: np.nan if may_miss and _is_nan(value) else real_number(value, name, maximum=_LARGEST)
        for name, value in named.items()
    }


def _is_nan(value: object) -> bool:
    return isinstance(value, float | np.floating) and bool(np.isnan(value))
