"""Body measurements: girths, lengths, heights, breadths and volumes, and bodies from them."""

from riemhuman.measurements.comparison import VisitComparison, compare_visits, noise_of_poses
from riemhuman.measurements.definitions import measurement_from_dict
from riemhuman.measurements.inverse import MeasuredPerson, model_from_measurements
from riemhuman.measurements.length_measurements import Height, Length
from riemhuman.measurements.measurement import Measurement
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.measurements.measuring import MeasuredBodies, Measurements
from riemhuman.measurements.nearest_body import NearestBody, nearest_body
from riemhuman.measurements.open_body import open_measurements
from riemhuman.measurements.regression import ShapeRegression, regress_shape
from riemhuman.measurements.section_measurements import Breadth, Depth, Girth
from riemhuman.measurements.standard_pose import in_standard_pose
from riemhuman.measurements.volume_measurements import Area, Mass, Volume

__all__ = [
    "Area",
    "Breadth",
    "Depth",
    "Girth",
    "Height",
    "Length",
    "Mass",
    "MeasuredBodies",
    "MeasuredPerson",
    "Measurement",
    "MeasurementSet",
    "Measurements",
    "NearestBody",
    "ShapeRegression",
    "VisitComparison",
    "Volume",
    "compare_visits",
    "in_standard_pose",
    "measurement_from_dict",
    "model_from_measurements",
    "nearest_body",
    "noise_of_poses",
    "open_measurements",
    "regress_shape",
]


def __dir__() -> list[str]:
    return sorted(__all__)
