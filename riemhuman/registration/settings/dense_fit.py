"""Settings of the dense fit."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.registration.settings._checks import (
    check_amounts,
    check_counts,
    check_lists,
    check_shares,
)


@dataclass(frozen=True)
class DenseFitSettings:
    """The fit of a body's parameters to the closest points of a scan.

    Attributes
    ----------
    scales : tuple of float
        Distance at which a match has a quarter of the weight, for each step, metres.
    known_scales : tuple of float
        The same if the fit starts from the previous frame, which is nearer, metres.
    n_samples : int
        Points of the body.
    along : float
        Share with which gaps along the surface count.
    longest_rotation : float
        Largest rotation of a joint in a step, radians.
    hands_precision : float
        Inverse variance of the coefficients of hand poses; a coefficient of 1 is the full pose.
    hair_metres : float
        Points farther outside the head are hair, metres.
    farthest_hair : float
        Points farther away than this are not hair, metres.
    most_hair : float
        If a larger share of the scan would be hair, no point is classified as hair.

    Examples
    --------
    >>> len(rh.registration.DenseFitSettings().scales)
    13
    """

    scales: tuple[float, ...] = (0.04, 0.03, 0.03, 0.03, *(0.02,) * 5, *(0.012,) * 4)
    known_scales: tuple[float, ...] = (*(0.02,) * 3, *(0.012,) * 4)
    n_samples: int = 3000
    along: float = 0.05
    longest_rotation: float = 0.3
    hands_precision: float = 300.0
    hair_metres: float = 0.02
    farthest_hair: float = 0.35
    most_hair: float = 0.1

    def __post_init__(self) -> None:
        check_lists(scales=self.scales, known_scales=self.known_scales)
        check_counts(n_samples=self.n_samples)
        check_amounts(
            longest_rotation=self.longest_rotation,
            hands_precision=self.hands_precision,
            hair_metres=self.hair_metres,
            farthest_hair=self.farthest_hair,
        )
        check_shares(along=self.along, most_hair=self.most_hair)
