"""The constants of registration, in the order of its stages.

They were calibrated on simulated scans; `tests/benchmarks/test_registration.py` prints what they
do. Lengths are metres and angles degrees, unless a comment says otherwise. What users change is in
`RegistrationSettings`.
"""

from __future__ import annotations

from typing import NamedTuple


class SearchRound(NamedTuple):
    """One round of the search over starts."""

    n_model: int  # points of the body
    n_scan: int  # points of the scan
    sigmas: tuple[float, float]  # first and last standard deviation of the assignment, metres
    n_steps: int  # from the first to the last; 0 only evaluates the likelihood
    n_best: int  # candidates that are kept


# Preparation: from a scan to evenly spread points with normals, without floor, walls and strays.

# Number of points that are examined, chosen at random; more would only take time.
FIRST_POINTS = 80000

# Triangles with a longer edge are split, because only vertices are matched, metres. The cells in
# which points are connected have at least this width.
LONG_EDGE = 0.05

# Triangles with a longer edge are floors or strays and stay whole, metres.
LONGEST_EDGE = 0.3

# Points farther from the median are strays, metres.
STRAY_METRES = 10.0

# The spacing of a point is the distance to this neighbour: on a surface, nearly every place is as
# near to some point of the scan.
N_CLOSE = 6

# Points of a scan show the surface around them up to this distance, metres: a sparse point
# represents no wider area, and only narrower holes are filled by the vertices around them.
WIDEST_SPACING = 0.06

# Only points with a larger spacing can be remnants of floors and stands, or strays, metres.
SPARSE_METRES = 0.03

# Remnants have a spacing of more than this multiple of the median over the area.
SPARSE_SPACINGS = 3.0

# If such points represent a larger share of the area, they are part of a body that was sampled
# less densely.
FEW_SPARSE = 0.03

# A point with a larger spacing belongs to no surface, metres.
LONELY_METRES = 0.15

# The plane of remnants of a floor holds at least this share of the sparse points.
IN_PLANE = 0.4

# Points with more than this multiple of the median spacing may be remnants of a floor.
SPARSER_SPACINGS = 1.5

# Strays of a depth sensor have as large a spacing, and are at most this share of the points.
FEW_STRAYS = 0.05

# A denser surface is sought within this multiple of their spacing.
STRAY_REACH = 3.0

# It is there if so many times as many points are within this distance as on an even surface.
CROWDED = 5.0

# Largest width of the cells in which points are connected, for sparse points, metres.
WIDEST_CELL = 0.12

# The cells are as wide as the spacing at this quantile of the area.
CELL_QUANTILE = 0.95

# Separate parts with a smaller share of the area are strays.
LARGEST_STRAY = 0.004

# Points within this distance of a plane support it, metres.
FLOOR_METRES = 0.01

# Points within this distance of a floor or wall belong to it, and to remnants of one, metres.
NEAR_FLOOR_METRES = 0.02

# Cosine of 26°, by which directions agree: normals of points of one floor or wall, of either sign;
# a given direction up and a floor, from which a wall leans more; feet or trunk and their direction
# up.
SAME_WAY = 0.9

# Standard deviation of a floor's points in the narrower direction, metres.
LEAST_WIDTH = 0.2

# A floor or wall holds at least this share of the points.
FLOOR_SHARE = 0.04

# At least this share of the other points is on one side of the plane.
ABOVE_FLOOR = 0.97

# Points whose tangent planes are tried as floors.
N_PLANES = 200

# Maximum number of planes: a floor and two walls.
MOST_PLANES = 3

# If a smaller share of a plane's points lies outside the outline of all others, the plane is a
# part of the body.
LEAST_OUTSIDE = 0.1

# The outline is widened by this length, metres.
OUTLINE_METRES = 0.03

# A body rests on a plane if at least this share of its points is near it; a body does not rest on
# a wall next to it.
LEAST_RESTING = 0.004

# Distance that counts as near, metres.
RESTING_METRES = 0.07

# Neighbours from which normals are estimated or averaged; the larger numbers are used if the first
# ones lie on a line, as along the rings of a scanner.
N_NORMAL_NEIGHBOURS = (14, 40, 110)

# Neighbours lie on a line if their second-largest variance is a smaller share of the largest.
ON_LINE = 0.15

# A mesh has no consistent side if more of its edges join triangles that face different ways.
MIXED_TRIANGLES = 0.05


# Matching: how points of a body find those of a scan.

# Distance that counts as much as a rotation of the normal by a radian, metres.
MATCH_NORMAL_METRES = 0.05

# Number of points of the scan that are averaged for a match, to reduce noise.
N_MATCHED = 4

