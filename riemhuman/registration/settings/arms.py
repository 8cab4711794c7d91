"""Settings by which arms and hands are tried in other ways."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.registration.settings._checks import (
    check_amounts,
    check_counts,
    check_lists,
    check_shares,
)


@dataclass(frozen=True)
class ArmSettings:
    """How other positions of forearms and hands are tried and compared.

    Attributes
    ----------
    n_samples : int
        Number of points of the whole body, of which arms are fitted by their share.
    forearm_angles : tuple of float
        Rotations of the forearm about its axis from which fits start, degrees.
    wrist_angles : tuple of float
        Bending angles of the wrist from which fits start, degrees.
    n_first_steps : int
        Steps of closest points after which starts that lead to the same arm are merged.
    wrist_degrees : float
        Standard deviation of the wrist in the dense fit: hands can bend back farther than in the
        starting poses.
    elbow_degrees : float
        An elbow that bends outward by this angle counts as twice the distance from the scan.
    hinge_degrees : float
        A wrist that rotates by this angle about another axis than its hinge counts as twice the
        distance.
    least_likely : float
        Arms that lower the log-likelihood by more than this are left out.
    most_farther : float
        Arms are left out before the elastic step if their mean distance from points of the scan is
        more than this multiple of that of the nearest arm.
    n_compared : int
        Approximate number of points for this comparison.
    different_metres : float
        Two arms are different if their surfaces are this far apart on average, metres.
    least_gain : float
        Another arm or hand must be nearer to the scan by this share of the distance.
    n_errors : float
        It must also be nearer by this many standard errors, because few points are not enough to
        decide.
    arm_metres : float
        Points farther from an arm belong to other parts of the body, metres.
    hand_metres : float
        Points farther from a hand belong to other parts of the body, metres.
    unexplained_metres : float
        If the points of a hand are farther away on average, with distances limited as above, no
        pose of the hand explains them, metres.
    hand_moves_metres : float
        Vertices that a hand pose moves by more than this belong to the hand, metres.
    stiffnesses : tuple of float
        Stiffness α of each elastic step of an arm.

    Examples
    --------
    >>> rh.registration.ArmSettings().wrist_degrees
    45.0
    """

    n_samples: int = 1000
    forearm_angles: tuple[float, ...] = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)
    wrist_angles: tuple[float, ...] = (0.0, -50.0, 50.0)
    n_first_steps: int = 6
    wrist_degrees: float = 45.0
    elbow_degrees: float = 30.0
    hinge_degrees: float = 60.0
    least_likely: float = 0.06
    most_farther: float = 1.8
    n_compared: int = 500
    different_metres: float = 0.008
    least_gain: float = 0.05
    n_errors: float = 2.0
    arm_metres: float = 0.03
    hand_metres: float = 0.01
    unexplained_metres: float = 0.007
    hand_moves_metres: float = 0.005
    stiffnesses: tuple[float, ...] = (1e-3, 3e-4, 1e-4, 5e-5)

    def __post_init__(self) -> None:
        check_counts(
            n_samples=self.n_samples, n_first_steps=self.n_first_steps, n_compared=self.n_compared
        )
        check_lists(
            forearm_angles=self.forearm_angles,
            wrist_angles=self.wrist_angles,
            stiffnesses=self.stiffnesses,
        )
        check_amounts(
            wrist_degrees=self.wrist_degrees,
            elbow_degrees=self.elbow_degrees,
            hinge_degrees=self.hinge_degrees,
            least_likely=self.least_likely,
            most_farther=self.most_farther,
            different_metres=self.different_metres,
            n_errors=self.n_errors,
            arm_metres=self.arm_metres,
            hand_metres=self.hand_metres,
            unexplained_metres=self.unexplained_metres,
            hand_moves_metres=self.hand_moves_metres,
        )
        check_shares(least_gain=self.least_gain)
