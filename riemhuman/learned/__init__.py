"""Learned codes: vectors that describe a body, by trained networks or fitted to a metric."""

from riemhuman.learned.intrinsic_extrinsic_codes import IntrinsicExtrinsicCodes
from riemhuman.learned.metric_codes import MetricCodes
from riemhuman.learned.shape_pose_codes import ShapePoseCodes

__all__ = ["IntrinsicExtrinsicCodes", "MetricCodes", "ShapePoseCodes"]


def __dir__() -> list[str]:
    return sorted(__all__)
