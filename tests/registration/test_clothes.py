"""Beneath clothes, a body lies inside its scan, and what loose cloth hides is said."""

from dataclasses import replace

import numpy as np
import pytest
from clothed_people import OUTFITS, clothed_scan
from scanned_people import with_other_names

from riemhuman.errors import ArgumentError
from riemhuman.kernels.surface import vertex_normals
from riemhuman.registration import ScanRegistration
from riemhuman.registration._clothes import find_loose, hide_trunk
from riemhuman.registration._limbs import TRUNK
from riemhuman.registration._messages import say_unseen
from riemhuman.registration.folders import _identity
from riemhuman.surfaces import nearest_points

# Three standard deviations of the scans' noise.
NOISE = 0.006


def heights(points, surface, faces):
    """Return how far points are outside a surface, metres; negative inside it."""
    places, distances = nearest_points(points, surface, faces)
    corners = faces[places.triangles]
    gaps = points - np.einsum("nk,nkx->nx", places.barycentric, surface[corners])
    normals = vertex_normals(surface, faces)[corners].mean(axis=1)
    return np.copysign(distances, np.einsum("nx,nx->n", gaps, normals))


@pytest.fixture(scope="module")
def dressed(model, natural_bodies):
    return clothed_scan(
        model, natural_bodies[20], OUTFITS["shirt and trousers"], np.random.default_rng(0)
    )


@pytest.fixture(scope="module")
def results(dressed, registration_from):
    """Return the registrations of a clothed scan as if it were skin, and beneath it."""
    as_skin = registration_from("a")
    return [replace(as_skin, clothed=clothed).solve(dressed.points) for clothed in (False, True)]


@pytest.mark.parametrize("outfit", ["shirt and trousers", "dress to the knee"])
def test_simulated_garments_are_outside_the_body(model, natural_bodies, outfit):
    body = natural_bodies[40]
    scan = clothed_scan(model, body, OUTFITS[outfit], np.random.default_rng(1))
    outside = heights(scan.points, body, model.faces)
    assert np.mean(outside > -NOISE) > 0.995
    assert np.quantile(outside, 0.9) > 0.015


def test_the_scan_lies_outside_the_body_beneath(model, dressed, results):
    as_skin, beneath = (heights(dressed.points, r.points, model.faces) for r in results)
    assert np.mean(beneath > -NOISE) > 0.95
    assert np.mean(beneath > 0.01) > 2.0 * np.mean(as_skin > 0.01)


def test_the_body_beneath_is_nearer_to_the_truth_and_thinner(dressed, results):
    as_skin, beneath = (np.linalg.norm(r.points - dressed.body, axis=1) for r in results)
    assert beneath.mean() < 0.7 * as_skin.mean()
    assert beneath.mean() < 0.012


def test_what_is_beneath_loose_clothes_is_not_trusted(model, dressed, results):
    _, beneath = results
    owners = np.array(model.joint_names)[model.weights.argmax(axis=1)]
    assert beneath.trusted
    assert beneath.trusted_vertices[np.isin(owners, ["head", "left_wrist"])].mean() > 0.9
    assert beneath.trusted_vertices[np.isin(owners, ["lower_spine", "pelvis"])].mean() < 0.5
    assert "were not seen under clothes" in beneath.message
    errors = np.linalg.norm(beneath.points - dressed.body, axis=1)
    trusted = beneath.trusted_vertices
    assert errors[trusted].mean() < 0.7 * errors[~trusted].mean()


def test_clothes_that_touch_the_skin_in_one_place_are_loose(model):
    template = model.template
    far = np.where(template.vertices[:, 1] < np.median(template.vertices[:, 1]), 0.02, 0.001)
    touched = far.copy()
    foot = int(template.vertices[:, 1].argmin())
    touched[foot] = 0.0
    unknown = touched.copy()
    unknown[foot] = np.nan
    for distances in (far, touched, unknown):
        loose = find_loose(template, distances)
        assert loose[foot]
        assert not loose[template.vertices[:, 1].argmax()]


@pytest.mark.parametrize(("n_hidden", "is_hidden"), [(4, False), (6, True)])
def test_a_trunk_that_cloth_hides_for_the_most_part_is_hidden_as_a_whole(n_hidden, is_hidden):
    on_trunk = np.repeat([True, False], [10, 5])
    hidden = np.zeros(15, bool)
    hidden[:n_hidden] = hidden[14] = True
    expected = hidden | (on_trunk & is_hidden)
    np.testing.assert_array_equal(hide_trunk(on_trunk, hidden), expected)


@pytest.mark.parametrize(
    ("joints", "said"),
    [
        (["pelvis"], "the pelvis was not seen under clothes (20 % of the body)"),
        (
            [*TRUNK, "left_hip", "right_hip"],
            "the trunk and thighs were not seen under clothes (20 % of the body)",
        ),
        ([], "20 % of the body was not seen under clothes"),
    ],
)
def test_hidden_parts_are_said(joints, said):
    assert say_unseen(joints, 0.2, " under clothes") == said


def test_a_model_without_bare_parts_is_refused(model):
    registration = ScanRegistration(with_other_names(model), clothed=True)
    with pytest.raises(ArgumentError, match="clothed=True needs a model whose joints name"):
        registration.solve(model.template.vertices)


def test_a_folder_is_registered_again_if_its_people_are_said_to_wear_clothes(model):
    registration = ScanRegistration(model)
    kept, again = (
        _identity(each, False, False)
        for each in (registration, replace(registration, clothed=True))
    )
    assert kept != again
