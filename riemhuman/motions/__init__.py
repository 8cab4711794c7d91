"""Motions as points: sequences of bodies, compared, aligned and averaged at any speed."""

from riemhuman.motions.alignment import even_times
from riemhuman.motions.dynamic_time_warping import DynamicTimeWarping
from riemhuman.motions.gram_hankel import GramHankel
from riemhuman.motions.joint_angles import JointAngles
from riemhuman.motions.motion_components import MotionComponents
from riemhuman.motions.motion_geodesic import MotionGeodesic
from riemhuman.motions.motion_mean import MotionMean
from riemhuman.motions.motion_search import MotionSearch
from riemhuman.motions.motion_space import MotionSpace
from riemhuman.motions.rate_dependent_metric import RateDependentMetric
from riemhuman.motions.rate_invariant_metric import RateInvariantMetric
from riemhuman.motions.velocity_time_warping import VelocityTimeWarping
from riemhuman.motions.warp import Warp

__all__ = [
    "DynamicTimeWarping",
    "GramHankel",
    "JointAngles",
    "MotionComponents",
    "MotionGeodesic",
    "MotionMean",
    "MotionSearch",
    "MotionSpace",
    "RateDependentMetric",
    "RateInvariantMetric",
    "VelocityTimeWarping",
    "Warp",
    "even_times",
]


def __dir__() -> list[str]:
    return sorted(__all__)
