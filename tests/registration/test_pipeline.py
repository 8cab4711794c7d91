"""Whole registrations: scans as scanners make them, people with flesh, unusual poses."""

import re

import numpy as np
import pytest
from scanned_people import bun, result_of_one_search, settings_with, sparse_floor, with_inward_arms
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.datasets import joint_rotations, pose_vectors
from riemhuman.datasets.open_bodies import surface_noise
from riemhuman.registration import ScanRegistration, simulated_scan
from riemhuman.registration._pipeline import upright_transform
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._verdict import _other_units
from riemhuman.registration.registered_scans import apply_transform
from riemhuman.registration.scans import as_scan
from riemhuman.surfaces.measures import find_inward_triangles

HAND_ON_EAR = 6
FAR = 0.03


@pytest.fixture(scope="module")
def natural_bodies():
    return rh.datasets.load_open_bodies("coarse", variant="natural", people=777)


def scan_of(natural_bodies, number):
    faces = natural_bodies.template.faces
    return simulated_scan(natural_bodies[number], faces, number, n_points=12_000, missing=0.1)


def error(result, scan):
    return np.linalg.norm(result.points - scan.body, axis=1).mean()


@pytest.mark.slow
def test_a_hand_on_the_ear(model, natural_bodies):
    """No start pose has one hand on the ear and the other arm hanging: arms are tried alone."""
    settings = settings_with(poses=("a", "down", "head", "elbows"))
    registration = ScanRegistration(model, up="y", settings=settings)
    scan = scan_of(natural_bodies, HAND_ON_EAR)
    result = registration.solve(scan.points)
    assert result.trusted, result.message
    assert error(result, scan) < 0.01
    assert np.linalg.norm(result.points - scan.body, axis=1).max() < 0.05


@pytest.mark.slow
def test_a_wrong_arm_is_not_trusted(registration_from, natural_bodies):
    """From one start pose alone, an arm is not found, and missed."""
    scan = scan_of(natural_bodies, HAND_ON_EAR)
    result = result_of_one_search(registration_from("squat"), scan.points)
    assert error(result, scan) > FAR
    assert not result.trusted
    assert re.search("hardly any of it matches the right (forearm|hand)", result.message)


@pytest.mark.slow
def test_landmarks_bring_the_arm_where_it_is(model, natural_bodies):
    registration = ScanRegistration(model, up="y", settings=settings_with(tries_arms=False))
    scan = scan_of(natural_bodies, HAND_ON_EAR)
    joints = registration.model.joint_regressor @ scan.body
    names = list(registration.model.joint_names)
    known = {name: joints[names.index(name)] for name in ("left_elbow", "left_wrist")}
    result = registration.solve(scan.points, landmarks=known)
    assert result.trusted, result.message
    assert error(result, scan) < 0.02


# People who jump, kick, kneel, sit on the floor, crawl or lie are found without a hint.

POSES = {
    "jump": {"hip": ["x", -15], "knee": ["x", 115], "shoulder": ["z", 25]},
    "side kick": {"right_hip": ["z", -80], "elbow": ["y", -90], "shoulder": ["z", -60]},
    "sit on heels": {"hip": ["x", -80], "knee": ["x", 145], "shoulder": ["xz", -30, -70]},
    "cross-legged": {"hip": ["yxy", 60, -80, 30], "knee": ["x", 115], "shoulder": ["z", -60]},
    "crawl": {
        "pelvis": ["x", 85],
        "hip": ["x", -85],
        "knee": ["x", 90],
        "shoulder": ["y", -85],
        "neck": ["x", -30],
    },
    "lie on the back": {"pelvis": ["x", -90], "shoulder": ["z", -60], "hip": ["z", 10]},
}


