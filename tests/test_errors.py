"""Every refusal is a RiemhumanError, and the built-in error people expect."""

import inspect
import pickle
import warnings

import numpy as np
import pytest
from matplotlib import pyplot

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
    "UnknownNameError": KeyError,
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
    "huge whole number": 10**5000,
    "unequipped space": rh.AlignedSurfaces(sphere_template(), equip=False, scale=None),
}
"""What nobody means, for arguments of any kind."""


def _skeleton(**changes):
    """Return a recording of two joints."""
    arguments = {
        "joint_names": ("hips", "chest"),
        "parents": [-1, 0],
        "offsets": np.ones((2, 3)),
        "rotations": np.tile(np.eye(3), (4, 2, 1, 1)),
        "translations": np.ones((4, 2, 3)),
        "frames_per_second": 30.0,
    }
    return rh.datasets.SkeletonMotion(**arguments | changes)


# More than 60 lines: a line for each door.
def doors():
    """Return functions of one argument each, for which everything in `ODD` is wrong or harmless."""
    template = sphere_template()
    space = rh.AlignedSurfaces(template, scale=None)
    motions = rh.motions.MotionSpace(space, n_times=3)
    points = surfaces(template, 3, rng=1, size=0.1)
    bodies = rh.datasets.load_open_bodies("coarse")
    measurements = rh.measurements.Measurements(bodies.model)
    measures, solve = rh.measurements, rh.solvers.LinearPath(3)
    person = bodies[0], bodies.template.faces
    measured = measurements.measure(bodies.points[:1])
    motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
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
        "joint_motions parents": lambda odd: rh.bodies.joint_motions(
            np.zeros((2, 3)), np.eye(3) + np.zeros((2, 3, 3)), odd, (0, 1)
        ),
        "joint_motions order": lambda odd: rh.bodies.joint_motions(
            np.zeros((2, 3)), np.eye(3) + np.zeros((2, 3, 3)), [-1, 0], odd
        ),
        "joints_between": lambda odd: rh.bodies.joints_between(odd, 0, 1),
        "skin_surface": lambda odd: rh.bodies.skin_surface(
            odd, np.ones((2, 1)), np.zeros((1, 3)), np.eye(3)[None], np.zeros((1, 3))
        ),
        "Bodies template": lambda odd: rh.datasets.Bodies(points, [0] * 3, [0] * 3, odd),
        "Bodies names": lambda odd: rh.datasets.Bodies(
            points, [0] * 3, [0] * 3, template, None, odd, ("pose",)
        ),
        "RegisteredMeshes": rh.datasets.RegisteredMeshes,
        "SkeletonMotion": lambda odd: _skeleton(frames_per_second=odd),
        "SkeletonMotion rotations": lambda odd: _skeleton(rotations=odd),
        "retarget rate": lambda odd: rh.datasets.retarget(_skeleton(), frames_per_second=odd),
        "motion_from_arrays name": lambda odd: rh.datasets.motion_from_arrays(
            np.zeros((2, 24, 3)), np.zeros((2, 3)), 30.0, up="y", name=odd
        ),
        "find_inward_triangles": lambda odd: rh.registration.find_inward_triangles(
            odd, template.faces
        ),
        "register_folder": lambda odd: rh.registration.register_folder(odd, ".", "bodies"),
        "transfer_model": lambda odd: rh.topologies.transfer_model(bodies.model, odd),
        "Scan": rh.registration.Scan,
        "simulated_scan clothing": lambda odd: rh.registration.simulated_scan(
            *person, 0, n_points=10, clothing=odd
        ),
        "simulated_scan view": lambda odd: rh.registration.simulated_scan(
            *person, 0, n_points=10, view=odd
        ),
        "simulated_scan n_points": lambda odd: rh.registration.simulated_scan(
            *person, 0, n_points=odd
        ),
        "nearest_body": lambda odd: measures.nearest_body(
            odd, space.metric, bodies[0], {"stature": 1.7}
        ),
        "open_measurements": measures.open_measurements,
        "ReadableUnit": lambda odd: measures.readable_unit("m").text(odd),
        "benchmark": rh.retrieval.benchmark,
        "format_table": lambda odd: rh.retrieval.format_table("title", odd),
        "format_benchmark": rh.retrieval.format_benchmark,
        "retrieval_table": lambda odd: rh.retrieval.retrieval_table(odd, [0, 0]),
        "pairwise_job": lambda odd: rh.pairwise_job(odd, points, "job"),
        "regress_shape": lambda odd: rh.statistics.regress_shape(odd, [0.0, 1.0, 2.0], points),
        "LearnedMetric": lambda odd: rh.LearnedMetric(odd).fit(points, [0, 0, 1]),
        "KMedoids": lambda odd: rh.statistics.KMedoids(1, n_init=odd).fit(np.zeros((2, 2))),
        "from_laplacian": rh.DeformationBasis.from_laplacian,
        "check_manifold": rh.testing.check_manifold,
        "check_metric": lambda odd: rh.testing.check_metric(odd, points),
        "MetricFields projection": rh.MetricFields(template).projection,
        "NormalFields projection": rh.NormalFields(template).projection,
        "RotationFields projection": rh.RotationFields(template).projection,
        "Interrupted": rh.solvers.Interrupted,
        "AreaProjectionTransform distances": rh.descriptors.AreaProjectionTransform().distances,
        "ShapeDNA of_spectrum": rh.descriptors.ShapeDNA(3).of_spectrum,
        "ModelPoseVectors distances": rh.descriptors.ModelPoseVectors(
            bodies.model, "rotation"
        ).distances,
        "RegistrationSettings poses": lambda odd: rh.registration.RegistrationSettings(poses=odd),
        "RegistrationSettings headings": lambda odd: rh.registration.RegistrationSettings(
            headings=odd
        ),
        "BodySizes": lambda odd: measured[odd],
        "motion index": lambda odd: motion[odd],
        "covector": lambda odd: space.metric.covector(odd, points[0]),
        "median exponent": lambda odd: rh.solvers.GradientDescentMean(max_iter=1).solve(
            rh.VectorSpace((2,)).metric, np.eye(2), exponent=odd
        ),
        "save_glb name": lambda odd: rh.save_glb("p.glb", points, template.faces, name=odd),
        "load_pickled_arrays": lambda odd: rh.io.load_pickled_arrays("missing.pkl", odd),
        "load_arrays": lambda odd: rh.io.load_arrays("missing.npz", odd),
        "save_arrays": lambda odd: rh.io.save_arrays("some.npz", odd),
    }


