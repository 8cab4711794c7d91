"""A body fitted again without the limbs that its scan does not show.

The model always has all limbs. One that the scan does not show is drawn to points of other parts,
and draws the part above it out of place: an upper arm follows the forearm that is fitted to the
trunk. In goes a fit of all limbs; out comes one without those that are lost, and what it shows.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from riemhuman.registration._arms_and_hands import BodyFit
from riemhuman.registration._dense_fit import fit_closest
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._even_points import even_points
from riemhuman.registration._scan_preparation import PreparedScan
from riemhuman.registration._shown_parts import ShownParts, find_shown_parts
from riemhuman.surfaces.nearest_points import nearest_points


def leave_out_lost_limbs(
    fitted: BodyFit, scan: PreparedScan, *, is_refused: bool
) -> tuple[BodyFit, ShownParts]:
    """Return a body fitted without the limbs that a scan does not show, and what it shows.

    A body that is refused anyway stays as it is, and so does one whose limb may be elsewhere in
    the scan.
    """
    shown, settings = find_shown_parts(fitted, scan), fitted.task.body.settings
    if is_refused or not (shown.lost & fitted.task.visible).any():
        return fitted, shown
    if not _explains_scan(fitted):
        return fitted, shown  # the limb may be where points are far from the body
    without = _fit_without(fitted, shown.lost)
    # If the limb is in the scan after all, its points are now far from the body.
    farther = settings.retries.farther_without_limbs
    is_farther = _distances_from(without).mean() > farther * _distances_from(fitted).mean()
    if is_farther or not _explains_scan(without):
        return fitted, shown
    return without, find_shown_parts(without, scan)


def _fit_without(fitted: BodyFit, lost: np.ndarray) -> BodyFit:
    """Return a body fitted again, and its elastic step, without some vertices."""
    task, visible = fitted.task, fitted.task.visible & ~lost
    areas = task.samples.areas * visible[task.samples.numbers]
    samples = task.samples._replace(areas=areas / areas.sum())
    task = replace(task, visible=visible, samples=samples)
    scales = task.body.settings.dense.scales
    pose = fit_closest(samples, fitted.fit.pose, task.prior, task.scan, scales)
    return replace(fitted, task=task, fit=leave_model(task, pose))


def _explains_scan(fitted: BodyFit) -> bool:
    """Return whether so much of a scan is near a body that no limb of the scan is elsewhere."""
    settings = fitted.task.body.settings.trust
    share = np.mean(_distances_from(fitted) < settings.near_metres)
    return bool(share >= settings.least_near_of_limb)


def _distances_from(fitted: BodyFit) -> np.ndarray:
    """Return the distances of some points of a scan from a body, limited, metres."""
    settings, points = fitted.task.body.settings.trust, fitted.task.scan.points
    some = points[even_points(points, settings.n_samples)]
    _, distances = nearest_points(some, fitted.fit.points, fitted.task.body.model.faces)
    limited: np.ndarray = np.minimum(distances, settings.near_metres)
    return limited
