"""The starts of a search: start poses with several headings, in the middle of a scan.

In go a model and a prepared scan; out come `Candidate`s that are not fitted yet.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array
from riemhuman.bodies import rotation_matrix
from riemhuman.registration._constants import (
    N_SHIFTS,
    SEARCH_ROUNDS,
)
from riemhuman.registration._even_points import even_points
from riemhuman.registration._posed_body import Pose, Prior, pose_body
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import PreparedScan

_UP = np.array([0.0, 1.0, 0.0])


@dataclass(frozen=True)
class Candidate:
    """A body fitted from one start."""

    pose: Pose
    prior: Prior
    likelihood: float  # mean log-likelihood of the scan points in the last round
    up: Array  # direction up of its start
    number: int = 0  # of its start
    known: bool = False  # whether it started from the body a moment before


def make_starts(
    body: RegistrationModel,
    scan: PreparedScan,
    names: Iterable[str],
    ups: Iterable[Array],
    offset: float,
) -> list[Candidate]:
    """Return starts of some poses with all headings, which begin at an offset, in steps."""
    settings = body.settings
    numbers = range(settings.n_headings) if settings.headings is None else settings.headings
    angles = (np.array(numbers) + offset) * (2.0 * np.pi / settings.n_headings)
    first = SEARCH_ROUNDS[0]
    centre = scan.points[even_points(scan.points, first.n_scan)].mean(axis=0)
    betas = np.zeros(len(body.betas_precisions))
    starts: list[Candidate] = []
    for up in ups:
        upright = Rotation.align_vectors(up, _UP)[0].as_matrix()
        for name in names:
            for angle in angles:
                local = body.poses[name].copy()
                local[body.root] = upright @ rotation_matrix(angle * _UP) @ local[body.root]
                shift = _shift_to(body, scan, Pose(local, betas, np.zeros(3)), centre, up)
                prior = body.prior(Pose(body.poses[name], betas, shift))
                pose = Pose(local, betas, shift)
                starts.append(Candidate(pose, prior, -np.inf, up, len(starts)))
    return starts


def _shift_to(
    body: RegistrationModel, scan: PreparedScan, pose: Pose, centre: Array, up: Array
) -> Array:
    """Return the translation that brings what a scan shows of a body to the centre of the scan."""
    samples, end = body.samples(SEARCH_ROUNDS[0].n_model), body.end_of(scan.points, up)
    points = pose_body(samples, pose).points
    shift: Array = centre - samples.areas @ points
    if end is not None:
        for _ in range(N_SHIFTS):
            shown = samples.areas * end.shows(points + shift)
            shift = centre - shown @ points / shown.sum()
    return shift