# More than 60 lines: a few lines for each door.
def doors_of_pictures():
    """Return the doors of plots and of reports, as `doors` does."""
    template = sphere_template()
    faces = template.faces
    points = surfaces(template, 3, rng=1, size=0.1)
    space = rh.AlignedSurfaces(template, scale=None)
    places = np.arange(6.0).reshape(3, 2)
    classes = [0, 1, 2]
    distances = np.abs(np.subtract.outer([0.0, 1.0, 5.0], [0.0, 1.0, 5.0]))
    pca = rh.TangentPCA(rh.VectorSpace((42, 3)), 1).fit(points)
    warp = rh.motions.DynamicTimeWarping(space.metric, centered=True).warp(points, points)
    plots, report = rh.plots, rh.report

    def viewed(**settings):
        return plots.Viewer(faces, {"a": [plots.ViewedBody("a", points[:1], **settings)]})

    def viewer(**settings):
        return plots.Viewer(faces, {"a": [plots.ViewedBody("a", points)]}, **settings)

    return {
        "contributions": lambda odd: plots.contributions(odd, points[0], points[1]),
        "contributions point": lambda odd: plots.contributions(space.metric, points[0], odd),
        "Contributions": lambda odd: plots.Contributions(odd, np.ones(3)),
        "describe_stress": plots.describe_stress,
        "embed": lambda odd: plots.embed(odd, method="mds"),
        "embed bodies": lambda odd: plots.embed(space.metric, odd, method="mds"),
        "embed method": lambda odd: plots.embed(distances, method=odd),
        "per_area": lambda odd: plots.per_area(np.ones(80), odd, faces),
        "per_area faces": lambda odd: plots.per_area(np.ones(80), points[0], odd),
        "plot_body": lambda odd: plots.plot_body(odd, faces),
        "plot_body values": lambda odd: plots.plot_body(points[0], faces, odd, height=9),
        "plot_body color": lambda odd: plots.plot_body(points[0], faces, color=odd, height=9),
        "plot_body view": lambda odd: plots.plot_body(points[0], faces, view=odd, height=9),
        "plot_body ground": lambda odd: plots.plot_body(points[0], faces, ground=odd, height=9),
        "plot_body ax": lambda odd: plots.plot_body(points[0], faces, ax=odd, height=9),
        "plot_confusion": lambda odd: plots.plot_confusion(odd, classes),
        "plot_confusion labels": lambda odd: plots.plot_confusion(distances, odd),
        "plot_confusion names": lambda odd: plots.plot_confusion(distances, classes, odd),
        "plot_difference": lambda odd: plots.plot_difference(points[0], odd, faces),
        "plot_difference names": lambda odd: plots.plot_difference(
            points[0], points[1], faces, names=odd, height=9
        ),
        "plot_embedding": lambda odd: plots.plot_embedding(odd, classes),
        "plot_embedding labels": lambda odd: plots.plot_embedding(places, odd),
        "plot_embedding names": lambda odd: plots.plot_embedding(places, classes, odd),
        "plot_embedding items": lambda odd: plots.plot_embedding(places, classes, item_names=odd),
        "plot_energy": plots.plot_energy,
        "plot_energy lines": lambda odd: plots.plot_energy([2.0, 1.0], lines=odd),
        "plot_match": lambda odd: plots.plot_match(odd, odd),
        "plot_path": lambda odd: plots.plot_path(odd, faces),
        "plot_path labels": lambda odd: plots.plot_path(points, faces, labels=odd, height=9),
        "plot_path height": lambda odd: plots.plot_path(points[:1], faces, height=odd),
        "plot_path largest": lambda odd: plots.plot_path(
            points, faces, points[..., 0], largest=odd, height=9
        ),
        "plot_precision_recall": lambda odd: plots.plot_precision_recall(odd, classes),
        "plot_scan": plots.plot_scan,
        "plot_sweep": lambda odd: plots.plot_sweep(np.ones((1, 2)), odd, ["a", "b"]),
        "plot_sweep weights": lambda odd: plots.plot_sweep(np.ones((1, 2)), [1.0], odd),
        "position_colors": plots.position_colors,
        "render": lambda odd: plots.render(odd, faces),
        "render height": lambda odd: plots.render(points[0], faces, height=odd),
        "render window": lambda odd: plots.render(points[0], faces, window=odd),
        "save_picture": lambda odd: plots.save_picture(odd, points, faces, ["a", "b", "c"]),
        "save_picture names": lambda odd: plots.save_picture("a.html", points[:1], faces, odd),
        "save_picture mean": lambda odd: plots.save_picture(
            "a.html", points[:1], faces, ["a"], mean=odd
        ),
        "stress": lambda odd: plots.stress(odd, places),
        "surfaces_html": lambda odd: plots.surfaces_html(odd, faces, "caption"),
        "surfaces_html faces": lambda odd: plots.surfaces_html(points[:1], odd, "caption"),
        "surfaces_html caption": lambda odd: plots.surfaces_html([], faces, odd),
        "view": lambda odd: plots.view(odd, faces),
        "View": plots.View,
        "view_bodies": lambda odd: plots.view_bodies(odd, faces),
        "view_bodies faces": lambda odd: plots.view_bodies(points, odd),
        "view_bodies names": lambda odd: plots.view_bodies(points, faces, odd),
        "view_bodies title": lambda odd: plots.view_bodies(points, faces, title=odd),
        "view_components": plots.view_components,
        "view_components faces": lambda odd: plots.view_components(pca, odd),
        "view_difference metric": lambda odd: plots.view_difference(
            points[0], points[1], faces, metric=odd
        ),
        "view_map": lambda odd: plots.view_map(odd, classes, points=points, faces=faces),
        "view_map points": lambda odd: plots.view_map(places, classes, points=odd, faces=faces),
        "view_map faces": lambda odd: plots.view_map(places, classes, points=points, faces=odd),
        "view_map note": lambda odd: plots.view_map(
            places, classes, points=points, faces=faces, note=odd
        ),
        "view_measurements": lambda odd: plots.view_measurements(odd, points[0]),
        "view_motions": lambda odd: plots.view_motions(odd, points, warp, faces),
        "view_motions warp": lambda odd: plots.view_motions(points, points, odd, faces),
        "view_motions names": lambda odd: plots.view_motions(points, points, warp, faces, odd),
        "view_path": lambda odd: plots.view_path(odd, faces),
        "view_path seconds": lambda odd: plots.view_path(points, faces, seconds=odd),
        "view_path side": lambda odd: plots.view_path(points, faces, side_by_side=odd),
        "view_scan": lambda odd: plots.view_scan(odd, points[0], faces),
        "view_scan system": lambda odd: plots.view_scan(points[0], points[0], faces, system=odd),
        "ViewedBody": lambda odd: plots.ViewedBody("a", odd),
        "ViewedBody label": lambda odd: plots.ViewedBody(odd, points),
        "ViewedBody color": lambda odd: viewed(color=odd),
        "ViewedBody values": lambda odd: viewed(values=odd),
        "ViewedBody value_limit": lambda odd: viewed(values=np.ones(42), value_limit=odd),
        "ViewedBody times": lambda odd: viewed(times=odd),
        "ViewedBody components": lambda odd: viewed(components=odd),
        "Viewer": lambda odd: plots.Viewer(odd, {"a": [plots.ViewedBody("a", points)]}),
        "Viewer choices": lambda odd: plots.Viewer(faces, odd),
        "Viewer bodies": lambda odd: plots.Viewer(faces, {"a": odd}),
        "Viewer legend": lambda odd: viewer(legend=odd),
        "Viewer rate": lambda odd: viewer(frames_per_second=odd),
        "Viewer parts": lambda odd: viewer(parts=odd),
        "Viewer panel": lambda odd: viewer(panel=odd),
        "Viewer.fragment": viewer().fragment,
        "Viewer.save": lambda odd: viewer().save(odd),
        "make_report bodies": lambda odd: report.make_report("report", bodies="x", basis=odd),
        "make_report quick": lambda odd: report.make_report("r", bodies="x", quick=odd),
        "make_sheets": lambda odd: report.make_sheets(odd, "sheets"),
        "make_sheets progress": lambda odd: report.make_sheets("a", "sheets", progress=odd),
        "scan_page": report.scan_page,
        "sheet": report.sheet,
        "sheet name": lambda odd: report.sheet(points[0], name=odd),
        "sheet units": lambda odd: report.sheet(points[0], units=odd),
    }


