"""A vertex of one scan goes to its place on another, by way of the registered bodies."""

from dataclasses import replace

import numpy as np
import pytest
from scanned_people import points_at

import riemhuman as rh
from riemhuman.registration import (
    Scan,
    TemplateRegistration,
    correspondence,
    geodesic_errors,
    simulated_scan,
)
from riemhuman.surfaces.nearest_points import nearest_points

STANDING, ARMS_ON_HIPS = 0, 4


@pytest.fixture(scope="module")
def registration(natural_bodies):
    return TemplateRegistration(natural_bodies.template)


@pytest.fixture(scope="module")
def pair(natural_bodies, registration):
    """Return the registrations of two remeshed scans of one person, and the bodies themselves."""
    surfaces = natural_bodies[[STANDING, ARMS_ON_HIPS]]
    options = {"n_points": 3000, "mesh": True, "noise": 0.0, "rotate": False}
    faces = natural_bodies.template.faces
    scans = [simulated_scan(surface, faces, k, **options) for k, surface in enumerate(surfaces)]
    results = [
        registration.solve(scan.surface, start=body)
        for scan, body in zip(scans, surfaces, strict=True)
    ]
    return results, surfaces


def errors(found, result, surfaces, faces):
    """Return how far from its true place every vertex goes, metres."""
    places, _ = nearest_points(result.scan.points, surfaces[0], faces)
    return np.linalg.norm(found.points - points_at(places, surfaces[1], faces), axis=1)


def test_vertices_go_to_their_places_on_other_triangles(pair, natural_bodies):
    (first, second), surfaces = pair
    found = correspondence(first, second)
    assert found.seen.mean() > 0.95
    assert np.nanmean(errors(found, first, surfaces, natural_bodies.template.faces)) < 0.01
    corners = second.scan.faces[found.triangles[found.seen]]
    places = np.einsum("nk,nkx->nx", found.barycentric[found.seen], second.scan.points[corners])
    np.testing.assert_allclose(places, found.points[found.seen], atol=1e-12)
    assert np.all((corners == found.vertices[found.seen, np.newaxis]).any(axis=1))


def test_the_way_back_leads_home(pair):
    (first, second), _ = pair
    forth, back = correspondence(first, second), correspondence(second, first)
    home = back.points[forth.vertices]
    gaps = np.linalg.norm(home - first.scan.points, axis=1)[forth.seen]
    assert np.nanmedian(gaps) < 0.02  # half of the spacing of the vertices between


def test_loose_points_go_to_the_nearest_vertex(pair, registration, natural_bodies):
    (first, second), surfaces = pair
    cloud = registration.solve(Scan(second.scan.points), start=surfaces[1])
    found = correspondence(first, cloud)
    assert found.triangles is None
    assert found.barycentric is None
    np.testing.assert_array_equal(
        found.points[found.seen], second.scan.points[found.vertices[found.seen]]
    )
    assert np.nanmean(errors(found, first, surfaces, natural_bodies.template.faces)) < 0.02


def test_what_either_scan_lacks_has_no_place(pair, natural_bodies):
    (first, second), _ = pair
    arm = [natural_bodies.model.joint_names.index(f"left_{name}") for name in ("elbow", "wrist")]
    on_arm = np.isin(natural_bodies.model.weights.argmax(axis=1), arm)
    unseen = replace(second, trusted_vertices=second.trusted_vertices & ~on_arm)
    places = first.correspondence
    of_arm = on_arm[first.faces[places.triangles]].all(axis=1)
    for found in (
        correspondence(first, unseen),
        correspondence(replace(first, trusted_vertices=first.trusted_vertices & ~on_arm), second),
    ):
        assert not found.seen[of_arm].any()
        assert np.isnan(found.points[of_arm]).all()
        assert np.all(found.vertices[of_arm] == -1)
        assert found.seen[~on_arm[first.faces[places.triangles]].any(axis=1)].mean() > 0.95
    floor = replace(first, background=np.arange(len(first.scan)) < 50)
    assert not correspondence(floor, second).seen[:50].any()


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_lost_hand_is_not_taken_for_the_trunk(pair, natural_bodies, side):
    """The hand touches the hip; its body is elsewhere, so the hip is nearest to its points."""
    (first, second), surfaces = pair
    faces, model = natural_bodies.template.faces, natural_bodies.model
    hand = model.weights.argmax(axis=1) == model.joint_names.index(f"{side}_wrist")
    moved = np.where(hand[:, np.newaxis], second.points + [0.0, 1.0, 0.0], second.points)
    places, distances = nearest_points(second.scan.points, moved, faces)
    trusted = second.trusted_vertices & ~hand
    lost = replace(
        second,
        points=moved,
        correspondence=places,
        distances=distances,
        trusted_vertices=trusted,
    )
    found = correspondence(lost, first)
    away = errors(found, second, surfaces[::-1], faces) > 0.10
    on_trunk = trusted[faces[places.triangles]].all(axis=1) & (distances < 0.03)
    of_hand = hand[faces[nearest_points(second.scan.points, second.points, faces)[0].triangles]]
    assert np.sum(of_hand.all(axis=1) & on_trunk) > 10  # are taken for it by their places alone
    assert np.mean(away[found.seen]) < 0.002
    assert found.seen.mean() > 0.93


def test_results_that_cannot_be_matched_are_refused(pair):
    (first, second), _ = pair
    with pytest.raises(rh.errors.ArgumentError, match="must be registered with the same model"):
        correspondence(first, replace(second, faces=second.faces[:-1]))
    nothing = replace(second, trusted_vertices=np.zeros(1202, dtype=bool), message="too far")
    with pytest.raises(rh.errors.ArgumentError, match="no part of result_b is trusted: too far"):
        correspondence(first, nothing)
    with pytest.raises(rh.errors.ArgumentTypeError, match="result_a must be a RegisteredScan"):
        correspondence(first.points, second)


def test_geodesic_errors_are_shares_of_the_root_of_the_area():
    """On a flat square of unit area, and round a fold, over which the straight line is shorter."""
    places = np.linspace(0.0, 1.0, 21)
    x, y = np.meshgrid(places, places, indexing="ij")
    folded = [np.minimum(x, 0.5), y, np.maximum(x - 0.5, 0.0)]
    corner = np.arange(21 * 21).reshape(21, 21)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1), np.stack([a, c, d], -1)]).reshape(-1, 3)
    ends = corner[0, 0], corner[20, 7]
    truth = np.hypot(1.0, 0.35)
    for points in ([x, y, 0.0 * x], folded):
        surface = 3.0 * np.stack(points, axis=-1).reshape(-1, 3)
        (error, near, none) = geodesic_errors(
            surface, faces, [ends[1], ends[0], -1], [ends[0], ends[0], 0]
        )
        assert 0.97 < error / truth < 1.06
        assert near == 0.0
        assert np.isnan(none)
    apart = np.concatenate([surface, surface + [0.0, 0.0, 2.0]])
    both = np.concatenate([faces, faces + len(surface)])
    (error,) = geodesic_errors(apart, both, [441], [0])
    np.testing.assert_allclose(error, 2.0 / np.sqrt(18.0))  # straight, of twice the area
    with pytest.raises(rh.errors.ArgumentError, match="must be vertices of the mesh, below 441"):
        geodesic_errors(surface, faces, [441], [0])
