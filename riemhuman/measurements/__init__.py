"""Body measurements: girths, lengths, heights, breadths and volumes, and bodies from them."""

from riemhuman.measurements.bodies_from_measurements import ProbableBody, model_from_measurements
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
from riemhuman.measurements.landmarked_bodies import LandmarkedBodies
from riemhuman.measurements.measurement_set import MeasurementSet, open_measurements
from riemhuman.measurements.measuring import BodySizes, Measurements
from riemhuman.measurements.nearest_bodies import NearestBody, nearest_body
from riemhuman.measurements.people import (
    PersonDistance,
    UsualDistances,
    person_distance,
    usual_distances,
)
from riemhuman.measurements.populations import average_adult, percentiles
from riemhuman.measurements.posture import posture_angles
from riemhuman.measurements.predicted_measurements import (
    PredictedMeasurements,
    predict_measurements,
)
from riemhuman.measurements.standard_pose import in_standard_pose, person_in_standard_pose
from riemhuman.measurements.uncertainty import noise_of_measurements, pose_distance
from riemhuman.measurements.visits import VisitComparison, compare_visits
from riemhuman.readable_units import ReadableUnit, readable_gap, readable_unit

__all__ = [
    "Area",
    "BodySizes",
    "Breadth",
    "Depth",
    "Girth",
    "Height",
    "LandmarkedBodies",
    "Length",
    "Mass",
    "Measurement",
    "MeasurementSet",
    "Measurements",
    "NearestBody",
    "PersonDistance",
    "PredictedMeasurements",
    "ProbableBody",
    "ReadableUnit",
    "UsualDistances",
    "VisitComparison",
    "Volume",
    "average_adult",
    "compare_visits",
    "in_standard_pose",
    "measurement_from_dict",
    "model_from_measurements",
    "nearest_body",
    "noise_of_measurements",
    "open_measurements",
    "percentiles",
    "person_distance",
    "person_in_standard_pose",
    "pose_distance",
    "posture_angles",
    "predict_measurements",
    "readable_gap",
    "readable_unit",
    "usual_distances",
]


def __dir__() -> list[str]:
    return sorted(__all__)