def test_odd_arguments_are_refused_with_a_typed_error(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    surprises = {}
    for name, door in (doors() | doors_of_pictures()).items():
        for label, odd in ODD.items():
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error", RuntimeWarning)
                    door(odd)
            except errors.RiemhumanError:
                continue
            except Exception as error:  # noqa: BLE001
                surprises[name, label] = repr(error)
            finally:
                pyplot.close("all")
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


def test_a_motion_without_frames_says_what_to_define():
    motion = rh.datasets.Motion("anna", "walk", 30.0, 3, [[0, 1, 2]])
    with pytest.raises(errors.NotDefinedError, match="must define _frames"):
        motion[0]


PARENTS = {
    "a cycle": [1, 0],
    "its own parent": [-1, 1],
    "a parent that is missing": [-1, 5],
    "no root": [1, 0],
    "no joint": [],
    "fractions": [-1, 0.5],
}


@pytest.mark.parametrize("parents", PARENTS.values(), ids=PARENTS)
def test_joints_that_are_no_tree_are_refused(parents):
    still = np.tile(np.eye(3), (2, 1, 1))
    for door in (
        lambda: rh.bodies.joints_between(parents, 0, 1),
        lambda: rh.bodies.joint_motions(np.zeros((2, 3)), still, parents, (0, 1)),
        lambda: _skeleton(parents=parents),
    ):
        with pytest.raises(errors.RiemhumanError, match="parents"):
            door()


def test_children_come_after_their_parents_and_paths_stay_below_one_root():
    with pytest.raises(errors.ArgumentError, match="come before their children; found 2"):
        _skeleton(joint_names=("a", "b", "c"), parents=[-1, 2, 0])
    with pytest.raises(errors.ArgumentError, match="below the same root; found 0, below 0"):
        rh.bodies.joints_between([-1, -1], 0, 1)
    joints = np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1))
    with pytest.raises(errors.ArgumentError, match="order must hold each of the 2 joints once"):
        rh.bodies.joint_motions(*joints, [-1, 0], (1, 0))


