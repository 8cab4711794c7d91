"""What a user may change about registration is checked, and stages follow it."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.registration import RegistrationSettings, ScanRegistration
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._start_search import make_starts


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"n_headings": 0}, "n_headings must be a whole number of at least 1"),
        ({"poses": "a"}, "poses must be names of start poses"),
        ({"tries_arms": 2}, "tries_arms must be True or False"),
        ({"most_points": 10}, "most_points must be a whole number of at least 200"),
        ({"last_stiffness": 0.0}, "last_stiffness must be a finite number above 0"),
    ],
)
def test_impossible_settings_are_refused(change, message):
    with pytest.raises(rh.RiemhumanError, match=message):
        RegistrationSettings(**change)


def test_starts_follow_the_settings(model):
    scan = prepare_scan(rh.registration.Scan(model(), model.faces), surroundings=False)
    settings = RegistrationSettings(poses=("a", "t"), n_headings=2)
    body = RegistrationModel(model, settings)
    starts = make_starts(body, scan, body.poses, [np.array([0.0, 1.0, 0.0])], 0.0)
    assert len(starts) == 2 * 2
    assert [start.number for start in starts] == [0, 1, 2, 3]
    facing = [start.pose.local[body.root][2, 2] for start in starts]
    np.testing.assert_allclose(facing, [1.0, -1.0, 1.0, -1.0], atol=0.1)


def test_scans_are_reduced_to_the_number_of_points_of_the_settings(model, scan):
    few = prepare_scan(rh.registration.Scan(scan.points), most_points=1000)
    assert 900 < len(few.points) < 1100


@pytest.mark.parametrize("poses", [("handstand",), ()])
def test_unknown_poses_are_refused_before_a_scan_is_read(model, poses):
    with pytest.raises(rh.errors.ArgumentError, match="settings.poses .* the model has"):
        ScanRegistration(model, settings=RegistrationSettings(poses=poses)).solve("no_such.ply")
