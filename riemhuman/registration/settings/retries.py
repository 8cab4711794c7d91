"""Settings by which scans are searched again."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.registration.settings._checks import check_amounts, check_counts, check_shares


@dataclass(frozen=True)
class RetrySettings:
    """When a scan is searched again, or as that of half a body.

    Attributes
    ----------
    least_matched_half : float
        Half a body is tried if a smaller share of the other half matches: a view from one side
        matches nearly half of the legs, legs fitted to the trunk about a third.
    clearly_near : float
        Where a smaller share of the scan is near the body, it is refused for good reason: its arms
        and hands are left as they are, and another search is a quick one.
    n_near : int
        About the number of points by which that is decided.
    most_matched_half : float
        If a body is refused and a smaller share of one half matches, the other half alone is tried.
    near_of_half : float
        A whole body fitted to the scan of half a body is near at least this share of the scan.
    more_starts : float
        A second search follows so many times more starts, from the headings between.
    fewer_starts : float
        A quick one follows this share of them, and tries no arms.
    retry_gain : float
        Gain of the log-likelihood from which the result of another search is preferred.
    warm_loss : float
        If the log-likelihood of a scan is lower than that of the previous frame by more than this,
        the search starts from scratch.
    farther_without_limbs : float
        A body is fitted again without the limbs that the scan does not show. This fit is kept
        unless the scan is farther from it by more than this factor: a forearm that is in the scan
        after all makes it 1.7.
    agreement : float
        If a smaller share of the estimated normals agrees with the body, their signs are ignored.

    Examples
    --------
    >>> rh.registration.RetrySettings().warm_loss
    0.25
    """

    least_matched_half: float = 0.4
    clearly_near: float = 0.85
    n_near: int = 500
    most_matched_half: float = 0.6
    near_of_half: float = 0.9
    more_starts: float = 2.0
    fewer_starts: float = 0.5
    retry_gain: float = 0.05
    warm_loss: float = 0.25
    farther_without_limbs: float = 1.1
    agreement: float = 0.85

    def __post_init__(self) -> None:
        check_amounts(
            more_starts=self.more_starts,
            retry_gain=self.retry_gain,
            warm_loss=self.warm_loss,
            farther_without_limbs=self.farther_without_limbs,
        )
        check_counts(n_near=self.n_near)
        check_shares(
            least_matched_half=self.least_matched_half,
            clearly_near=self.clearly_near,
            most_matched_half=self.most_matched_half,
            near_of_half=self.near_of_half,
            agreement=self.agreement,
            fewer_starts=self.fewer_starts,
        )