@pytest.mark.parametrize("count", [10**9, 10**400, float("inf"), float("nan"), True])
def test_absurd_counts_are_refused(count):
    template = sphere_template()
    points = surfaces(template, 3, rng=1, size=0.1)
    space = rh.AlignedSurfaces(template, scale=None)
    for door in (
        lambda: rh.statistics.KMedoids(1, n_init=count).fit(np.zeros((2, 2))),
        lambda: rh.statistics.KMedoids(count).fit(np.eye(3)[:, ::-1]),
        lambda: rh.statistics.two_sample_test(np.zeros((2, 2)), [0, 1], n_permutations=count),
        lambda: rh.solvers.LinearPath(count),
        lambda: rh.solvers.PoleLadder(count),
        lambda: rh.solvers.DiscreteExponential(n_doublings=count),
        lambda: rh.motions.MotionSpace(space, n_times=count),
        lambda: rh.DeformationBasis.from_laplacian(template, count),
        lambda: rh.NearestNeighbors(space.metric, count).fit(points).kneighbors(points),
        lambda: rh.registration.simulated_scan(points[0], template.faces, n_points=count),
        lambda: rh.registration.RegistrationSettings(n_headings=count),
    ):
        with pytest.raises(errors.RiemhumanError, match="must be|exceeds|at most"):
            door()


