"""Every refusal is a RiemhumanError, and the built-in error people expect."""

import inspect
import pickle
import warnings

import numpy as np
import pytest

import riemhuman
import riemhuman as rh
from riemhuman import errors
from tests.support.cases import sphere_template, surfaces

EXPECTED = {
    "ArgumentError": ValueError,
    "ArgumentTypeError": TypeError,
    "DegenerateSurfaceError": ValueError,
    "NotDefinedError": NotImplementedError,
    "OutsideManifoldError": ValueError,
    "FrameIndexError": IndexError,
    "FileError": OSError,
    "FileFormatError": ValueError,
    "OutOfMemoryError": MemoryError,
    "MissingDependencyError": ImportError,
    "ClusterError": RuntimeError,
}


@pytest.mark.parametrize(("name", "built_in"), EXPECTED.items())
def test_errors_are_what_people_expect(name, built_in):
    error = getattr(errors, name)
    assert issubclass(error, errors.RiemhumanError)
    assert issubclass(error, built_in)


def test_none_is_forgotten():
    classes = {
        name
        for name, member in inspect.getmembers(errors, inspect.isclass)
        if issubclass(member, errors.RiemhumanError) and member is not errors.RiemhumanError
    }
    assert classes == set(EXPECTED)
    assert issubclass(errors.DegenerateSurfaceError, errors.ArgumentError)
    assert riemhuman.RiemhumanError is errors.RiemhumanError


def test_a_warning_reaches_code_that_runs_without_a_module():
    bare = {"warn": errors.warn, "category": errors.ConvergenceWarning}
    with pytest.warns(errors.ConvergenceWarning, match="slow") as caught:
        exec(compile("warn('slow', category)", "cell.py", "exec"), bare)
    assert caught[0].filename == "cell.py"


def test_a_lack_of_memory_travels_between_workers():
    """Dask sends errors by tblib, which makes them again without their arguments."""
    support = pytest.importorskip("tblib.pickling_support")
    support.install(errors.OutOfMemoryError)
    again = pickle.loads(pickle.dumps(errors.OutOfMemoryError("too short", "a mean", "use less")))
    assert (str(again), again.need, again.remedy) == ("too short", "a mean", "use less")


ODD = {
    "None": None,
    "text": "x",
    "bytes": b"x",
    "negative": -1,
    "large": 1e300,
    "NaN": float("nan"),
    "complex": 1j,
    "object": object(),
    "class": int,
    "ragged": [[1], [1, 2]],
    "mapping": {"a": 1},
    "no dimension": np.array(1.0),
    "matrix": np.zeros((2, 2)),
    "texts": np.array(["a", "b"]),
    "moments": np.zeros(2, "datetime64[s]"),
    "records": np.zeros(2, [("a", "f8")]),
    "huge whole numbers": [10**400, 1],
    "unequipped space": rh.AlignedSurfaces(sphere_template(), equip=False, scale=None),
}
"""What nobody means, for arguments of any kind."""