def someone(name, model, rng):
    """Return a body whose joints differ from those of a pose, with details of its own."""
    vectors = pose_vectors(joint_rotations(POSES[name], model)[None], model)[0]
    joints = [joint.split("_")[-1] for joint in model.joint_names]
    limbs = np.isin(joints, ["shoulder", "elbow", "hip", "knee"])
    degrees = np.where(limbs, 10.0, 4.0) * (model.parents >= 0)
    vectors = vectors + np.radians(degrees)[:, np.newaxis] * rng.standard_normal(vectors.shape)
    betas = np.zeros(model.n_betas)
    betas[:10] = np.clip(rng.standard_normal(10), -2.0, 2.0)
    return model(betas, vectors) + surface_noise(model.template.vertices, 0.0015, (0.1, 0.4), rng)


@pytest.mark.slow
@pytest.mark.parametrize("name", POSES)
def test_unusual_poses_are_found(registration, model, name):
    rng = np.random.default_rng([31, list(POSES).index(name)])
    body = someone(name, model, rng)
    scan = simulated_scan(body, model.faces, rng, n_points=6000, missing=0.05)
    result = registration.solve(scan.points)
    assert result.trusted, result.message
    assert result.trusted_vertices.mean() > 0.85
    assert np.linalg.norm(result.points - scan.body, axis=1).mean() < 0.015


# Scans as scanners make them: inward parts, sparse floors, outliers; bodies written upright.


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse")


@pytest.fixture(scope="module")
def registration_from_t(registration_from):
    return registration_from("t")


@pytest.fixture(scope="module")
def inverted_arms(bodies):
    """Return a scan in three parts, whose forearms face inward, and these triangles."""
    scan = simulated_scan(bodies[17], bodies.template.faces, rng=17, n_points=8000, mesh=True)
    return scan, *with_inward_arms(bodies.model, scan)


def test_parts_that_face_inward_are_found(inverted_arms):
    scan, faces, inward = inverted_arms
    assert np.mean(find_inward_triangles(scan.points, faces) == inward) > 0.99
    assert np.mean(find_inward_triangles(scan.points, faces[:, ::-1]) == ~inward) > 0.99


def test_an_arm_of_a_whole_mesh_that_faces_inward_is_found(bodies):
    faces = bodies.template.faces
    inward = with_inward_arm(bodies.model, faces)
    turned = np.where(inward[:, np.newaxis], faces[:, ::-1], faces)
    for points in bodies.points[:40:7]:
        np.testing.assert_array_equal(find_inward_triangles(points, turned), inward)


def with_inward_arm(model, faces):
    joints = [model.joint_names.index(f"left_{name}") for name in ("elbow", "wrist")]
    below = model.weights[:, joints]
    return (below.sum(axis=1) > 0.5)[faces].all(axis=1)


def test_large_triangles_are_matched_too(bodies):
    """As those that close the soles, of which only the vertices once were."""
    centres = bodies[0][bodies.template.faces].mean(axis=1)
    prepared = prepare_scan(as_scan((bodies[0], bodies.template.faces)))
    assert cKDTree(prepared.points).query(centres)[0].max() < 0.03  # of edges below 5 cm


def test_bodies_stand_on_the_floor_that_hides_their_soles(bodies):
    scan = simulated_scan(bodies[0], bodies.template.faces, rng=0, floor=True, rotate=False)
    prepared, low = prepare_scan(as_scan(scan.points)), scan.body[:, 1].min()
    sunken = scan.body - [0.0, 0.01, 0.0]
    gaps, normals, weights, *_ = prepared.match(sunken, np.zeros_like(sunken), 0.01)
    below = sunken[:, 1] < low - 0.003
    np.testing.assert_allclose(sunken[below, 1] + gaps[below, 1], low, atol=0.002)
    np.testing.assert_allclose(normals[below] @ [0.0, 1.0, 0.0], 1.0, atol=1e-3)
    assert np.all(weights[below] == 1.0)


