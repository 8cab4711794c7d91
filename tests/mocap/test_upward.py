"""The axis that points up: people lie, crawl and stand on their hands as they were recorded."""

import warnings

import numpy as np
import pytest
from recorded_people import lying

from riemhuman.datasets import retarget


def heights(recording, up=None, in_doubt="error"):
    motion = retarget(recording, up=up, frames_per_second=3)
    with warnings.catch_warnings():
        warnings.simplefilter(in_doubt, UserWarning)
        return motion[:][..., 1]


@pytest.mark.parametrize(("tilt", "heading"), [(90, 0), (90, 180), (-90, 270)])
def test_people_lie_on_the_floor(recording, tilt, heading):
    laid = lying(recording, tilt, heading)
    found = heights(laid)
    np.testing.assert_allclose(found, heights(laid, "y"), atol=1e-9)
    assert np.ptp(found, axis=1).mean() < 0.7


def test_people_lie_on_beds(recording):
    laid = lying(recording, -90, 30, 0.5 / 0.0546)
    np.testing.assert_allclose(heights(laid, in_doubt="ignore"), heights(laid, "y"), atol=1e-9)


def test_doubt_is_said(recording):
    laid = lying(recording, 90, 0, 0.4 / 0.0546)
    motion = retarget(laid, frames_per_second=3)
    said = r"y was taken to point up, .* Pass up='y' or up='z'"
    with pytest.warns(UserWarning, match=said) as warned:
        motion.pose_vectors  # noqa: B018
    assert {warning.filename for warning in warned} == {__file__}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        retarget(laid, up="y", frames_per_second=3).pose_vectors  # noqa: B018
