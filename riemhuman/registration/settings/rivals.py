"""Settings by which limbs are doubted."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.registration.settings._checks import (
    check_amounts,
    check_counts,
    check_lists,
    check_pairs,
    check_shares,
)


@dataclass(frozen=True)
class RivalSettings:
    """When a limb is not trusted because another pose explains its points almost as well.

    Attributes
    ----------
    least_margin : float
        Another explanation must be farther from the scan than the fit by this share of the fit's
        distance.
    hand_margin : float
        The same for another pose of the hand, for which only the fingers are compared.
    most_hand_excess : float
        Fingers are not trusted if their points are farther from the nearest pose of the hand than
        those on the same arm from the arm, by this factor of the mean.
    least_told_apart : float
        And if the nearest pose is farther from them than this share of the median of all poses.
    least_hand_shown : float
        And if less than this share of their vertices have counterparts in the scan.
    most_finger_excess : float
        And if the scan is farther from the hand, after the elastic step, than from the rest of the
        body by this factor.
    most_limb_excess : float
        The same factor for other parts of limbs: these and what they carry are not trusted.
    least_rest_metres : float
        A smaller mean distance from the rest of the body counts as this one, metres.
    least_usual_metres : float
        Smallest mean distance used for the arm, because hands have finer detail, metres.
    head_margin : float
        The same share for another rotation of the head.
    head_turns : tuple of tuple of float
        Angles about the left and up axes from which other poses of the head start, degrees.
    elbow_swings : tuple of float
        Angles about the line from shoulder to wrist from which other elbow positions start,
        degrees.
    least_swung : float
        Elbows nearer to this line are not tried on the other side, metres.
    across : tuple of float
        Distances into the touched surface at which other hand positions start, metres.
    most_farther : float
        Rivals are left out if, after the first steps, their mean distance from points of the scan
        is more than this multiple of that of the fit.
    n_compared : int
        Approximate number of points by which heads and arms are compared.
    n_compared_first : int
        After the first steps, only every k-th of these points is compared.
    displaced_metres : float
        Vertices that a rival moves by more than this are not trusted, metres.
    least_displaced : float
        A rival matters if it displaces this share of a forearm and hand.
    touching_metres : float
        Vertices within this distance of another limb touch it, metres.
    most_touching : float
        If more than this share of a hand's vertices touches the other hand, they hide each other's
        fingers.
    crossing_share : float
        Hands that touch something with a larger share of their vertices are tried beyond it.
    crossing_metres : float
        Forearms or shins of which that share of vertices is so near to the other are tried
        exchanged, metres.
    exchanged_metres : float
        Points farther away belong to other parts of the body, metres.

    Examples
    --------
    >>> rh.registration.RivalSettings().least_margin
    0.35
    """

    least_margin: float = 0.35
    hand_margin: float = 0.20
    most_hand_excess: float = 2.5
    least_told_apart: float = 0.80
    least_hand_shown: float = 0.20
    most_finger_excess: float = 3.0
    # On simulated people who were not looked at before, 2 of 156 right limbs are above this and 74
    # of 82 deliberately wrong ones (`-k excess`); above 1.7 4 and 76, above 2.1 0 and 72.
    most_limb_excess: float = 1.9
    least_rest_metres: float = 0.0007
    least_usual_metres: float = 0.0015
    head_margin: float = 0.10
    head_turns: tuple[tuple[float, float], ...] = ((0, 60), (0, -60), (35, 0), (-35, 0))
    elbow_swings: tuple[float, ...] = (60.0, -60.0, 120.0, -120.0, 180.0)
    least_swung: float = 0.03
    across: tuple[float, ...] = (0.05, 0.11)
    most_farther: float = 4.0
    n_compared: int = 500
    n_compared_first: int = 3
    displaced_metres: float = 0.03
    least_displaced: float = 0.05
    touching_metres: float = 0.015
    most_touching: float = 0.10
    crossing_share: float = 0.02
    crossing_metres: float = 0.05
    exchanged_metres: float = 0.03

    def __post_init__(self) -> None:
        check_amounts(
            least_margin=self.least_margin,
            hand_margin=self.hand_margin,
            most_hand_excess=self.most_hand_excess,
            least_usual_metres=self.least_usual_metres,
            head_margin=self.head_margin,
            least_swung=self.least_swung,
            most_farther=self.most_farther,
            displaced_metres=self.displaced_metres,
            touching_metres=self.touching_metres,
            least_rest_metres=self.least_rest_metres,
            crossing_metres=self.crossing_metres,
            most_finger_excess=self.most_finger_excess,
            most_limb_excess=self.most_limb_excess,
            exchanged_metres=self.exchanged_metres,
        )
        check_counts(n_compared=self.n_compared, n_compared_first=self.n_compared_first)
        check_pairs(head_turns=self.head_turns)
        check_lists(elbow_swings=self.elbow_swings, across=self.across)
        check_shares(
            least_displaced=self.least_displaced,
            most_touching=self.most_touching,
            crossing_share=self.crossing_share,
            least_told_apart=self.least_told_apart,
            least_hand_shown=self.least_hand_shown,
        )