@pytest.mark.parametrize("count", [10**400, float("inf"), float("nan"), True, 0])
def test_absurd_sizes_of_samples_are_refused(count):
    for space in (rh.AlignedSurfaces(sphere_template()), rh.VectorSpace((2,))):
        for draw in (space.random_point, space.random_tangent_vec):
            with pytest.raises(errors.RiemhumanError, match="must be a whole number"):
                draw(n_samples=count)


def test_samples_beyond_all_memory_are_refused():
    space = rh.VectorSpace((2,))
    for draw in (space.random_point, space.random_tangent_vec):
        with pytest.raises(errors.OutOfMemoryError, match="a sample of 1,000,.* arrays needs"):
            draw(n_samples=10**18)


@pytest.mark.parametrize("size", [1e40, 1e100, 1e155, 1e-155, 5e-324])
def test_no_surface_overflows_or_vanishes_in_silence(size):
    """Doors that take surfaces refuse a size, or give finite results, without a warning."""
    template = sphere_template()
    points = surfaces(template, 4, rng=1, size=0.1)
    odd, faces = size * points, template.faces
    space = rh.AlignedSurfaces(template, equip=False, scale=None)
    metric, path = rh.ElasticMetric(space, 1.0, 1.0, 0.1), rh.solvers.LinearPath(3)
    basis = rh.DeformationBasis.from_laplacian(template, 6)
    vectors = 0.01 * points
    for door in (
        lambda: rh.surfaces.triangle_areas(odd, faces),
        lambda: rh.surfaces.edge_lengths(odd, template.edges),
        lambda: rh.surfaces.signed_volume(odd, faces),
        lambda: rh.surfaces.nearest_points(points[0], odd[0], faces)[1],
        lambda: rh.surfaces.nearest_points(odd[0], points[0], faces)[1],
        lambda: rh.registration.find_inward_triangles(odd[0], faces),
        lambda: rh.solvers.inverted_triangles(odd[0], odd, faces),
        lambda: metric.dist(odd[0], odd[1]),
        lambda: metric.dist_pairwise(odd),
        lambda: metric.energy(odd),
        lambda: metric.inner_product(odd[0], vectors[0], points[0]),
        lambda: rh.AreaMetric(space).squared_norm(odd[0], points[0]),
        lambda: rh.RotationMetric(space).squared_norm(odd[0], points[0]),
        lambda: path.solve(metric, odd[0], points[1]).energy,
        lambda: (
            rh.solvers.DiscreteExponential(basis, 2, max_iter=2)
            .solve(metric, odd[0], points[0])
            .path
        ),
        lambda: rh.bodies.rotation_derivative(odd),
        lambda: rh.NormalFields(template).projection(np.ones((template.n_faces, 3)) * size),
    ):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rh.ConvergenceWarning)
            warnings.simplefilter("error", RuntimeWarning)
            try:
                assert np.isfinite(door()).all()
            except errors.RiemhumanError:
                continue


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