# Standard deviation of their weights, metres.
BLUR_METRES = 0.008

# A coefficient of 1 counts as much as a point of the scan at this distance, so that the prior
# counts more the fewer points there are, metres.
PRIOR_METRES = 0.02


# Soft assignment of a scan's points to those of a body.

# Number of independent points that the scan counts as, relative to the prior.
SCAN_WORTH = 300.0

# Smallest share of the body that an incomplete scan is assumed to show.
LEAST_SHOWN = 0.1

# Weight of a landmark, as a share of all points of the scan.
LANDMARK_WEIGHT = 0.03

# Standard deviation of landmarks, metres.
MISS_METRES = 0.04

# A landmark farther from its joint counts only as much as one at this distance, metres.
FAR_MISS = 0.4


# The search over headings, starting poses and up directions.

# The first two rounds form one schedule, in which unlikely starts are dropped early.
SEARCH_ROUNDS = (
    SearchRound(250, 400, (0.2, 0.164), n_steps=2, n_best=96),
    SearchRound(250, 400, (0.134, 0.09), n_steps=3, n_best=24),
    SearchRound(500, 800, (0.09, 0.04), n_steps=6, n_best=6),
    SearchRound(1000, 1500, (0.04, 0.015), n_steps=9, n_best=3),
)

# Rounds for a body with another arm.
ARM_ROUNDS = (
    SearchRound(250, 400, (0.12, 0.05), n_steps=5, n_best=4),
    SearchRound(1000, 1500, (0.04, 0.015), n_steps=5, n_best=1),
)

# Rounds that start from a known body, such as that of the previous frame.
WARM_ROUNDS = (
    SearchRound(500, 800, (0.08, 0.04), n_steps=5, n_best=1),
    SearchRound(1000, 1500, (0.03, 0.015), n_steps=4, n_best=1),
)

# Number of steps that move the visible part of a start to the centre of the scan.
N_SHIFTS = 8

# An up direction is tried fully if its log-likelihood is at most this much below the best.
UP_MARGIN = 0.15

# Bodies, or places on them, that are nearer to each other than this are the same, metres.
SAME_METRES = 0.03

# Gain of the log-likelihood from which another arm is preferred: more than the difference between
# fits.
ARM_GAIN = 0.02

# Inverse variance of the coefficients of hands, which stay relaxed in the search.
STILL_HANDS = 1000000.0


# The dense fit of a body's parameters to the closest points of a scan.

# Distance at which a match has a quarter of the weight, for each step, metres.
DENSE_SCALES = (0.04, 0.03, 0.03, 0.03, 0.02, 0.02, 0.02, 0.02, 0.02, 0.012, 0.012, 0.012, 0.012)

# Points by which a body is fitted, and compared with its scan, of which the noise is estimated.
N_DENSE = 3000

# Share with which gaps along the surface count, in the elastic step too.
DENSE_ALONG = 0.05

# Largest rotation of a joint in a step, radians.
LONGEST_ROTATION = 0.6

# Skin, flesh and what else of people the model has not: smooth heights of about this standard
# deviation, metres, which are alike within this length, metres, as combinations of so many. Without
# them, gaps of some millimetres twist joints, and bodies slide along themselves. Chosen on six
# simulated people with 6 mm of skin that the model lacks, and not varied further. Only the last
# steps take them into account: with the steps before, too, people in the right place were a further
# 10 % nearer, but thighs twisted by the search stayed so.
DETAIL_METRES = 0.005
DETAIL_LENGTH = 0.1
N_DETAILS = 200

# Inverse variance of the coefficients of hand poses; a coefficient of 1 is the full pose.
HANDS_PRECISION = 300.0

# Points outside the head that match none of it are hair, unless they are farther away, metres.
FARTHEST_HAIR = 0.35

# If a larger share of the scan would be hair, no point is classified as hair.
MOST_HAIR = 0.1


# Other positions of forearms and hands.

# Rotations of the forearm about its axis from which fits start, degrees.
FOREARM_ANGLES = (0.0, 60.0, 120.0, 180.0, 240.0, 300.0)

# Bending angles of the wrist from which fits start, degrees.
WRIST_ANGLES = (0.0, -50.0, 50.0)

# Steps of closest points after which starts that lead to the same arm are merged. Fits that start
# from the previous frame, which is near, leave these steps out.
N_FIRST_STEPS = 6

# Standard deviation of the wrist in the dense fit: hands can bend back farther than in the
# starting poses. With this one in the search, too, more forearms ended twisted.
WRIST_DEGREES = 45.0

# An elbow that bends outward by this angle counts as twice the distance from the scan.
ELBOW_DEGREES = 30.0

