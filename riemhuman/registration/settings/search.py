"""Settings of the search over starts."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.checks import flag, items_of, refuse_type, whole_number
from riemhuman.checks.labels import texts_of
from riemhuman.errors import ArgumentError
from riemhuman.registration.settings._checks import check_amounts, check_counts


@dataclass(frozen=True)
class SearchRound:
    """One round of the search over starts.

    Attributes
    ----------
    n_model : int
        Points of the body.
    n_scan : int
        Points of the scan.
    sigmas : tuple of float
        First and last standard deviation of the soft assignment, metres.
    n_steps : int
        Steps from the first to the last; 0 only evaluates the likelihood.
    n_best : int
        Candidates that are kept.

    Examples
    --------
    >>> rh.registration.SearchRound(250, 400, (0.2, 0.1), n_steps=5, n_best=24).n_steps
    5
    """

    n_model: int
    n_scan: int
    sigmas: tuple[float, float]
    n_steps: int
    n_best: int

    def __post_init__(self) -> None:
        check_counts(n_model=self.n_model, n_scan=self.n_scan, n_best=self.n_best)
        whole_number(self.n_steps, "n_steps", minimum=0)
        first, last = self.sigmas
        check_amounts(first_sigma=first, last_sigma=last)


@dataclass(frozen=True)
class SearchSettings:
    """The search over headings, starting poses and up directions.

    Attributes
    ----------
    poses : tuple of str, optional
        Names of the starting poses; None means all that the model has.
    n_headings : int
        Headings from which each pose starts, evenly spread over 360°.
    headings : tuple of int, optional
        Numbers of the headings that are tried, counted from the front; None means all.
    tries_arms : bool
        Whether the arms of the most likely body are tried in the positions of all starting poses.
    rounds : tuple of SearchRound
        The first two rounds form one schedule, in which unlikely starts are dropped early.
    arm_rounds : tuple of SearchRound
        Rounds for a body with another arm.
    warm_rounds : tuple of SearchRound
        Rounds that start from a known body, such as that of the previous frame.
    fine_round : SearchRound
        The final round, with the model at nearly full resolution.
    n_shifts : int
        Number of steps that move the visible part of a start to the centre of the scan.
    up_margin : float
        An up direction is tried fully if its log-likelihood is at most this much below the best.
    same_metres : float
        Candidates nearer to a better one, in root mean square distance, are dropped, metres.
    same_rotations : float
        Arms of two start poses are the same if no entry of their rotations differs by more.
    arm_gain : float
        Gain of the log-likelihood from which another arm is preferred: more than the difference
        between fits.
    warm_betas_precision : float
        Inverse variance of the shape coefficients for the next scan of the same person.
    still_hands : float
        Inverse variance of the coefficients of hands, which stay relaxed in the search.

    Examples
    --------
    >>> rh.registration.SearchSettings(poses=("a", "sit")).poses
    ('a', 'sit')
    """

    poses: tuple[str, ...] | None = None
    n_headings: int = 6
    headings: tuple[int, ...] | None = None
    tries_arms: bool = True
    rounds: tuple[SearchRound, ...] = (
        SearchRound(250, 400, (0.20, 0.164), 2, 96),
        SearchRound(250, 400, (0.134, 0.09), 3, 24),
        SearchRound(500, 800, (0.09, 0.04), 6, 6),
        SearchRound(1000, 1500, (0.04, 0.015), 9, 3),
    )
    arm_rounds: tuple[SearchRound, SearchRound] = (
        SearchRound(250, 400, (0.12, 0.05), 5, 4),
        SearchRound(1000, 1500, (0.04, 0.015), 5, 1),
    )
    warm_rounds: tuple[SearchRound, ...] = (
        SearchRound(500, 800, (0.08, 0.04), 5, 1),
        SearchRound(1000, 1500, (0.03, 0.015), 4, 1),
    )
    fine_round: SearchRound = SearchRound(3000, 5000, (0.015, 0.006), 5, 1)
    n_shifts: int = 8
    up_margin: float = 0.15
    same_metres: float = 0.03
    same_rotations: float = 0.05
    arm_gain: float = 0.02
    warm_betas_precision: float = 4.0
    still_hands: float = 1e6

    def __post_init__(self) -> None:
        check_counts(n_headings=self.n_headings, n_shifts=self.n_shifts)
        check_amounts(
            up_margin=self.up_margin,
            same_metres=self.same_metres,
            same_rotations=self.same_rotations,
            arm_gain=self.arm_gain,
            warm_betas_precision=self.warm_betas_precision,
            still_hands=self.still_hands,
        )
        flag(self.tries_arms, "tries_arms")
        _check_rounds(self.rounds, "rounds", least=2)
        _check_rounds(self.arm_rounds, "arm_rounds", least=2)
        if len(self.arm_rounds) != 2:
            raise ArgumentError(f"arm_rounds must be two; found {len(self.arm_rounds)}")
        _check_rounds(self.warm_rounds, "warm_rounds", least=1)
        _check_rounds((self.fine_round,), "fine_round", least=1)
        if self.poses is not None and not texts_of(self.poses, "poses"):
            raise ArgumentError("poses must name at least one start pose, or be None; found none")
        if self.headings is not None:
            headings = items_of(self.headings, "headings", "a tuple of whole numbers")
            for place, heading in enumerate(headings):
                last = self.n_headings - 1
                whole_number(heading, f"headings[{place}]", minimum=0, maximum=last)
            if not headings:
                raise ArgumentError("headings must hold at least one, or be None; found none")


def _check_rounds(rounds: tuple[SearchRound, ...], name: str, least: int) -> None:
    if not isinstance(rounds, tuple) or len(rounds) < least:
        refuse_type(rounds, name, f"a tuple of at least {least} SearchRound")
    for number, stage in enumerate(rounds):
        if not isinstance(stage, SearchRound):
            refuse_type(stage, f"{name}[{number}]", "a SearchRound")
