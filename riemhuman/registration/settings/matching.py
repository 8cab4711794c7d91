"""Settings by which points of a body find those of a scan."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.registration.settings._checks import check_amounts, check_counts, check_shares


@dataclass(frozen=True)
class MatchingSettings:
    """How points of a body find their matches in a scan.

    Attributes
    ----------
    normal_metres : float
        Distance that counts as much as a rotation of the normal by a radian, metres.
    n_matched : int
        Number of points of the scan that are averaged for a match, to reduce noise.
    blur_metres : float
        Standard deviation of their weights, metres.
    dense_metres : float
        If the points of the scan are farther apart than this, a match may be farther away along the
        surface by the excess, metres.
    n_noise : int
        Points from which the noise is estimated.
    prior_metres : float
        A coefficient of 1 counts as much as a point of the scan at this distance, so that the prior
        counts more the fewer points there are, metres.

    Examples
    --------
    >>> rh.registration.MatchingSettings(n_matched=8).n_matched
    8
    """

    normal_metres: float = 0.05
    n_matched: int = 4
    blur_metres: float = 0.008
    dense_metres: float = 0.02
    n_noise: int = 3000
    prior_metres: float = 0.02

    def __post_init__(self) -> None:
        check_counts(n_matched=self.n_matched, n_noise=self.n_noise)
        check_amounts(
            normal_metres=self.normal_metres,
            blur_metres=self.blur_metres,
            dense_metres=self.dense_metres,
            prior_metres=self.prior_metres,
        )


@dataclass(frozen=True)
class AssignmentSettings:
    """Soft assignment of a scan's points to those of a body.

    Attributes
    ----------
    worth : float
        Number of independent points that the scan counts as, relative to the prior.
    longest_rotation : float
        Largest rotation of a joint in a step, radians.
    least_shown : float
        Smallest share of the body that an incomplete scan is assumed to show.
    landmark_weight : float
        Weight of a landmark, as a share of all points of the scan.
    miss_metres : float
        Standard deviation of landmarks, metres.
    far_miss : float
        A landmark farther from its joint counts only as much as one at this distance, metres.

    Examples
    --------
    >>> rh.registration.AssignmentSettings().worth
    300.0
    """

    worth: float = 300.0
    longest_rotation: float = 0.6
    least_shown: float = 0.1
    landmark_weight: float = 0.03
    miss_metres: float = 0.04
    far_miss: float = 0.4

    def __post_init__(self) -> None:
        check_amounts(
            worth=self.worth,
            longest_rotation=self.longest_rotation,
            miss_metres=self.miss_metres,
            far_miss=self.far_miss,
        )
        check_shares(
            least_shown=self.least_shown,
            landmark_weight=self.landmark_weight,
        )