def doors():
    """Return functions of one argument each, for which everything in `ODD` is wrong or harmless."""
    template = sphere_template()
    space = rh.AlignedSurfaces(template, scale=None)
    motions = rh.motions.MotionSpace(space, n_times=3)
    points = surfaces(template, 3, rng=1, size=0.1)
    bodies = rh.datasets.load_open_bodies("coarse")
    measurements = rh.measurements.Measurements(bodies.model)
    measures, solve = rh.measurements, rh.solvers.LinearPath(3)
    return {
        "AreaMetric": rh.AreaMetric,
        "RotationMetric": rh.RotationMetric,
        "SobolevMetric": rh.SobolevMetric,
        "MetricFields": rh.MetricFields,
        "MetricFields equip": lambda odd: rh.MetricFields(template, odd),
        "ProductManifold": rh.ProductManifold,
        "VectorSpace": rh.VectorSpace,
        "FlatMetric": rh.FlatMetric,
        "DeformationBasis": lambda odd: rh.DeformationBasis(points[:1], orthonormalize=odd),
        "MotionSpace": rh.motions.MotionSpace,
        "RateDependentMetric": lambda odd: rh.motions.RateDependentMetric(motions, odd),
        "RateInvariantMetric": lambda odd: rh.motions.RateInvariantMetric(motions, odd),
        "DynamicTimeWarping": rh.motions.DynamicTimeWarping,
        "MotionMean": lambda odd: rh.motions.MotionMean(motions, alignment=odd),
        "align_motions space": lambda odd: rh.motions.align_motions(odd, points, points),
        "align_motions m1": lambda odd: rh.motions.align_motions(motions, odd, points),
        "align_motions alignment": lambda odd: rh.motions.align_motions(
            motions, points[:1], points, odd
        ),
        "procrustes scale": lambda odd: rh.procrustes(points, points[0], scale=odd),
        "procrustes weights": lambda odd: rh.procrustes(points, points[0], weights=odd),
        "check_solver": lambda odd: rh.testing.check_solver(solve, odd, points),
        "path_job": lambda odd: rh.path_job(solve, odd, points, "job"),
        "NearestNeighbors": lambda odd: rh.NearestNeighbors(odd).fit(points),
        "NearestNeighbors X": rh.NearestNeighbors(space.metric, 2).fit,
        "correspondence_matrix": rh.bodies.correspondence_matrix,
        "joint_rotations": lambda odd: rh.datasets.joint_rotations(odd, bodies.model),
        "joint_rotations model": lambda odd: rh.datasets.joint_rotations({}, odd),
        "pose_vectors": lambda odd: rh.datasets.pose_vectors(np.eye(3), odd),
        "Motions": rh.datasets.Motions,
        "ArrayMotion names": lambda odd: rh.datasets.ArrayMotion(
            odd, 30.0, bodies.model, bodies.betas[0], bodies.pose_vectors[:2], np.zeros((2, 3))
        ),
        "Girth": lambda odd: measures.Girth(name="n", at="a", parts=odd),
        "Length": lambda odd: measures.Length(name="n", along=odd),
        "MeasurementSet": lambda odd: measures.MeasurementSet(odd, ()),
        "MeasurementSet measurements": lambda odd: measures.MeasurementSet(template, odd),
        "MeasurementSet landmarks": lambda odd: measures.MeasurementSet(template, (), odd),
        "MeasurementSet parts": lambda odd: measures.MeasurementSet(template, (), {}, odd),
        "posture_angles": lambda odd: measures.posture_angles(odd, bodies[0]),
        "posture_angles points": lambda odd: measures.posture_angles(measurements, odd),
        "posture_angles trust": lambda odd: measures.posture_angles(
            measurements, bodies[0], trusted_vertices=odd
        ),
        "in_standard_pose": lambda odd: measures.in_standard_pose(odd, bodies[0]),
        "in_standard_pose points": lambda odd: measures.in_standard_pose(
            measurements.definitions, odd
        ),
        "compare_visits": lambda odd: measures.compare_visits(odd, bodies[0], bodies[0]),
        "noise_of_measurements": measures.noise_of_measurements,
        "predict_measurements": lambda odd: measures.predict_measurements(
            {"stature": 1.7}, tolerances={"stature": odd}
        ),
        "readable_gap": measures.readable_gap,
        "usual_distances": measures.usual_distances,
        "load_arrays": lambda odd: rh.io.load_arrays("missing.npz", odd),
        "save_arrays": lambda odd: rh.io.save_arrays("some.npz", odd),
    }


def test_odd_arguments_are_refused_with_a_typed_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    surprises = {}
    for name, door in doors().items():
        for label, odd in ODD.items():
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error", RuntimeWarning)
                    door(odd)
            except errors.RiemhumanError:
                continue
            except Exception as error:  # noqa: BLE001
                surprises[name, label] = repr(error)
    assert not surprises


@pytest.mark.parametrize("shape", [(0,), (0, 3), (0, 42, 3), (2, 0, 3)])
def test_there_is_nothing_to_view_of_no_bodies(shape):
    faces = sphere_template().faces
    for door in (rh.view, rh.plots.view_bodies):
        with pytest.raises(errors.RiemhumanError, match="points"):
            door(np.zeros(shape), faces)
        for none in ([], ()):
            with pytest.raises(errors.ArgumentError, match="points must hold at least one mesh"):
                door(none)


@pytest.mark.parametrize("size", [1e155, 1e300])
def test_bodies_too_large_to_compute_with_are_refused(size):
    bodies = rh.datasets.load_open_bodies("coarse")
    measurements = rh.measurements.Measurements(bodies.model)
    huge = size * bodies[0]
    for door in (
        measurements.measure,
        lambda points: rh.measurements.posture_angles(measurements, points),
        lambda points: rh.measurements.in_standard_pose(measurements.definitions, points),
        lambda points: rh.bodies.fit_model(bodies.model, points),
        lambda points: rh.procrustes(points, bodies[0]),
        lambda points: rh.generalized_procrustes([points, points]),
    ):
        with pytest.raises(errors.ArgumentError, match="points must have coordinates between"):
            door(huge)
