"""Comparison of two visits of one person, in the standard pose."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Booleans
from riemhuman.checks import checked, instance, mask, real_array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import vertex_normals
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.measurements.measuring import Measurements
from riemhuman.measurements.standard_pose import person_in_standard_pose
from riemhuman.measurements.uncertainty import noise_of_measurements, pose_distance_of_visits
from riemhuman.readable_units import readable_unit
from riemhuman.surfaces.procrustes import procrustes

# Two scans in the same pose are about 0.1 apart if simulated people hold it exactly; above this
# distance, the pose hides more than the scan.
_SAME_POSE = 0.3
# Measurements that tell readers what a difference of pose hides, the first of those measured.
_EXAMPLES = ("chest girth", "waist girth", "hip girth", "stature")
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
        Standard deviation of each measurement of an unchanged person, whose poses are this far
        apart: `noise_of_measurements`. NaN for measurements that the open body does not have.
    pose_distance : float
        How far apart the poses of the visits are: `rh.measurements.pose_distance`. With several
        scans of a visit it is smaller, because the effects of different poses cancel in part.
    n_scans : float
        Number of scans of each visit; their harmonic mean if it differs.
    points_before, points_after : array, shape (V, 3)
        Both visits in the standard pose, the second aligned with the first.
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
    pose_distance: float
    n_scans: float
    points_before: Array
    points_after: Array
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
        """Number of measurements expected beyond their thresholds if nothing changed.

        It is 4.55 per cent of them; of five real people in ten poses each, 5.1 per cent were.
        """
        return float(_CHANCE * np.isfinite(self.noise * self.changes).sum())

    def pose_advice(self, system: str = "cm") -> str:
        """Return what the poses hide and what to do about it; empty if they are nearly the same.

        Parameters
        ----------
        system : {"cm", "in"}
            Units of the text, as for `readable_unit`.
        """
        known = dict(zip(self.names, self.thresholds.tolist(), strict=True))
        name = next((name for name in _EXAMPLES if np.isfinite(known.get(name, np.nan))), None)
        if self.pose_distance <= _SAME_POSE or name is None:
            return ""
        unit = replace(readable_unit("m", system), digits=1)
        again = "scan in the same pose" if self.n_scans == 1.0 else "scans in the same poses"
        in_same_pose = float(_SIGNIFICANT * noise_of_measurements([name], 0.0, self.n_scans)[0])
        return (
            f"The poses differ by {self.pose_distance:.1f}, so that the {name} must change by "
            f"{unit.text(known[name])} {unit.name} to be noticed; in the same pose, "
            f"{unit.text(in_same_pose)} {unit.name} would do. Repeat the {again}."
        )


@checked(measurements=instance(Measurements))
def compare_visits(
    measurements: Measurements,
    before: ArrayLike,
    after: ArrayLike,
    *,
    trusted_vertices: ArrayLike | None = None,
) -> VisitComparison:
    """Compare two visits of one person, in any poses.

    `in_standard_pose` brings all bodies to the standard pose, where they are measured. Different
    poses still leave differences, so a change must be larger to be noticed: see
    `VisitComparison.pose_advice`. If there are several scans of a visit, their mean counts, see
    `person_in_standard_pose`, and smaller changes are noticed.

    Parameters
    ----------
    measurements : Measurements
        The measurements; their template must be a body model.
    before, after : array_like, shape (V, 3) or (n_scans, V, 3)
        The person at both visits, metres.
    trusted_vertices : array_like of bool, shape (2, V), optional
        Which vertices of each body to trust, as for `Measurements.measure`; changes elsewhere are
        NaN. For several scans, a pair of arrays of shape (n_scans, V): what any scan of a visit
        shows is trusted.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> measurements = rh.measurements.Measurements(bodies.model)
    >>> result = rh.measurements.compare_visits(measurements, bodies[0], bodies[3])
    >>> bool(abs(result.changes[0]) < 0.01)  # the same stature in both poses
    True
    """
    definitions = measurements.definitions
    visits = [_scans(definitions, before, "before"), _scans(definitions, after, "after")]
    trusted = _trusted_of_visits(definitions, visits, trusted_vertices)
    straight = np.stack(
        [
            person_in_standard_pose(definitions, scans, trusted_vertices=seen)
            for scans, seen in zip(visits, trusted, strict=True)
        ]
    )
    known = np.stack([seen.any(axis=0) for seen in trusted])
    measured = measurements.measure(
        straight, axes="space", missing="nan", trusted_vertices=None if known.all() else known
    )
    known_in_both: Booleans = np.all(known, axis=0)
    first, second = straight[0], procrustes(straight[1], to=straight[0])
    outward = np.sum((second - first) * vertex_normals(first, definitions.faces), axis=1)
    distance = pose_distance_of_visits(definitions, *visits)
    n_scans = 2.0 / sum(1.0 / len(scans) for scans in visits)
    return VisitComparison(
        names=measured.names,
        units=measured.units,
        before=measured.values[0],
        after=measured.values[1],
        noise=noise_of_measurements(measured.names, distance, n_scans),
        pose_distance=distance,
        n_scans=n_scans,
        points_before=first,
        points_after=second,
        displacements=np.where(known_in_both, outward, np.nan),
        why_missing=measured.why_missing,
    )


def _scans(definitions: MeasurementSet, points: ArrayLike, name: str) -> Array:
    """Return the scans of one visit, shape (n_scans, V, 3)."""
    surfaces = real_array(points, name, (definitions.n_vertices, 3))
    if surfaces.ndim > 3 or not surfaces.size:
        raise ArgumentError(
            f"{name} must be one body, or the scans of one visit, shape (n_scans, V, 3); found "
            f"shape {surfaces.shape}"
        )
    return surfaces.reshape(-1, *surfaces.shape[-2:])


def _trusted_of_visits(
    definitions: MeasurementSet, visits: Sequence[Array], trusted_vertices: object
) -> list[Booleans]:
    """Return which vertices of the scans of each visit are trusted, each of shape (n_scans, V)."""
    if trusted_vertices is None:
        return [np.ones(scans.shape[:2], dtype=bool) for scans in visits]
    if all(len(scans) == 1 for scans in visits):
        shape = (2, definitions.n_vertices)
        given = mask(trusted_vertices, "trusted_vertices", (shape, shape[1:], (2, 1, *shape[1:])))
        return [row.reshape(1, -1) for row in np.broadcast_to(given.reshape(-1, shape[1]), shape)]
    if not isinstance(trusted_vertices, Sequence | np.ndarray) or len(trusted_vertices) != 2:
        raise ArgumentError("trusted_vertices must be a pair of arrays, one for each visit")
    pairs = enumerate(zip(trusted_vertices, visits, strict=True))
    return [
        mask(seen, f"trusted_vertices[{number}]", (scans.shape[:2],))
        for number, (seen, scans) in pairs
    ]