# A wrist that rotates by this angle about another axis than its hinge counts as twice the
# distance.
HINGE_DEGREES = 60.0

# Arms are left out before the elastic step if their mean distance from points of the scan is more
# than this multiple of that of the nearest arm.
ARM_MOST_FARTHER = 1.8

# Two arms are different if their surfaces are this far apart on average, metres. A part that moves
# farther when scans share a shape is not where one of them puts it.
DIFFERENT_METRES = 0.008

# Another arm or hand must be nearer to the scan by this share of the distance.
LEAST_GAIN = 0.05

# It must also be nearer by this many standard errors, because few points are not enough to
# decide.
N_STANDARD_ERRORS = 2.0

# Points farther from an arm, a leg or the head belong to other parts of the body, metres.
LIMB_METRES = 0.03

# Points farther from a hand belong to other parts of the body, metres.
HAND_METRES = 0.01

# If the points of a hand are farther away on average, with distances limited as above, no pose of
# the hand explains them, metres.
UNEXPLAINED_METRES = 0.007

# Vertices that a hand pose moves by more than this belong to the hand, metres.
HAND_MOVES_METRES = 0.005

# Stiffness α of each elastic step of an arm.
ARM_STIFFNESSES = (0.001, 0.0003, 0.0001, 5e-05)


# The elastic step, in which the surface leaves the model.

# Stiffness α of the first step.
FIRST_STIFFNESS = 0.001

# Above this standard deviation of the noise, the last stiffness grows with its square, metres.
NOISE_METRES = 0.0014

# Steps from the first stiffness to the last.
N_ELASTIC_STEPS = 6

# Number of final steps that are repeated after the model is fitted to the result.
N_ELASTIC_STEPS_AGAIN = 2

# How often the model is fitted to the result.
N_ELASTIC_REPEATS = 2

# Steps of each such fit.
N_SURFACE_STEPS = 3

# Weight with which the model follows vertices without a match.
UNMATCHED_WEIGHT = 0.02

# A match at this distance has a quarter of the weight, metres.
ELASTIC_SCALE = 0.01

# Maximum number of conjugate gradient iterations in a step.
N_CONJUGATE = 60

# Relative residual at which these iterations end; steps need not be exact.
CONJUGATE_TOLERANCE = 0.03

# Number of halvings after which a step is taken even if the cost has not decreased.
MOST_HALVINGS = 6


# Clothes: the body beneath garments, if a scan is said to show a clothed person. Chosen on ten
# scans in simulated clothes.

# Distance at which a match has a quarter of the weight, for each step of the fit, metres.
CLOTHES_SCALES = (0.06,) * 12

# How strongly cloth pulls the skin, per metre: the number of independent distances, 20, because a
# garment that is loose is loose over all of a limb, over their mean, 12.5 mm.
CLOTH_PULL = 1600.0

# Weight of the prior, square metres. It does not depend on the number of points, as it does
# without clothes: what is bare is alike along its surface, and tells less than its points.
CLOTHED_PRIOR = 4e-7

# Where the scan is nearer to the skin than this, cloth is tight or none, metres: it pulls as at
# this distance, and the elastic step follows the scan.
TIGHT_METRES = 0.005

# Loose cloth hides a vertex if the scan is farther than that in the mean over the vertices within
# this distance, metres.
CLOTH_REACH = 0.12


# Several scans of one person. Chosen on 20 scans of three simulated people, of one view or with
# parts cut off.

# How often the shape is found from all scans, and then the poses from the shape.
N_SHARED_ROUNDS = 2

# Inverse variance of the coefficients around the shared ones.
SHARED_SHAPE_PRECISION = 1e4

# A scan is left out if its body is farther from the model with the shared shape than from that
# with its own by this factor. It was 1.1 to 1.4 for groups of one person, 1.4 to 2.8 for another
# person among three, and for two people from 1.2, if they are alike, to 3.1.
MOST_FOREIGN = 1.45

# The mean skin over scans is drawn to that of the model as by so many scans.
SHARED_SKIN_WEIGHT = 0.3


# Rivals: a limb is not trusted where other candidates are elsewhere that explain its points almost
# as well.

# Candidates are within reach if they are farther from the scan than the nearest one by at most this
# share of its distance. A body is fitted again without the limbs that the scan does not show, and
# this fit is kept if it is within reach: a forearm that is in the scan after all makes it 1.7 times
# as far.
LIMB_MARGIN = 0.25

# The same for other rotations of the head.
HEAD_MARGIN = 0.1

# Fingers are not trusted if the scan is farther from the hand, after the elastic step, than from
# the rest of the body by this factor.
MOST_FINGER_EXCESS = 3.0

