"""How much measurements of an unchanged person vary, and how far apart two poses are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from riemhuman.arrays import Array, ArrayLike
from riemhuman.checks import checked, instance, positive, real_array
from riemhuman.checks.labels import texts_of
from riemhuman.errors import ArgumentError
from riemhuman.measurements.measurement_set import MeasurementSet, load_json
from riemhuman.surfaces.procrustes import procrustes

# Area of the open body model's template, square metres. The slopes were found with distances over a
# template of FAUST's size; if that has 10 per cent more area, deviations change by 2.5 per cent.
_AREA = 1.88


@checked(definitions=instance(MeasurementSet))
def pose_distance(definitions: MeasurementSet, points_a: ArrayLike, points_b: ArrayLike) -> Array:
    """Return how far apart the poses of bodies are, for `noise_of_measurements`, shape (...).

    It is the paper's distance of normal fields, `ElasticMetric(space, 0, 0, 1)`, after the second
    body has been aligned with the first. That distance grows with the root of the template's area;
    it is converted to a template of 1.88 square metres, the size of the open body model's. Two
    different poses of a person are typically 0.5 to 1.2 apart, two scans in one pose 0.1 to 0.2.

    Parameters
    ----------
    definitions : MeasurementSet
        Measurements of the bodies' template.
    points_a, points_b : array_like, shape (..., V, 3)
        Bodies, metres, as they stand. For the uncertainty of a single scan, the second is
        `in_standard_pose` of the first.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> definitions = rh.measurements.open_measurements(bodies.model)
    >>> float(rh.measurements.pose_distance(definitions, bodies[0], bodies[3]).round(2))
    0.61
    """
    shape = (definitions.n_vertices, 3)
    points_a = real_array(points_a, "points_a", shape)
    points_b = real_array(points_b, "points_b", shape)
    points_a, points_b = np.broadcast_arrays(points_a, points_b)
    aligned = np.empty(points_b.shape)
    for index in np.ndindex(points_b.shape[:-2]):
        aligned[index] = procrustes(points_b[index], to=points_a[index], scale=None)
    distances = definitions.pose_metric.dist(points_a, aligned)
    to_reference = np.sqrt(_AREA / definitions.surface.face_areas.sum())
    return np.asarray(to_reference * distances)


def pose_distance_of_visits(definitions: MeasurementSet, before: Array, after: Array) -> float:
    """Return the d for `noise_of_measurements` of what two visits with several scans differ by.

    Two scans of an unchanged person at a distance d differ with the variance 2 (noise² + b d). It
    follows that the means over two groups of scans differ with the variance
    2 (noise²/n + b (d₁₂ - d₁₁/2 - d₂₂/2)), with the mean distances d₁₂ between the groups, and d₁₁
    and d₂₂ within each, of every scan to every scan and to itself. If both visits have the same
    poses, these cancel.

    Parameters
    ----------
    definitions : MeasurementSet
    before, after : array, shape (n_scans, V, 3)
        The scans of each visit, as they stand; nothing is checked.
    """
    between = float(pose_distance(definitions, before[:, np.newaxis], after).mean())
    within = [_mean_distance_within(definitions, scans) for scans in (before, after)]
    return max(between - sum(within) / 2.0, 0.0)


def _mean_distance_within(definitions: MeasurementSet, scans: Array) -> float:
    """Return the mean pose distance of every scan to every scan, itself included."""
    first, second = np.triu_indices(len(scans), 1)
    if not len(first):
        return 0.0
    distances = pose_distance(definitions, scans[first], scans[second])
    return float(2.0 * distances.sum() / len(scans) ** 2)


@checked(n_scans=positive)
def noise_of_measurements(
    names: Sequence[str], pose_distance: ArrayLike = 0.0, n_scans: float = 1.0
) -> Array:
    """Return the standard deviations of measurements of an unchanged person, shape (..., M).

    The variance is noise² + b d: `noise` is that of simulated people registered from scans, d the
    distance between poses, and b was measured on five real people in ten poses each (FAUST
    registrations) [1]_. For d = 0.8 the median over all measurements is 7 mm; for the neck it is
    23 mm. Of the data set's five other people, 5.1 per cent of the measurements differed between
    two poses by more than 2√2 times this value; 4.55 per cent are expected. That was with an
    earlier `in_standard_pose`, which left more of the pose in simulated people whose flesh moves:
    b is probably too large today. It was not measured again.

    Parameters
    ----------
    names : sequence of str
        Measurements; those that the open body does not have get NaN.
    pose_distance : array_like, shape (...)
        The `pose_distance` d: between two visits, or between a scan and the standard pose. At 0,
        two scans in exactly the same pose are compared.
    n_scans : float
        Number of scans of which the values are means, by which noise² is divided.

    Returns
    -------
    array, shape (..., M)
        In the units of the measurements. Twice this value is the uncertainty (95 %) of one scan.

    References
    ----------
    .. [1] Bogo, Romero, Loper and Black, "FAUST: Dataset and evaluation for 3D mesh registration",
       CVPR 2014.

    Examples
    --------
    >>> rh.measurements.noise_of_measurements(["stature", "chest girth"]).round(4).tolist()
    [0.0048, 0.0082]
    >>> rh.measurements.noise_of_measurements(["stature", "chest girth"], 1.0).round(4).tolist()
    [0.0069, 0.0373]
    """
    names = texts_of(names, "names", "a list of names of measurements")
    distances = real_array(pose_distance, "pose_distance")[..., np.newaxis]
    if distances.size and distances.min() < 0.0:
        raise ArgumentError(f"pose_distance must be at least 0; found {distances.min():g}")
    # See tutorials/remake/build_noise_of_poses.py; the slopes are figures of real people.
    noise_by_name = load_json("noise_of_poses.json")["measurements"]
    slopes_by_name = load_json("variation_of_people.json")["slopes"]
    noise = np.array([noise_by_name.get(name, np.nan) for name in names])
    slopes = np.array([slopes_by_name.get(name, np.nan) for name in names])
    deviations: Array = np.sqrt(noise**2 / n_scans + slopes * distances)
    return deviations
