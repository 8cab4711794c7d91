"""One person from several scans: the body in the standard pose, and how far to trust it."""

from __future__ import annotations

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Booleans
from riemhuman.checks import checked, instance, mask, real_array
from riemhuman.errors import ArgumentError
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.measurements.standard_pose import in_standard_pose
from riemhuman.measurements.uncertainty import pose_distance

# Weight of what a scan did not show, beside what it did: where no scan shows the body, all count.
_UNSEEN = 0.01
# Length over which one scan gives way to the others where it did not show the body, metres.
_SEAM_METRES = 0.03


@checked(definitions=instance(MeasurementSet))
def person_in_standard_pose(
    definitions: MeasurementSet,
    points: ArrayLike,
    *,
    trusted_vertices: ArrayLike | None = None,
) -> Array:
    """Return the body in the standard pose that several scans of one person have in the mean.

    Each scan is brought into the standard pose alone, by `in_standard_pose`; where a scan does not
    show the body, the others count. What a pose changes about the flesh differs from scan to scan,
    so that it cancels in part. On simulated people whose flesh moves in ways that the body model
    lacks, the median measurement of a person varies by 4.7 mm over poses with one scan, 3.5 with
    two and 2.3 with four, at slopes of 0.95 to 0.97 against the person made in the standard pose;
    on natural simulated people by 2.6, 1.9 and 1.3 mm (tests/benchmarks/test_several_scans.py).
    How much real people gain was not measured.

    One shape of the body model for all scans, with a pose for each, was tried in place of the mean,
    and repeated no better.

    Scans of different visits must not be mixed, because a change would be averaged away:
    `compare_visits` takes the scans of each visit.

    Parameters
    ----------
    definitions : MeasurementSet
        Measurements of a body model, with the standard pose.
    points : array_like, shape (n_scans, V, 3)
        Registered scans of one person at one visit, best in different poses, metres.
    trusted_vertices : array_like of bool, shape (n_scans, V), optional
        What each scan shows, such as `rh.registration.RegisteredScan.trusted_vertices`.

    Returns
    -------
    array, shape (V, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> definitions = rh.measurements.open_measurements(bodies.model)
    >>> rh.measurements.person_in_standard_pose(definitions, bodies.points[:3]).shape
    (1202, 3)
    """
    points = real_array(points, "points", ("n_scans", definitions.n_vertices, 3), batched=False)
    if not len(points):
        raise ArgumentError("points must hold at least one scan; found none")
    straight = in_standard_pose(definitions, points)
    if trusted_vertices is None:
        return np.asarray(straight.mean(axis=0))
    trusted = mask(trusted_vertices, "trusted_vertices", (points.shape[:2],))
    weights = _smooth_weights(definitions, trusted)
    return np.asarray(np.einsum("kv,kvx->vx", weights, straight) / weights.sum(axis=0)[:, None])


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


def _smooth_weights(definitions: MeasurementSet, trusted: Booleans) -> Array:
    """Return how much each scan counts at each vertex, shape (n_scans, V).

    At the edge of what it shows, a scan gives way to the others gradually: where two scans differ
    by millimetres, a sharp edge would leave a step.
    """
    flow = definitions.surface.vertex_heat.step(_SEAM_METRES**2)
    shown: Array = np.array([flow @ row for row in trusted.astype(float)])
    # Trusted vertices lose weight near the edge, and others gain none.
    weights: Array = np.maximum(np.clip(2.0 * shown - 1.0, 0.0, 1.0), _UNSEEN)
    return weights
