"""The page of two motions aligned in time."""

import re

import numpy as np
import pytest

import riemhuman as rh


@pytest.fixture
def aligned():
    motions = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    m1, m2 = (motion[:30:10] for motion in motions)
    warp = rh.motions.Warp(0.125, np.array([0.0, 1.0, 2.0]), np.array([0.0, 4.0, 8.0]))
    return rh.plots.AlignedMotions(m1, m2, motions[0].faces, warp, ("Anna & co", "Ben"))


def test_page_shows_both_the_curve_and_matched_frames(aligned, tmp_path):
    aligned.save(tmp_path / "both.html")
    page = (tmp_path / "both.html").read_text(encoding="utf-8")
    assert "<h1>Anna &amp; co and Ben aligned in time</h1>" in page
    assert "re-timing: 0.125" in page
    assert 'points="0.00,100.00 50.00,50.00 100.00,0.00"' in page
    assert re.findall("<figcaption>(.*?)</figcaption>", page) == ["0 %", "50 %", "100 %"]
    assert page.count('class="viewer"') == 1
    assert "$" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def test_motions_of_different_lengths(aligned):
    with pytest.raises(rh.RiemhumanError, match="second must have the shape of first"):
        rh.plots.AlignedMotions(aligned.first, aligned.second[:2], aligned.faces, aligned.warp)
