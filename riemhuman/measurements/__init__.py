"""Measurements of bodies: girths, lengths, heights, breadths, volumes, and bodies from them."""

from riemhuman.measurements.definitions import (
    Area,
    Breadth,
    Depth,
    Girth,
    Height,
    Length,
    Mass,
    Measurement,
    Volume,
    measurement_from_dict,
)
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.measurements.measuring import MeasuredBodies, Measurements
from riemhuman.measurements.open_body import open_measurements
from riemhuman.measurements.standard_pose import in_standard_pose

__all__ = [
    "Area",
    "Breadth",
    "Depth",
    "Girth",
    "Height",
    "Length",
    "Mass",
    "MeasuredBodies",
    "Measurement",
    "MeasurementSet",
    "Measurements",
    "Volume",
    "in_standard_pose",
    "measurement_from_dict",
    "open_measurements",
]


def __dir__() -> list[str]:
    return sorted(__all__)