def test_upright_bodies_face_the_viewer_and_stand_on_the_ground():
    turn = Rotation.from_euler("yx", [40.0, 10.0], degrees=True).as_matrix()
    points = np.random.default_rng(0).normal(size=(50, 3)) + [3.0, -1.0, 2.0]
    transform = upright_transform(points, turn, turn[:, 1])
    np.testing.assert_allclose(transform[:3, :3] @ turn, np.eye(3), atol=1e-12)
    moved = apply_transform(transform, points)
    assert abs(moved[:, 1].min()) < 1e-12
    np.testing.assert_allclose((moved.min(axis=0) + moved.max(axis=0))[[0, 2]], 0.0, atol=1e-12)
    # Of someone who lies on one side, the left says nothing of where they look.
    on_one_side = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    transform = upright_transform(points, on_one_side, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(transform[:3, :3], np.eye(3), atol=1e-12)


@pytest.fixture(scope="module")
def squat(bodies):
    """Return a scan of a squatting body with a bun, remnants of a floor and a far point; z is up.

    Returns the scan, the rotation of its axes, its points, and numbers of those of floor and bun.
    """
    scan = simulated_scan(bodies[9], bodies.template.faces, rng=1, n_points=8000, rotate=False)
    rng = np.random.default_rng(3)
    floor, hair = sparse_floor(scan, rng), bun(bodies.model, scan, rng)
    rotation = Rotation.from_euler("yx", [70.0, 90.0], degrees=True).as_matrix()
    points = np.concatenate([scan.points, floor, hair, [[1000.0, 0.0, 0.0]]])
    ends = len(scan.points) + np.cumsum([0, len(floor), len(hair)])
    return (
        scan,
        rotation,
        points @ rotation.T + [3.0, 2.0, 1.0],
        slice(*ends[:2]),
        slice(*ends[1:]),
    )


@pytest.fixture(scope="module")
def result(registration_from, squat):
    return registration_from("squat", up="z").solve(squat[2])


@pytest.mark.slow
def test_floors_buns_and_far_points_are_background(result, bodies, squat):
    scan, rotation, points, floor, bun = squat
    assert result.trusted, result.message
    assert result.background[-1]
    assert result.background[floor].mean() > 0.85
    body = scan.body @ rotation.T + [3.0, 2.0, 1.0]
    far = cKDTree(body).query(points[bun])[0] > 0.04
    assert result.background[bun][far].mean() > 0.95
    assert result.background[: len(scan.points)].mean() < 0.002
    head = bodies.model.weights.argmax(axis=1) == bodies.model.joint_names.index("head")
    assert np.linalg.norm(result.points - body, axis=1)[head].mean() < 0.01


@pytest.mark.slow
def test_bodies_are_moved_to_stand_upright_and_face_the_viewer(result, squat):
    moved = result.points @ result.transform[:3, :3].T + result.transform[:3, 3]
    np.testing.assert_allclose(result.upright_points, moved, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(result.transform[:3, :3]), 1.0)
    assert abs(moved[:, 1].min()) < 1e-9
    # The open bodies face z within a few degrees, also this one, which bends forward.
    body = squat[0].body - 0.5 * (squat[0].body.min(axis=0) + squat[0].body.max(axis=0))
    body[:, 1] -= body[:, 1].min()
    assert np.linalg.norm(moved - body, axis=1).mean() < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("upper", [False, True])
def test_the_unseen_half_of_a_body_is_not_trusted(registration_from_t, bodies, upper):
    scan = simulated_scan(bodies[0], bodies.template.faces, rng=0, n_points=4000, rotate=False)
    hip = (bodies.model.joint_regressor @ scan.body)[0, 1]
    points = scan.points[(scan.points[:, 1] > hip) == upper]
    result = registration_from_t.solve(points)
    above = (scan.body[:, 1] - hip) * (1.0 if upper else -1.0)
    assert result.trusted, result.message
    assert result.trusted_vertices[above < -0.15].mean() < 0.05
    assert result.trusted_vertices[above > 0.0].mean() > 0.9
    errors = np.linalg.norm(result.points - scan.body, axis=1)
    assert errors[result.trusted_vertices].mean() < 0.012
    part = "legs" if upper else "trunk|chest|arms"
    assert re.search(rf"the .*({part}).* were not seen \(\d+ % of the body\)", result.message)


@pytest.mark.slow
def test_a_body_that_is_cut_at_the_waist_is_not_stretched(registration_from_t):
    """The whole body fits this scan with its legs in the trunk, whose vertices are 4 cm off."""
    bodies = rh.datasets.load_open_bodies("coarse", variant="natural", people=71)
    scan = simulated_scan(bodies[30], bodies.template.faces, rng=0, n_points=10000)
    hip = (bodies.model.joint_regressor @ scan.body)[0, 1]
    result = registration_from_t.solve(scan.points[scan.points[:, 1] > hip + 0.15])
    errors = np.linalg.norm(result.points - scan.body, axis=1)
    assert result.trusted, result.message
    assert errors[result.trusted_vertices].mean() < 0.012


def test_a_missing_arm_is_not_trusted(registration_from, natural_bodies):
    """It is fitted to the trunk, where the scan has points."""
    bodies = natural_bodies
    scan = simulated_scan(bodies[3], bodies.template.faces, rng=3, n_points=4000, rotate=False)
    names, owners = bodies.model.joint_names, bodies.model.weights.argmax(axis=1)
    arm = [names.index(f"left_{joint}") for joint in ("shoulder", "elbow", "wrist")]
    on_arm = np.isin(owners, arm)
    points = scan.points[~on_arm[cKDTree(scan.body).query(scan.points)[1]]]
    result = registration_from("forward").solve(points)
    assert result.trusted, result.message
    assert not result.trusted_vertices[on_arm].any()
    assert result.trusted_vertices[~on_arm].mean() > 0.95
    assert "the left arm was not seen" in result.message


def test_a_scan_in_inches_is_refused_for_its_unit(bodies):
    scan = as_scan(39.37 * bodies[0])
    assert scan.unit == "centimetres"
    (said,) = _other_units(scan, np.zeros(len(scan), dtype=bool))
    assert "may be in inches" in said
    assert not _other_units(as_scan(bodies[0]), np.zeros(len(scan), dtype=bool))


def test_impossible_points_are_named(registration_from_t, bodies):
    points = np.concatenate([bodies[0], [[0.0, 1e50, 0.0]]])
    with pytest.raises(rh.errors.ArgumentError, match=r"point 1202 is 1e\+50 away from a scan"):
        registration_from_t.solve(points)


def test_landmarks_are_a_mapping_to_places_in_the_scan(registration_from_t, bodies):
    with pytest.raises(rh.errors.ArgumentError, match=r"left_wrist'\] must lie in the scan"):
        registration_from_t.solve(bodies[0], landmarks={"left_wrist": [0.0, 1e100, 0.0]})
    with pytest.raises(rh.errors.ArgumentTypeError, match="must be a mapping of joints"):
        registration_from_t.solve(bodies[0], landmarks=[[0.0, 1.0, 0.0]])


def test_mesh_objects_are_scans(bodies):
    scan = as_scan(rh.io.to_trimesh(bodies[0], bodies.template.faces))
    np.testing.assert_array_equal(scan.points, bodies[0])
    np.testing.assert_array_equal(scan.faces, bodies.template.faces)


@pytest.mark.slow
def test_bodies_in_leaning_scans_stand_on_their_feet(bodies, registration_from):
    scan = simulated_scan(bodies[0], bodies.template.faces, rng=1, n_points=5000, rotate=False)
    leaning = Rotation.from_euler("xyz", [70.0, 110.0, 25.0], degrees=True).as_matrix()
    result = registration_from("t", "squat", up=None).solve(scan.points @ leaning.T)
    assert result.trusted, result.message
    np.testing.assert_allclose(leaning.T @ result.up, [0.0, 1.0, 0.0], atol=0.2)
