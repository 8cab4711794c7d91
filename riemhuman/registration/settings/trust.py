"""Settings by which bodies and their parts are trusted."""

from __future__ import annotations

from dataclasses import dataclass

from riemhuman.checks import real_number
from riemhuman.registration.settings._checks import (
    check_amounts,
    check_cosines,
    check_counts,
    check_lists,
    check_shares,
)


@dataclass(frozen=True)
class TrustSettings:
    """The checks by which a registered body, and its parts, are trusted.

    Attributes
    ----------
    area : float
        Log-likelihoods are normalised to a body of this area, because the density decreases as the
        area grows, square metres.
    least_likelihood : float
        A scan with a smaller log-likelihood does not look like one person.
    least_margin : float
        Amount by which the log-likelihood must exceed that of all bodies elsewhere.
    rival_metres : float
        A body is elsewhere if its visible part is this far away on average, metres.
    near_metres : float
        Points of the scan within this distance are near the body, metres.
    least_near : float
        Smallest share of the scan that must be near the body.
    limb_elsewhere : float
        If a smaller share of a limb is matched, the limb may be elsewhere.
    least_near_of_limb : float
        Such a limb is in doubt if a smaller share of the scan than this is near the body.
    largest_beta : float
        Root mean square of the shape coefficients beyond all people whom the model knows.
    largest_overlap : float
        Share of the body that may overlap another part; exact bodies reach 0.016 in deep squats.
    far_share : float
        A body is wrong if ln(d / far_metres) > l − usual_likelihood, with its log-likelihood l and
        the distance d from the model's surface within which this share of the scan lies.
    far_metres : float
        The distance in that rule, metres.
    usual_likelihood : float
        The log-likelihood in that rule.
    shared_limb : float
        A limb is not in the scan if a larger share of its matches also belongs to another part.
    least_bent : float
        Smallest cosine between the two bones of a limb, that of 160°: no elbow or knee bends
        farther.
    matched_metres : float
        Vertices within this distance of matching points are matched, metres.
    least_reliable : float
        Least weight of such a match.
    seen_metres : float
        Holes up to twice this width are filled by the vertices around them, metres.
    outside_metres : float
        Vertices farther outside the scanned surface are not filled, such as straight fingers where
        the scan shows a fist, metres.
    apart_metres : float
        Parts that overlap are this far apart in the rest pose, metres.
    along_metres : float
        Such parts are this near to each other along their normals, metres.
    overlap_metres : tuple of float
        Such parts are as near as neighbours in the mesh, within these limits, metres.
    one_sided : float
        Another part lies on one side, as at a seam, if the mean of the unit vectors towards it is
        longer than this.
    same_place : float
        The part is in the same place if it is nearer than this share of that distance.
    n_neighbours : int
        Number of vertices compared for this.
    n_samples : int
        Points of the scan that are compared with the body.
    farthest_miss : float
        A joint farther from its landmark is wrong, metres.
    least_unseen : float
        Unseen parts are named if they make up a larger share of the surface together.
    guessed_up : float
        If a larger share is not seen, the up direction is a guess.
    leaning : float
        Cosine of 25°: if feet and trunk lean farther from an axis, it is not the up direction.
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
        check_amounts(
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
        check_shares(
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
        check_counts(n_neighbours=self.n_neighbours, n_samples=self.n_samples)
        check_lists(overlap_metres=self.overlap_metres)
        check_cosines(least_bent=self.least_bent, leaning=self.leaning, feet_agree=self.feet_agree)
