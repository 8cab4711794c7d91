"""What a registered scan says of itself, and where it stands."""

from dataclasses import replace

import numpy as np
import pytest
from open_bodies import coarse_bodies
from scanned_people import registered_at
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.registration.registered_scans import apply_transform

BODIES = coarse_bodies()


@pytest.fixture(scope="module")
def result():
    return registered_at(BODIES[0], BODIES.template.faces)


def test_upright_points_are_those_after_the_motion(result):
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_rotvec([0.3, -1.1, 0.4]).as_matrix()
    motion[:3, 3] = 5.0, -2.0, 0.5
    moved = replace(result, transform=motion)
    expected = [motion[:3, :3] @ point + motion[:3, 3] for point in result.points]
    np.testing.assert_allclose(moved.upright_points, expected, atol=1e-12)
    back = apply_transform(np.linalg.inv(motion), moved.upright_points)
    np.testing.assert_allclose(back, result.points, atol=1e-12)


def test_the_view_is_that_of_the_scan_over_the_body(result):
    viewer = result.view()
    assert viewer.title == rh.view(result).title == "Registered scan"
    (choice,) = viewer.choices.values()
    np.testing.assert_array_equal(choice[0].frames[0], result.points)
    assert viewer.panel.name == "scan"
    assert len(viewer.panel.over.scan_points) == len(result.scan)
    assert 'data-scan="body"' in viewer.page()