# The same factor for other parts of limbs: these and what they carry are not trusted.
MOST_LIMB_EXCESS = 1.9

# A smaller mean distance from the rest of the body counts as this one, metres.
LEAST_REST_METRES = 0.0007

# Angles about the left and up axes from which other poses of the head start, degrees.
HEAD_TURNS = ((0, 60), (0, -60), (35, 0), (-35, 0))

# A candidate matters if it displaces a larger share of the limb than this. Forearms or shins are
# tried exchanged if a larger share of one is near the other.
LEAST_OF_LIMB = 0.05

# Surfaces that are nearer to each other touch, metres. Vertices of a limb that touch the rest of
# the body explain no points that nothing else would. Vertices that lie outside what a scan shows,
# and do not touch it, are not seen, such as straight fingers where the scan shows a fist.
TOUCHING_METRES = 0.015

# If more than this share of a hand's vertices touches the other hand, they hide each other's
# fingers.
MOST_TOUCHING = 0.1


# Trust: the checks by which a registered body, and its parts, are trusted.

# Log-likelihoods are normalised to a body of this area, because the density decreases as the area
# grows, square metres.
USUAL_AREA = 1.8

# A scan with a smaller log-likelihood does not look like one person.
LEAST_LIKELIHOOD = 2.4

# The same if it shows clothes: a wide dress had 1.8.
LEAST_LIKELIHOOD_CLOTHED = 1.5

# Amount by which the log-likelihood must exceed that of all bodies elsewhere, or of an earlier
# search.
BODY_MARGIN = 0.06

# A body is elsewhere if its visible part is this far away on average, metres.
RIVAL_METRES = 0.15

# Points of a scan within this distance of a body, or vertices of another limb, are near, metres.
NEAR_METRES = 0.05

# The same if it shows clothes, metres.
NEAR_CLOTHED_METRES = 0.15

# Smallest share of the scan that must be near the body.
LEAST_NEAR = 0.97

# If a smaller share of a limb is matched, the limb is lost or elsewhere, and other scans of the
# person do not tell where it is.
LIMB_ELSEWHERE = 0.3

# Such a limb is in doubt if a smaller share of the scan than this is near the body.
LEAST_NEAR_OF_LIMB = 0.995

# Root mean square of the shape coefficients beyond all people whom the model knows.
LARGEST_BETA = 4.0

# A body is wrong if d e⁻ˡ is larger than the next distance, with its log-likelihood l and the
# distance d from the model's surface within which this share of the scan lies.
FAR_SHARE = 0.95

# The distance in that rule, metres: d is 2 cm where the log-likelihood is 2.75, which is usual.
FAR_METRES = 0.00128


# In clothes, only head, hands and feet tell: a body is wrong if this share of the scan of them is
# not within this distance of the model's surface, metres. Of ten right bodies it was within 7 mm,
# in hair or shoes of 1 to 2 cm within 16; of fifteen in wrong poses beyond 42.
BARE_SHARE = 0.9
FAR_BARE = 0.025

# A limb is lost, too, if a smaller share of it is matched and does not touch the rest of the body.
# It was 0.2 or more for limbs in their places, in views from one side and of folded arms too, and
# 0.1 or less for those that scans lacked. Fingers of which less is matched are not trusted.
LEAST_OWN = 0.2

# Vertices within this distance of matching points are matched, metres. Where the points of a scan
# are farther apart, a match may be farther away along the surface by the excess.
MATCHED_METRES = 0.02

# Least weight of such a match.
LEAST_RELIABLE = 0.1

# A joint farther from its landmark is wrong, metres.
FARTHEST_MISS = 0.12

# Unseen parts are named if they make up a larger share of the surface together.
LEAST_UNSEEN = 0.1


# Retries: when a scan is searched again, or as that of half a body.

# Half a body is tried if a smaller share of the other half matches: a view from one side matches
# nearly half of the legs, legs fitted to the trunk about a third.
LEAST_MATCHED_HALF = 0.4

# Where a smaller share of the scan is near the body, it is refused for good reason: its arms and
# hands are left as they are, another search is a quick one, and halves are not tried.
CLEARLY_NEAR = 0.85

# About the number of points that decide this, and which of other arms are near.
N_NEAR = 500

# A second search follows so many times more starts, from the headings between; a quick one so many
# times fewer, and tries no arms.
MORE_STARTS = 2.0

# If the log-likelihood of a scan is lower than that of the previous frame by more than this, the
# search starts from scratch.
WARM_LOSS = 0.25

# If a smaller share of the estimated normals agrees with the body, their signs are ignored.
NORMALS_AGREE = 0.85
