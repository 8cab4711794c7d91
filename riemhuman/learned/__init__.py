"""Learned codes: networks that describe a body by a few numbers, and rebuild it from them."""

from riemhuman.learned.intrinsic_extrinsic_codes import IntrinsicExtrinsicCodes
from riemhuman.learned.metric_codes import MetricCodes
from riemhuman.learned.shape_pose_codes import ShapePoseCodes

__all__ = ["IntrinsicExtrinsicCodes", "MetricCodes", "ShapePoseCodes"]


def __dir__() -> list[str]:
    return sorted(__all__)
