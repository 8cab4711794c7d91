"""Comparison of two visits of one person, with the pose removed."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.measurements.measuring import Measurements
from riemhuman.measurements.open_body import FOLDER
from riemhuman.measurements.standard_pose import in_standard_pose
from riemhuman.surfaces.procrustes import procrustes
from riemhuman.surfaces.rendering import vertex_normals

# A difference of two visits has the variance of both; it is seen above twice its deviation.
_SEEN = 2.0 * np.sqrt(2.0)


@dataclass(frozen=True, eq=False)
class VisitComparison:
    """Changes of a body between two visits of one person.

    Attributes
    ----------
    names, units : tuple of str
        Measurements.
    before, after : array, shape (M,)
        Their values in the standard pose.
    noise : array, shape (M,)
        Standard deviation of one value between poses of one person, on open bodies that nothing was
        tuned on; NaN for measurements that are not the open body's.
    points_before, points_after : array, shape (V, 3)
        Both visits in the standard pose, the second moved onto the first.
    area_changes : array, shape (F,)
        Natural logarithm of the ratio of the areas of every triangle.
    area_noise : array, shape (F,)
        Standard deviation of a logarithm of areas between poses, that of the triangle's part of the
        body; NaN where it is not known.
    displacements : array, shape (V,)
        How far each vertex moved outward, metres.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> own = rh.measurements.Measurements(bodies.model, ["stature", "waist girth"])
    >>> rh.measurements.compare_visits(own, bodies[0], bodies[3]).changes.shape
    (2,)
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    before: ndarray
    after: ndarray
    noise: ndarray
    points_before: ndarray
    points_after: ndarray
    area_changes: ndarray
    area_noise: ndarray
    displacements: ndarray

    @property
    def changes(self) -> ndarray:
        """Changes of the measurements, shape (M,)."""
        return self.after - self.before

    @property
    def seen(self) -> ndarray:
        """Which changes exceed the noise, two standard deviations of a difference; shape (M,)."""
        return np.abs(self.changes) > _SEEN * self.noise

    @property
    def areas_seen(self) -> ndarray:
        """Which triangles changed their area by more than the noise, shape (F,)."""
        return np.abs(self.area_changes) > _SEEN * self.area_noise


def compare_visits(measurements: Measurements, before: Any, after: Any) -> VisitComparison:
    """Compare two visits of one person, in whatever poses.

    Both are brought to the standard pose, see `in_standard_pose`, and measured there.

    Parameters
    ----------
    measurements : Measurements
        What is measured; of a body model.
    before, after : array_like, shape (V, 3)
        The person at both visits, metres.

    Returns
    -------
    VisitComparison

    Raises
    ------
    ArgumentError
        If a body does not fit, or the measurements are not of a body model.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> own = rh.measurements.Measurements(bodies.model)
    >>> result = rh.measurements.compare_visits(own, bodies[0], bodies[3])
    >>> bool(abs(result.changes[0]) < 0.01)  # the same stature in both poses
    True
    """
    description = measurements.definitions
    shape = (description.n_vertices, 3)
    visits = np.stack(
        [
            real_array(visit, name, shape, batched=False)
            for visit, name in ((before, "before"), (after, "after"))
        ]
    )
    straight = in_standard_pose(description, visits)
    measured = measurements.measure(straight, axes="space", missing="nan")
    one, other = straight[0], procrustes(straight[1], to=straight[0])
    assert description.model is not None
    space = AlignedSurfaces(description.model.template, equip=False, scale=None)
    areas = space.face_areas(straight)
    known, by_part = noise_of_poses()
    return VisitComparison(
        names=measured.names,
        units=measured.units,
        before=measured.values[0],
        after=measured.values[1],
        noise=np.array([known.get(name, np.nan) for name in measured.names]),
        points_before=one,
        points_after=other,
        area_changes=np.log(areas[1] / areas[0]),
        area_noise=_noise_of_areas(description, by_part),
        displacements=np.sum((other - one) * vertex_normals(one, description.faces), axis=1),
    )


@lru_cache(maxsize=1)
def noise_of_poses() -> tuple[dict[str, float], dict[str, float]]:
    """Return standard deviations between poses of one person, after the pose is removed.

    They are medians over the ten people of `load_open_bodies("coarse", "natural", people=1)`.

    Returns
    -------
    measurements : dict of str to float
        By name, in the unit of the measurement.
    parts : dict of str to float
        Of the logarithm of a triangle's area, by part of the body.

    Examples
    --------
    >>> import riemhuman as rh
    >>> girths, areas = rh.measurements.noise_of_poses()
    >>> girths["waist girth"] < 0.005
    True
    """
    record = json.loads((FOLDER / "noise_of_poses.json").read_text(encoding="utf-8"))
    return record["measurements"], record["log_areas"]


def _noise_of_areas(description: MeasurementSet, by_part: dict[str, float]) -> ndarray:
    noise = np.full(len(description.faces), np.nan)
    for name, value in by_part.items():
        if name in description.parts:
            noise[description.parts[name]] = value
    return noise
