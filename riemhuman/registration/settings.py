"""The settings of registration, one class a stage; the defaults were calibrated on simulated scans.

`tests/benchmarks/test_registration.py` prints what they do.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from riemhuman.checks import real_number, refuse_type, whole_number
from riemhuman.errors import ArgumentError


def _check_counts(**counts: int) -> None:
    for name, value in counts.items():
        whole_number(value, name, minimum=1)


def _check_amounts(**amounts: float) -> None:
    """Refuse what is no positive number: a length, an angle, a weight or a deviation."""
    for name, value in amounts.items():
        real_number(value, name, minimum=0.0, strict=True)


def _check_lists(**lists: tuple[float, ...]) -> None:
    for name, values in lists.items():
        if not isinstance(values, tuple) or not values:
            refuse_type(values, name, "a tuple of numbers, at least one")
        for number, value in enumerate(values):
            real_number(value, f"{name}[{number}]")


def _check_shares(**shares: float) -> None:
    for name, value in shares.items():
        if real_number(value, name, minimum=0.0) > 1.0:
            raise ArgumentError(f"{name} must be a number between 0 and 1; found {value!r}")


def _check_cosines(**cosines: float) -> None:
    for name, value in cosines.items():
        if abs(real_number(value, name)) > 1.0:
            raise ArgumentError(f"{name} must be a cosine, between -1 and 1; found {value!r}")


@dataclass(frozen=True)
class PreparationSettings:
    """How a scan becomes evenly spread points with normals, without floor, walls and strays.

    Attributes
    ----------
    most_points : int
        Points of a scan that are kept: a fit gains nothing from more.
    first_points : int
        Points that are looked at, chosen at random; more would only take time.
    long_edge : float
        Triangles with a longer edge are split, because only vertices are matched, metres.
    longest_edge : float
        Triangles with a longer edge are floors or strays and stay whole, metres.
    far_metres : float
        Points farther from the median are strays, metres.
    n_close : int
        The spacing of a point is the distance to this neighbour: on a surface, nearly every place
        is as near to some point of the scan.
    widest_spacing : float
        No point stands for a wider area, metres.
    sparse_metres : float
        Only points with a larger spacing can be remnants of floors and stands, metres.
    sparse : float
        Remnants have a spacing of more than this multiple of the median over the area.
    few_sparse : float
        If such points stand for a larger share of the area, they are a body sampled less densely.
    lonely_metres : float
        A point with a larger spacing belongs to no surface, metres.
    plane_metres : float
        Remnants of a floor lie within this distance of one plane, metres.
    in_plane : float
        That plane holds at least this share of the sparse points.
    sparser : float
        Points with more than this multiple of the median spacing may be remnants of a floor.
    cell_metres : float
        Least width of the cells in which points are connected, metres.
    widest_cell : float
        Largest width of these cells, for sparse points, metres.
    cell_quantile : float
        The cells are as wide as the spacing at this quantile of the area.
    stray : float
        Separate parts with a smaller share of the area are strays.
    floor_metres : float
        Points this near to a plane support it, metres.
    near_floor_metres : float
        Points this near to a floor or wall belong to it, metres.
    floor_share : float
        A floor or wall holds at least this share of the points.
    above_floor : float
        At least this share of the other points is on one side of it.
    n_planes : int
        Points whose tangent planes are tried as floors.
    most_planes : int
        Planes that are looked for: a floor and two walls.
    least_outside : float
        A plane with a smaller share of its points outside the outline of all others is a part of
        the body.
    outline_metres : float
        The outline is widened by this length, metres.
    least_resting : float
        A body rests on a plane if at least this share of its points is near to it; no body rests
        on a wall beside it.
    resting_metres : float
        What near means for that, metres.
    n_neighbours : int
        Neighbours from which normals are estimated or averaged.
    more_neighbours : tuple of int
        Neighbours that are used instead where fewer lie on a line, as along a scanner's rings.
    on_line : float
        Neighbours are on a line if their second variance is a smaller share of the largest.
    normal_metres : float
        Distance that counts as much as a rotation of a normal by a radian in averages, metres.
    mixed : float
        A mesh has no consistent side if more of its edges join triangles that face different ways.
    least_level_floor : float
        Cosine between a given direction up and a floor's normal; a plane that leans more is a wall.

    Examples
    --------
    >>> rh.registration.PreparationSettings().most_points
    20000
    """

    most_points: int = 20_000
    first_points: int = 80_000
    long_edge: float = 0.05
    longest_edge: float = 0.3
    far_metres: float = 10.0
    n_close: int = 6
    widest_spacing: float = 0.06
    sparse_metres: float = 0.03
    sparse: float = 3.0
    few_sparse: float = 0.03
    lonely_metres: float = 0.15
    plane_metres: float = 0.02
    in_plane: float = 0.4
    sparser: float = 1.5
    cell_metres: float = 0.05
    widest_cell: float = 0.12
    cell_quantile: float = 0.95
    stray: float = 0.004
    floor_metres: float = 0.01
    near_floor_metres: float = 0.02
    floor_share: float = 0.04
    above_floor: float = 0.97
    n_planes: int = 200
    most_planes: int = 3
    least_outside: float = 0.1
    outline_metres: float = 0.03
    least_resting: float = 0.004
    resting_metres: float = 0.07
    n_neighbours: int = 14
    more_neighbours: tuple[int, ...] = (40, 110)
    on_line: float = 0.15
    normal_metres: float = 0.03
    mixed: float = 0.05
    least_level_floor: float = 0.8

    def __post_init__(self) -> None:
        _check_counts(
            most_points=self.most_points,
            first_points=self.first_points,
            n_close=self.n_close,
            n_planes=self.n_planes,
            most_planes=self.most_planes,
            n_neighbours=self.n_neighbours,
        )
        _check_amounts(
            long_edge=self.long_edge,
            longest_edge=self.longest_edge,
            far_metres=self.far_metres,
            widest_spacing=self.widest_spacing,
            sparse_metres=self.sparse_metres,
            sparse=self.sparse,
            lonely_metres=self.lonely_metres,
            plane_metres=self.plane_metres,
            sparser=self.sparser,
            cell_metres=self.cell_metres,
            widest_cell=self.widest_cell,
            floor_metres=self.floor_metres,
            near_floor_metres=self.near_floor_metres,
            outline_metres=self.outline_metres,
            resting_metres=self.resting_metres,
            normal_metres=self.normal_metres,
        )
        _check_shares(
            few_sparse=self.few_sparse,
            in_plane=self.in_plane,
            cell_quantile=self.cell_quantile,
            stray=self.stray,
            floor_share=self.floor_share,
            above_floor=self.above_floor,
            least_outside=self.least_outside,
            least_resting=self.least_resting,
            on_line=self.on_line,
            mixed=self.mixed,
        )
        _check_lists(more_neighbours=self.more_neighbours)
        _check_cosines(least_level_floor=self.least_level_floor)


@dataclass(frozen=True)
class MatchingSettings:
    """How points of a body find their matches in a scan.

    Attributes
    ----------
    normal_metres : float
        Distance that counts as much as a rotation of the normal by a radian, metres.
    n_matched : int
        Points of the scan that are averaged for a match, against noise.
    blur_metres : float
        Standard deviation of their weights, metres.
    dense_metres : float
        Where the scan's points are farther apart, a match may be as much farther along the
        surface, metres.
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
        _check_counts(n_matched=self.n_matched, n_noise=self.n_noise)
        _check_amounts(
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
        A scan of a part of a body shows at least this share of the body.
    landmark_weight : float
        Weight of a landmark, as a share of all points of the scan.
    miss_metres : float
        Standard deviation of landmarks, metres.
    far_miss : float
        A landmark farther from its joint counts no more than at this distance, metres.

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
        _check_amounts(
            worth=self.worth,
            longest_rotation=self.longest_rotation,
            miss_metres=self.miss_metres,
            far_miss=self.far_miss,
        )
        _check_shares(
            least_shown=self.least_shown,
            landmark_weight=self.landmark_weight,
        )


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
        _check_counts(n_model=self.n_model, n_scan=self.n_scan, n_best=self.n_best)
        whole_number(self.n_steps, "n_steps", minimum=0)
        first, last = self.sigmas
        _check_amounts(first_sigma=first, last_sigma=last)


@dataclass(frozen=True)
class SearchSettings:
    """The search over headings, start poses and directions up.

    Attributes
    ----------
    poses : tuple of str, optional
        Names of the start poses; None stands for all that the model has.
    n_headings : int
        Headings from which each pose starts, evenly spread over 360°.
    headings : tuple of int, optional
        Those of them that are tried, by number from the front; None stands for all.
    tries_arms : bool
        Whether the arms of the likeliest body are tried in the positions of all start poses.
    rounds : tuple of SearchRound
        The first two are one schedule, in which unlikely starts are dropped early.
    arm_rounds : tuple of SearchRound
        Rounds for a body with another arm.
    warm_rounds : tuple of SearchRound
        Rounds from a known body, as a moment before.
    fine_round : SearchRound
        The round after all others, of the model at nearly full resolution.
    n_shifts : int
        Steps by which the visible part of a start comes to the centre of the scan.
    up_margin : float
        A direction up is tried fully if its log-likelihood is at most this much below the best.
    same_metres : float
        Candidates nearer to a better one, in root mean square distance, are dropped, metres.
    arm_gain : float
        What the log-likelihood gains where another arm is right: more than it differs between fits.
    warm_betas_precision : float
        Inverse variance of the shape coefficients for a scan of the same person a moment later.
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
    arm_gain: float = 0.02
    warm_betas_precision: float = 4.0
    still_hands: float = 1e6

    def __post_init__(self) -> None:
        _check_counts(n_headings=self.n_headings, n_shifts=self.n_shifts)
        _check_amounts(
            up_margin=self.up_margin,
            same_metres=self.same_metres,
            arm_gain=self.arm_gain,
            warm_betas_precision=self.warm_betas_precision,
            still_hands=self.still_hands,
        )
        if len(self.rounds) < 2:
            raise ArgumentError(f"rounds must be two or more; found {len(self.rounds)}")
        if len(self.arm_rounds) != 2:
            raise ArgumentError(f"arm_rounds must be two; found {len(self.arm_rounds)}")
        if self.poses is not None and not self.poses:
            raise ArgumentError("poses must name at least one start pose, or be None; found none")
        if self.headings is not None:
            numbers = range(self.n_headings)
            if not self.headings or any(number not in numbers for number in self.headings):
                raise ArgumentError(
                    f"headings must be numbers from 0 to {self.n_headings - 1}; found "
                    f"{self.headings!r}"
                )


@dataclass(frozen=True)
class DenseFitSettings:
    """The fit of a body's parameters to the closest points of a scan.

    Attributes
    ----------
    scales : tuple of float
        A match at this distance has a quarter of the weight, in each step, metres.
    known_scales : tuple of float
        The same from a body a moment before, which is nearer, metres.
    n_samples : int
        Points of the body.
    along : float
        Share with which gaps along the surface count.
    longest_rotation : float
        Largest rotation of a joint in a step, radians.
    hands_precision : float
        Inverse variance of the coefficients of hands, of which 1 is a pose of a hand.
    hair_metres : float
        Points farther outside the head are hair, metres.
    farthest_hair : float
        Points farther away than this are no hair, metres.
    most_hair : float
        If more of the scan would be hair, none is.

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
        _check_lists(scales=self.scales, known_scales=self.known_scales)
        _check_counts(n_samples=self.n_samples)
        _check_amounts(
            longest_rotation=self.longest_rotation,
            hands_precision=self.hands_precision,
            hair_metres=self.hair_metres,
            farthest_hair=self.farthest_hair,
        )
        _check_shares(along=self.along, most_hair=self.most_hair)


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
        _check_counts(
            n_samples=self.n_samples, n_first_steps=self.n_first_steps, n_compared=self.n_compared
        )
        _check_lists(
            forearm_angles=self.forearm_angles,
            wrist_angles=self.wrist_angles,
            stiffnesses=self.stiffnesses,
        )
        _check_amounts(
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
        _check_shares(least_gain=self.least_gain)


@dataclass(frozen=True)
class ElasticSettings:
    """The elastic step, in which the surface leaves the model.

    Attributes
    ----------
    first_stiffness : float
        Stiffness α of the first step.
    last_stiffness : float
        Stiffness α of the last step for a scan with little noise.
    noise_metres : float
        Above this standard deviation of the noise, the last stiffness grows with its square,
        metres.
    n_steps : int
        Steps from the first stiffness to the last.
    n_steps_again : int
        The last so many steps are taken again after the model is fitted to the result.
    n_repeats : int
        How often the model is fitted to the result.
    n_surface_steps : int
        Steps of each such fit.
    unmatched : float
        Weight with which the model follows vertices without a match.
    scale : float
        A match at this distance has a quarter of the weight, metres.
    along : float
        Share with which gaps along the surface count.
    n_conjugate : int
        Most conjugate gradients of a step.
    conjugate_tolerance : float
        Relative residual at which they end: steps need not be exact.
    most_halvings : int
        Halvings of a step after which it is taken although the cost has not fallen.

    Examples
    --------
    >>> rh.registration.ElasticSettings(last_stiffness=1e-4).last_stiffness
    0.0001
    """

    first_stiffness: float = 1e-3
    last_stiffness: float = 2e-5
    # Scans of booths have an estimated noise of 0.4 to 0.5 mm, clouds without noise 0.3 to 0.6: for
    # them every value from 0.9 to 2 mm is the same. With 2 mm of noise, 0.9 → 2.0 gained 0.7 mm
    # on FAUST, whose skin the model lacks (1.4 was not tried there); on simulated people 2.0 loses
    # 0.6 to 0.9 mm against 1.4, 0.15 mm on one whom the model cannot make, and counts 8.4 % of the
    # back of a view from the front as seen, not below 8 %.
    noise_metres: float = 0.0014
    n_steps: int = 6
    n_steps_again: int = 2
    n_repeats: int = 2
    n_surface_steps: int = 3
    unmatched: float = 0.02
    scale: float = 0.01
    along: float = 0.05
    n_conjugate: int = 60
    conjugate_tolerance: float = 3e-2
    most_halvings: int = 6

    def __post_init__(self) -> None:
        _check_amounts(
            first_stiffness=self.first_stiffness,
            last_stiffness=self.last_stiffness,
            noise_metres=self.noise_metres,
            scale=self.scale,
            conjugate_tolerance=self.conjugate_tolerance,
        )
        _check_counts(
            n_steps=self.n_steps,
            n_steps_again=self.n_steps_again,
            n_surface_steps=self.n_surface_steps,
            n_conjugate=self.n_conjugate,
        )
        whole_number(self.n_repeats, "n_repeats", minimum=0)
        whole_number(self.most_halvings, "most_halvings", minimum=0)
        _check_shares(unmatched=self.unmatched, along=self.along)


@dataclass(frozen=True)
class RivalSettings:
    """When a limb is not trusted because something else explains its points almost as well.

    Attributes
    ----------
    least_margin : float
        Another explanation must be farther from the scan than the fit by this share of the fit's
        distance.
    hand_margin : float
        The same for another pose of the hand, whose fingers alone are compared.
    most_hand_excess : float
        Fingers are not trusted if their points are farther from the nearest pose of the hand than
        those on the same arm from the arm, by this factor of the mean.
    least_usual_metres : float
        A smaller mean distance on the arm counts as this one: hands have finer detail, metres.
    head_margin : float
        The same share for another rotation of the head.
    head_turns : tuple of tuple of float
        Angles about the axes to the left and up by which other heads start, degrees.
    elbow_swings : tuple of float
        Angles about the line from shoulder to wrist by which other elbows start, degrees.
    least_swung : float
        Elbows nearer to this line have no other side, metres.
    across : tuple of float
        Distances into what a hand touches at which other hands start, metres.
    most_farther : float
        Rivals whose mean distance from points of the scan is this multiple of the fit's after the
        first steps are left out.
    n_compared : int
        About the number of points by which heads and arms are compared.
    n_compared_first : int
        Every k-th of them is compared after the first steps.
    displaced_metres : float
        Vertices that a rival moves by more are not trusted, metres.
    least_displaced : float
        A rival matters if it displaces this share of a forearm and hand.
    touching_metres : float
        Vertices this near to another limb touch it, metres.
    most_touching : float
        Hands that touch with more than this share of one's vertices hide each other's fingers.
    crossing_share : float
        Limbs that touch with a larger share of their vertices are tried exchanged.
    exchanged_metres : float
        Points farther away belong to other parts of the body, metres.

    Examples
    --------
    >>> rh.registration.RivalSettings().least_margin
    0.35
    """

    least_margin: float = 0.35
    hand_margin: float = 0.10
    most_hand_excess: float = 2.3
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
    exchanged_metres: float = 0.03

    def __post_init__(self) -> None:
        _check_amounts(
            least_margin=self.least_margin,
            hand_margin=self.hand_margin,
            most_hand_excess=self.most_hand_excess,
            least_usual_metres=self.least_usual_metres,
            head_margin=self.head_margin,
            least_swung=self.least_swung,
            most_farther=self.most_farther,
            n_compared=self.n_compared,
            displaced_metres=self.displaced_metres,
            touching_metres=self.touching_metres,
            exchanged_metres=self.exchanged_metres,
        )
        _check_counts(n_compared_first=self.n_compared_first)
        _check_lists(elbow_swings=self.elbow_swings, across=self.across)
        _check_shares(
            least_displaced=self.least_displaced,
            most_touching=self.most_touching,
            crossing_share=self.crossing_share,
        )


@dataclass(frozen=True)
class TrustSettings:
    """The checks by which a registered body, and its parts, are trusted.

    Attributes
    ----------
    area : float
        Log-likelihoods are compared for bodies of this area, because the density falls as the area
        grows, square metres.
    least_likelihood : float
        A scan with a smaller log-likelihood does not look like one person.
    least_margin : float
        By how much the log-likelihood must exceed that of all bodies elsewhere.
    rival_metres : float
        A body is elsewhere if its visible part is this far away in the mean, metres.
    near_metres : float
        Points of the scan within this distance are near the body, metres.
    least_near : float
        Least share of the scan that is near the body.
    limb_elsewhere : float
        A limb of which a smaller share is matched may be elsewhere.
    least_near_of_limb : float
        It is in doubt if less of the scan than this is near the body.
    largest_beta : float
        Root mean square of the shape coefficients beyond all people whom the model knows.
    largest_overlap : float
        Share of the body that may lie where another part is; exact bodies reach 0.016 in deep
        squats.
    far_share : float
        A body is wrong if ln(d / far_metres) > l − usual_likelihood, with its log-likelihood l and
        the distance d from the model's surface within which this share of the scan lies.
    far_metres : float
        The distance in that rule, metres.
    usual_likelihood : float
        The log-likelihood in that rule.
    shared_limb : float
        A limb is not in the scan if more of its matches are those of another part too.
    least_bent : float
        Least cosine between a limb's two bones, that of 160°: no elbow or knee bends farther.
    matched_metres : float
        Vertices within this distance of matching points are matched, metres.
    least_reliable : float
        Least weight of such a match.
    seen_metres : float
        Holes up to twice this width are filled by the vertices around them, metres.
    outside_metres : float
        None is filled so far outside of what the scan shows, as straight fingers of a fist, metres.
    apart_metres : float
        Parts that overlap are this far apart in the rest pose, metres.
    along_metres : float
        They are this near along their normals, metres.
    overlap_metres : tuple of float
        They are as near as neighbours in the mesh, between these limits, metres.
    one_sided : float
        Another part is on one side, as at a seam, if the mean of the unit vectors towards it is
        longer.
    same_place : float
        It is in the same place if it is nearer than this share of that distance.
    n_neighbours : int
        Vertices that are compared for that.
    n_samples : int
        Points of the scan that are compared with the body.
    farthest_miss : float
        A joint farther from its landmark is wrong, metres.
    least_unseen : float
        Parts that are not seen are named if they are a larger share of the surface together.
    guessed_up : float
        If a larger share is not seen, the direction up is a guess.
    leaning : float
        Cosine of 25°, by which feet and trunk lean from an axis that is not the direction up.
    feet_agree : float
        Cosine of 30°, the largest angle between the feet for that.

    Examples
    --------
    >>> rh.registration.TrustSettings().near_metres
    0.05
    """

    area: float = 1.8
    least_likelihood: float = 2.4
    least_margin: float = 0.06
    rival_metres: float = 0.15
    near_metres: float = 0.05
    least_near: float = 0.97
    limb_elsewhere: float = 0.3
    least_near_of_limb: float = 0.995
    largest_beta: float = 4.0
    largest_overlap: float = 0.02
    far_share: float = 0.95
    far_metres: float = 0.020
    usual_likelihood: float = 2.75
    shared_limb: float = 0.5
    least_bent: float = -0.94
    matched_metres: float = 0.02
    least_reliable: float = 0.1
    seen_metres: float = 0.06
    outside_metres: float = 0.015
    apart_metres: float = 0.15
    along_metres: float = 0.012
    overlap_metres: tuple[float, float] = (0.015, 0.045)
    one_sided: float = 0.75
    same_place: float = 0.3
    n_neighbours: int = 30
    n_samples: int = 3000
    farthest_miss: float = 0.12
    least_unseen: float = 0.1
    guessed_up: float = 0.25
    leaning: float = 0.906
    feet_agree: float = 0.866

    def __post_init__(self) -> None:
        real_number(self.least_likelihood, "least_likelihood")
        real_number(self.usual_likelihood, "usual_likelihood")
        _check_amounts(
            area=self.area,
            least_margin=self.least_margin,
            rival_metres=self.rival_metres,
            near_metres=self.near_metres,
            largest_beta=self.largest_beta,
            far_metres=self.far_metres,
            matched_metres=self.matched_metres,
            seen_metres=self.seen_metres,
            outside_metres=self.outside_metres,
            apart_metres=self.apart_metres,
            along_metres=self.along_metres,
            farthest_miss=self.farthest_miss,
        )
        _check_shares(
            least_near=self.least_near,
            limb_elsewhere=self.limb_elsewhere,
            least_near_of_limb=self.least_near_of_limb,
            largest_overlap=self.largest_overlap,
            one_sided=self.one_sided,
            same_place=self.same_place,
            far_share=self.far_share,
            shared_limb=self.shared_limb,
            least_reliable=self.least_reliable,
            least_unseen=self.least_unseen,
            guessed_up=self.guessed_up,
        )
        _check_counts(n_neighbours=self.n_neighbours, n_samples=self.n_samples)
        _check_lists(overlap_metres=self.overlap_metres)
        _check_cosines(least_bent=self.least_bent, leaning=self.leaning, feet_agree=self.feet_agree)


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
        Of a refused body, half a one is tried where a smaller share of the other half matches.
    near_of_half : float
        A whole body fitted to half a one is near to at least this share of it.
    retry_gain : float
        What the log-likelihood gains where another search leads to another body.
    warm_loss : float
        A scan whose log-likelihood falls by more than this below that of the moment before is
        searched from scratch.
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
    retry_gain: float = 0.05
    warm_loss: float = 0.25
    agreement: float = 0.85

    def __post_init__(self) -> None:
        _check_amounts(retry_gain=self.retry_gain, warm_loss=self.warm_loss)
        _check_counts(n_near=self.n_near)
        _check_shares(
            least_matched_half=self.least_matched_half,
            clearly_near=self.clearly_near,
            most_matched_half=self.most_matched_half,
            near_of_half=self.near_of_half,
            agreement=self.agreement,
        )


@dataclass(frozen=True)
class RegistrationSettings:
    """All settings of `ScanRegistration`, by stage, in the order in which the stages run.

    Attributes
    ----------
    preparation : PreparationSettings
        From a scan to evenly spread points with normals, without its surroundings.
    matching : MatchingSettings
        How points of a body find their matches.
    assignment : AssignmentSettings
        Soft assignment.
    search : SearchSettings
        The search over headings, start poses and directions up.
    dense : DenseFitSettings
        The fit of all parameters to closest points.
    arms : ArmSettings
        Other ways to hold forearms and hands.
    elastic : ElasticSettings
        The elastic step.
    rivals : RivalSettings
        Which limbs are in doubt.
    trust : TrustSettings
        Which bodies, and which of their vertices, are trusted.
    retries : RetrySettings
        When a scan is searched again.

    Examples
    --------
    >>> from dataclasses import replace
    >>> settings = rh.registration.RegistrationSettings()
    >>> settings.search.n_headings
    6
    >>> finer = replace(settings, search=replace(settings.search, n_headings=8))
    >>> model = rh.datasets.load_open_model("coarse")
    >>> registration = rh.registration.ScanRegistration(model, settings=finer)
    """

    preparation: PreparationSettings = field(default_factory=PreparationSettings)
    matching: MatchingSettings = field(default_factory=MatchingSettings)
    assignment: AssignmentSettings = field(default_factory=AssignmentSettings)
    search: SearchSettings = field(default_factory=SearchSettings)
    dense: DenseFitSettings = field(default_factory=DenseFitSettings)
    arms: ArmSettings = field(default_factory=ArmSettings)
    elastic: ElasticSettings = field(default_factory=ElasticSettings)
    rivals: RivalSettings = field(default_factory=RivalSettings)
    trust: TrustSettings = field(default_factory=TrustSettings)
    retries: RetrySettings = field(default_factory=RetrySettings)

    def __post_init__(self) -> None:
        _check_part(self.preparation, "preparation", PreparationSettings)
        _check_part(self.matching, "matching", MatchingSettings)
        _check_part(self.assignment, "assignment", AssignmentSettings)
        _check_part(self.search, "search", SearchSettings)
        _check_part(self.dense, "dense", DenseFitSettings)
        _check_part(self.arms, "arms", ArmSettings)
        _check_part(self.elastic, "elastic", ElasticSettings)
        _check_part(self.rivals, "rivals", RivalSettings)
        _check_part(self.trust, "trust", TrustSettings)
        _check_part(self.retries, "retries", RetrySettings)


def _check_part(part: object, name: str, expected: type) -> None:
    if not isinstance(part, expected):
        refuse_type(part, name, f"a {expected.__name__}")


DEFAULT_SETTINGS = RegistrationSettings()
