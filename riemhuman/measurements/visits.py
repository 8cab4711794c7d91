"""Comparison of two visits of one person, in the standard pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Booleans
from riemhuman.checks import check_instance, mask, real_array
from riemhuman.checks.labels import texts_of
from riemhuman.geometry import AlignedSurfaces
from riemhuman.kernels.surface import vertex_normals
from riemhuman.measurements.measurement_set import MeasurementSet, load_json
from riemhuman.measurements.measuring import Measurements, in_standard_pose
from riemhuman.surfaces.procrustes import procrustes

# A change is the difference of two visits, so that its standard deviation is √2 times the noise of
# one; it is significant above two of these. Chance alone exceeds them in 4.55 % of comparisons.
_SIGNIFICANT = 2.0 * np.sqrt(2.0)
_CHANCE = math.erfc(np.sqrt(2.0))


@dataclass(frozen=True, eq=False)
class VisitComparison:
    """Changes of a body between two visits of one person.

    Attributes
    ----------
    names, units : tuple of str
        Names and units of the measurements.
    before, after : array, shape (M,)
        Values in the standard pose.
    noise : array, shape (M,)
        Noise of each measurement over poses: among pairs of poses of simulated people, registered
        from scans, 4.55 per cent differ by more than 2√2 times this noise. NaN for measurements
        that the open body does not have. Real people vary more, because they breathe.
    points_before, points_after : array, shape (V, 3)
        Both visits in the standard pose, the second aligned with the first.
    area_changes, area_noise : array, shape (F,)
        Natural logarithm of each triangle's area at the second visit over that at the first, and
        its noise, by part of the body; NaN where unknown.
    displacements : array, shape (V,)
        Outward displacement of each vertex, metres.
    why_missing : dict of (int, str) to str
        Why a measurement of the first (0) or second (1) visit is NaN.

    Examples
    --------
    See `compare_visits`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    before: Array
    after: Array
    noise: Array
    points_before: Array
    points_after: Array
    area_changes: Array
    area_noise: Array
    displacements: Array
    why_missing: Mapping[tuple[int, str], str]

    @property
    def changes(self) -> Array:
        """Changes of the measurements, shape (M,)."""
        return self.after - self.before

    @property
    def thresholds(self) -> Array:
        """Smallest significant change of each measurement, shape (M,): 2√2 times the noise."""
        thresholds: Array = _SIGNIFICANT * self.noise
        return thresholds

    @property
    def is_significant(self) -> Booleans:
        """Which changes of measurements exceed their thresholds, shape (M,)."""
        return np.abs(self.changes) > self.thresholds

    @property
    def expected_by_chance(self) -> float:
        """Number of measurements expected beyond their thresholds if nothing changed."""
        return float(_CHANCE * np.isfinite(self.noise * self.changes).sum())

    @property
    def areas_significant(self) -> Booleans:
        """Which changes of area exceed two standard deviations of their noise, shape (F,)."""
        significant: Booleans = np.abs(self.area_changes) > _SIGNIFICANT * self.area_noise
        return significant


def compare_visits(
    measurements: Measurements,
    before: ArrayLike,
    after: ArrayLike,
    *,
    trusted_vertices: ArrayLike | None = None,
) -> VisitComparison:
    """Compare two visits of one person, in any poses.

    `in_standard_pose` brings both bodies to the standard pose, where they are measured.

    Parameters
    ----------
    measurements : Measurements
        The measurements; their template must be a body model.
    before, after : array_like, shape (V, 3)
        The person at both visits, metres.
    trusted_vertices : array_like of bool, shape (2, V), optional
        Which vertices of each body to trust, as for `Measurements.measure`; changes elsewhere are
        NaN.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measurements = rh.measurements.Measurements(bodies.model)
    >>> result = rh.measurements.compare_visits(measurements, bodies[0], bodies[3])
    >>> bool(abs(result.changes[0]) < 0.01)  # the same stature in both poses
    True
    """
    check_instance(measurements, "measurements", Measurements)
    definitions = measurements.definitions
    shape = (definitions.n_vertices, 3)
    before = real_array(before, "before", shape, batched=False)
    after = real_array(after, "after", shape, batched=False)
    if trusted_vertices is not None:
        shape = (2, definitions.n_vertices)
        trusted_vertices = mask(trusted_vertices, "trusted_vertices", (shape, shape[1:]))
    straight = in_standard_pose(definitions, np.stack([before, after]))
    measured = measurements.measure(
        straight, axes="space", missing="nan", trusted_vertices=trusted_vertices
    )
    known_in_both = np.ones(definitions.n_vertices, dtype=bool)
    if trusted_vertices is not None:
        known_in_both = np.all(np.broadcast_to(trusted_vertices, straight.shape[:2]), axis=0)
    first, second = straight[0], procrustes(straight[1], to=straight[0])
    assert definitions.model is not None
    space = AlignedSurfaces(definitions.model.template, equip=False, scale=None)
    areas = space.face_areas(straight)
    is_face_known = known_in_both[definitions.faces].all(axis=1)
    area_changes = np.where(is_face_known, np.log(areas[1] / areas[0]), np.nan)
    outward = np.sum((second - first) * vertex_normals(first, definitions.faces), axis=1)
    return VisitComparison(
        names=measured.names,
        units=measured.units,
        before=measured.values[0],
        after=measured.values[1],
        noise=noise_of_measurements(measured.names),
        points_before=first,
        points_after=second,
        area_changes=area_changes,
        area_noise=_noise_of_areas(definitions),
        displacements=np.where(known_in_both, outward, np.nan),
        why_missing=measured.why_missing,
    )


def _noise_of_areas(definitions: MeasurementSet) -> Array:
    """Return the noise of the logarithm of each triangle's area, NaN where it is unknown."""
    noise = np.full(len(definitions.faces), np.nan)
    for name, noise_of_part in load_json("noise_of_poses.json")["log_areas"].items():
        if name in definitions.parts:
            noise[definitions.parts[name]] = noise_of_part
    return noise


def noise_of_measurements(names: Sequence[str]) -> Array:
    """Return the noise of measurements over poses of one person, shape (M,), in their units.

    It is half of the change that 4.55 per cent of pairs of poses exceed, divided by √2, for
    simulated people registered from scans. Real people vary more, because they breathe.

    Parameters
    ----------
    names : sequence of str
        Measurements; those that the open body does not have get NaN.

    Examples
    --------
    >>> float(rh.measurements.noise_of_measurements(["stature"])[0].round(4))
    0.0051
    """
    names = texts_of(names, "names", "a list of names of measurements")
    # See tutorials/remake/build_noise_of_poses.py.
    noise = load_json("noise_of_poses.json")["measurements"]
    return np.array([noise.get(name, np.nan) for name in names])
