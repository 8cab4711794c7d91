"""Settings of registration: each is checked, and stages follow them."""

from dataclasses import fields, replace

import numpy as np
import pytest
from scanned_people import settings_with

import riemhuman as rh
from riemhuman.registration import (
    ArmSettings,
    AssignmentSettings,
    DenseFitSettings,
    ElasticSettings,
    MatchingSettings,
    PreparationSettings,
    RegistrationSettings,
    RetrySettings,
    RivalSettings,
    ScanRegistration,
    SearchRound,
    SearchSettings,
    TrustSettings,
)
from riemhuman.registration._registration_model import RegistrationModel
from riemhuman.registration._scan_preparation import prepare_scan
from riemhuman.registration._starts import make_starts

PARTS = (
    PreparationSettings,
    MatchingSettings,
    AssignmentSettings,
    SearchSettings,
    DenseFitSettings,
    ArmSettings,
    ElasticSettings,
    RivalSettings,
    TrustSettings,
    RetrySettings,
)


@pytest.mark.parametrize("part", PARTS)
def test_every_number_is_checked(part):
    """None of them may be something that is no number."""
    settings = part()
    for entry in fields(part):
        value = getattr(settings, entry.name)
        if isinstance(value, (int, float)) and not isinstance(value, bool):
            with pytest.raises(rh.RiemhumanError, match=entry.name):
                replace(settings, **{entry.name: np.nan})


@pytest.mark.parametrize(
    ("part", "change", "message"),
    [
        (SearchSettings, {"n_headings": 0}, "n_headings must be a whole number of at least 1"),
        (SearchSettings, {"headings": (6,)}, r"headings\[0\] must be a whole number of at most 5"),
        (SearchSettings, {"poses": ()}, "poses must name at least one start pose"),
        (DenseFitSettings, {"scales": ()}, "scales must be a tuple of numbers"),
        (ElasticSettings, {"along": 1.5}, "along must be a number between 0 and 1"),
        (RivalSettings, {"head_turns": ((0, np.nan),)}, r"head_turns\[0\] must be a finite"),
        (RivalSettings, {"head_turns": (60.0,)}, r"head_turns\[0\] must be a pair of numbers"),
        (SearchSettings, {"rounds": (1, 2)}, r"rounds\[0\] must be a SearchRound"),
        (SearchSettings, {"warm_rounds": ()}, "warm_rounds must be a tuple of at least 1 Search"),
        (TrustSettings, {"leaning": 2.0}, "leaning must be a cosine"),
        (MatchingSettings, {"blur_metres": -1.0}, "blur_metres must be a finite number above 0"),
    ],
)
def test_impossible_settings_are_refused(part, change, message):
    with pytest.raises(rh.RiemhumanError, match=message):
        part(**change)


def test_a_part_in_the_place_of_another_is_refused(model):
    with pytest.raises(rh.errors.ArgumentTypeError, match="search must be a SearchSettings"):
        RegistrationSettings(search=TrustSettings())
    with pytest.raises(rh.errors.ArgumentTypeError, match="settings must be RegistrationSettings"):
        ScanRegistration(model, settings=SearchSettings())


def test_rounds_are_checked():
    with pytest.raises(rh.RiemhumanError, match="n_best"):
        SearchRound(250, 400, (0.2, 0.1), 2, 0)


def test_starts_follow_the_settings(model):
    scan = prepare_scan(rh.registration.Scan(model(), model.faces), surroundings=False)
    body = RegistrationModel(model, settings_with(poses=("a", "t"), n_headings=4, headings=(0, 2)))
    starts = make_starts(body, scan, body.poses, [np.array([0.0, 1.0, 0.0])], 0.0)
    assert len(starts) == 2 * 2
    assert [start.number for start in starts] == [0, 1, 2, 3]
    facing = [start.pose.local[body.root][2, 2] for start in starts]
    np.testing.assert_allclose(facing, [1.0, -1.0, 1.0, -1.0], atol=0.1)


def test_an_unknown_pose_is_named(model):
    body = RegistrationModel(model, settings_with(poses=("handstand",)))
    with pytest.raises(rh.errors.ArgumentError, match="has 'handstand'; the model has"):
        _ = body.poses
