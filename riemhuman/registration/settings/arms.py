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
    """How forearms and hands are tried in other ways, and compared.

    Attributes
    ----------
    n_samples : int
        Arms are fitted by their share of so many points of the body.
    forearm_angles : tuple of float
        Rotations of the forearm about itself to start from, degrees.
    wrist_angles : tuple of float
        Angles by which the wrist bends at the start, degrees.
    n_first_steps : int
        Steps of closest points after which starts that lead to the same arm are joined.
    wrist_degrees : float
        Standard deviation of the wrist in the dense fit: hands bend back farther than start poses.
    elbow_degrees : float
        An elbow that bends outward by this angle counts as twice the distance from the scan.
    hinge_degrees : float
        A wrist that rotates by this angle other than about its hinge counts as twice the distance.
    least_likely : float
        Arms that lower the log-likelihood by more than this are left out.
    most_farther : float
        Arms whose mean distance from points of the scan is this multiple of the nearest one's
        are left out before the elastic step.
    n_compared : int
        About the number of points for that.
    different_metres : float
        Two arms are different if their surfaces are this far apart in the mean, metres.
    least_gain : float
        Another arm or hand must be nearer to the scan by this share of the distance.
    n_errors : float
        And by so many standard errors, because few points are not enough to decide.
    arm_metres : float
        Points farther from an arm belong to other parts of the body, metres.
    hand_metres : float
        Points farther from a hand belong to other parts of the body, metres.
    unexplained_metres : float
        A hand whose points are farther in the mean, with distances limited as above, is explained
        by no pose of it, metres.
    hand_moves_metres : float
        Vertices that a pose of a hand moves by more belong to the hand, metres.
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
