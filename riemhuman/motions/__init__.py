"""Motions as points: sequences of bodies, compared, aligned and averaged at any speed.

`DynamicTimeWarping` matches frames of two motions at any speed; `VelocityTimeWarping` also
recognises motions with few frames; `RateInvariantMetric` satisfies the triangle inequality.
"""

from riemhuman.motions.joint_metric import JointMetric
from riemhuman.motions.motion_descriptor import MotionDescriptor
from riemhuman.motions.motion_representations import compare_representations
from riemhuman.motions.motion_search import MotionSearch
from riemhuman.motions.motion_space import MotionSpace, RateDependentMetric
from riemhuman.motions.motion_statistics import (
    MotionComponents,
    MotionGeodesic,
    MotionMean,
    align_motions,
)
from riemhuman.motions.rate_invariant_metric import RateInvariantMetric
from riemhuman.motions.time_warping import DynamicTimeWarping, VelocityTimeWarping, Warp

__all__ = [
    "DynamicTimeWarping",
    "JointMetric",
    "MotionComponents",
    "MotionDescriptor",
    "MotionGeodesic",
    "MotionMean",
    "MotionSearch",
    "MotionSpace",
    "RateDependentMetric",
    "RateInvariantMetric",
    "VelocityTimeWarping",
    "Warp",
    "align_motions",
    "compare_representations",
]


def __dir__() -> list[str]:
    return sorted(__all__)
