"""What a scan shows is judged by area and the spacing of its points, not by their number."""

import numpy as np
import pytest
from scanned_people import sparse_floor
from scipy.spatial import cKDTree

import riemhuman as rh
from riemhuman.registration import simulated_scan
from riemhuman.registration._scan_preparation import estimate_normals, prepare_scan
from riemhuman.registration.scans import as_scan
from riemhuman.registration.settings import PreparationSettings
from riemhuman.surfaces.measures import triangle_areas


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse", variant="natural", people=909)


@pytest.fixture(scope="module")
def full():
    return rh.datasets.load_open_bodies("full", variant="natural", people=909)


def uneven_cloud(points, model, rng, n_points):
    """Return points of a body, twenty times as dense on its head and hands as elsewhere."""
    owners = model.weights.argmax(axis=1)
    dense = [k for k, name in enumerate(model.joint_names) if name.endswith(("head", "wrist"))]
    density = np.where(np.isin(owners, dense), 20.0, 1.0)[model.faces].mean(axis=1)
    shares = density * triangle_areas(points, model.faces)
    chosen = rng.choice(len(shares), n_points, p=shares / shares.sum())
    places = rng.dirichlet(np.ones(3), n_points)
    return np.einsum("nk,nkx->nx", places, points[model.faces[chosen]])


def clouds(full, bodies):
    """Yield names and clouds of one body whose spacing varies."""
    rng = np.random.default_rng(5)
    yield "all vertices", full[3]
    yield "some vertices", full[3][rng.choice(len(full[3]), 3000, replace=False)]
    yield "dense head and hands", uneven_cloud(bodies[3], bodies.model, rng, 4000)
    heights = simulated_scan(bodies[3], bodies.template.faces, 0, n_points=200_000, rotate=False)
    rings = heights.points[heights.points[:, 1] % 0.04 < 0.002]
    yield "rings", rings[rng.choice(len(rings), 8000, replace=False)]


def test_sparse_parts_of_a_body_are_no_background(full, bodies):
    for name, cloud in clouds(full, bodies):
        assert prepare_scan(as_scan(cloud)).background.mean() < 0.002, name


def test_a_sparse_floor_below_an_uneven_cloud_is_background(bodies):
    rng = np.random.default_rng(1)
    scan = simulated_scan(bodies[3], bodies.template.faces, rng, rotate=False)
    cloud = uneven_cloud(scan.body, bodies.model, rng, 6000)
    background = prepare_scan(as_scan(np.concatenate([cloud, sparse_floor(scan, rng)]))).background
    assert background[len(cloud) :].mean() > 0.75
    assert background[: len(cloud)].mean() < 0.01


def test_normals_of_rings_are_those_of_the_surface(full, bodies):
    *_, (_, rings) = clouds(full, bodies)
    body = bodies[3]
    normals = rh.kernels.surface.vertex_normals(body, bodies.template.faces)
    nearest = cKDTree(body).query(rings)[1]
    cosines = np.einsum(
        "nx,nx->n", estimate_normals(rings, PreparationSettings()), normals[nearest]
    )
    assert np.mean(np.abs(cosines) > 0.7) > 0.85


@pytest.mark.parametrize("whole", [True, False])
def test_uneven_clouds_are_registered(registration_from, bodies, whole):
    rng = np.random.default_rng(3)
    cloud = uneven_cloud(bodies[0], bodies.model, rng, 4000)
    on_arm = np.zeros(len(bodies[0]), dtype=bool)
    if not whole:
        names, owners = bodies.model.joint_names, bodies.model.weights.argmax(axis=1)
        on_arm = np.isin(owners, [names.index(f"left_{joint}") for joint in ("elbow", "wrist")])
        cloud = cloud[~on_arm[cKDTree(bodies[0]).query(cloud)[1]]]
    result = registration_from("t", "down").solve(cloud)
    assert result.trusted, result.message
    assert result.trusted_vertices[~on_arm].mean() > 0.95
    assert not result.trusted_vertices[on_arm].any()
    assert np.linalg.norm(result.points - bodies[0], axis=1)[~on_arm].mean() < 0.015
