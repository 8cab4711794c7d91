"""Limbs that a scan does not show leave those that it shows where they are."""

from dataclasses import replace

import numpy as np
import pytest
from limbs_right_and_wrong import without
from scanned_people import fit_body, task_of

import riemhuman as rh
from riemhuman.bodies import rotation_matrix
from riemhuman.kernels.surface import unit_vectors
from riemhuman.registration import simulated_scan
from riemhuman.registration._elastic_step import leave_model
from riemhuman.registration._limbs import BodyParts
from riemhuman.registration._shown_parts import find_lost_limbs, leave_out_lost_limbs
from riemhuman.registration._start_search import search_scan
from riemhuman.surfaces.nearest_points import nearest_points


def fits_of(registration_from, model, body, joints):
    """Return fits with all limbs and without lost ones, and what is shown of the second."""
    scan = simulated_scan(body, model.faces, rng=0, n_points=4000, rotate=False)
    task = task_of(registration_from("t", "down"), without(model, body, joints, scan.points))
    search = search_scan(task.body, task.scan)
    fitted = fit_body(search.body, search.candidates[0], search.scan)
    return fitted, *leave_out_lost_limbs(fitted, search.scan, is_refused=False)


@pytest.mark.everyday("left_elbow")
@pytest.mark.parametrize("joint", ["left_elbow", "right_knee"])
def test_what_is_above_a_missing_limb_stays_in_place(
    registration_from, model, natural_bodies, joint
):
    body, parts = natural_bodies[30], {"left_elbow": "left_shoulder", "right_knee": "right_hip"}
    whole, fitted, shown = fits_of(registration_from, model, body, (joint,))
    owners = model.weights.argmax(axis=1)
    above = owners == model.joint_names.index(parts[joint])
    errors = [
        np.linalg.norm(body_fit.fit.points - body, axis=1)[above].mean()
        for body_fit in (whole, fitted)
    ]
    assert errors[1] < 0.01
    assert errors[1] < 0.85 * errors[0]
    np.testing.assert_array_equal(
        shown.lost, whole.task.body.parts.vertices([model.joint_names.index(joint)])
    )
    assert not shown.seen[shown.lost].any()


def test_a_whole_body_stays_as_it_is(registration_from, model, natural_bodies):
    whole, fitted, shown = fits_of(registration_from, model, natural_bodies[30], ())
    assert fitted is whole
    assert not shown.lost.any()


@pytest.mark.slow
def test_an_upper_arm_without_forearm_is_not_twisted(registration_from, model, natural_bodies):
    """Rotated about its own axis, it fits as well; it is then as in the nearest start pose."""
    whole, *_ = fits_of(registration_from, model, natural_bodies[30], ("left_elbow",))
    task, rest = whole.task, whole.task.samples.skeleton.rest_joints
    shoulder, elbow = task.body.parts.numbers("left_shoulder", "left_elbow")
    axis = unit_vectors(rest[elbow] - rest[shoulder])
    local = whole.fit.pose.local.copy()
    local[shoulder] = local[shoulder] @ rotation_matrix(np.radians(120.0) * axis)
    task = replace(task, prior=task.prior._replace(local=local))
    twisted = replace(whole, task=task, fit=leave_model(task, whole.fit.pose._replace(local=local)))
    fitted, _ = leave_out_lost_limbs(twisted, task.scan, is_refused=False)
    on_upper_arm = task.body.parts.owners == shoulder
    errors = [
        np.linalg.norm(body.fit.points - natural_bodies[30], axis=1)[on_upper_arm].mean()
        for body in (twisted, fitted)
    ]
    assert errors[0] > 0.05
    assert errors[1] < 0.012


@pytest.mark.parametrize("name", ["left_elbow", "right_hip"])
def test_a_limb_that_lies_on_other_parts_is_lost(model, name):
    parts, points = BodyParts(model), rh.datasets.load_open_bodies("coarse")[0]
    matched = np.ones(len(points), dtype=bool)
    assert not find_lost_limbs(parts, points, matched).any()
    limb = parts.vertices(parts.numbers(name))
    rest = model.faces[~limb[model.faces].any(axis=1)]
    places, _ = nearest_points(points[limb], points, rest)
    collapsed = points.copy()
    corners = points[rest[places.triangles]]
    collapsed[limb] = np.einsum("nk,nkx->nx", places.barycentric, corners)
    np.testing.assert_array_equal(find_lost_limbs(parts, collapsed, matched), limb)
