"""Few digits left far from the origin: refused or warned of, and ordinary bodies taken silently."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.checks import check_resolution
from riemhuman.errors import ArgumentError, FileFormatError

FAR = np.array([5e5, 0.0, 5e6])


@pytest.mark.parametrize("unit", [1.0, 100.0, 1000.0])
def test_ordinary_bodies_are_silent(bodies, unit):
    for points in (bodies.points[:3], bodies.points[:3].astype(np.float32)):
        check_resolution(unit * points, "points")
        # A scanner's stage, some ten metres away.
        check_resolution((unit * (points + 10.0)).astype(points.dtype), "points")
        check_resolution(np.round(points, 3), "points")
        check_resolution(unit * (points.astype(float) + FAR), "points")
    check_resolution(np.zeros((2, 0, 3)), "points")
    check_resolution(np.zeros((2, 300, 3), np.float32), "points")


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_single_precision_far_away_is_refused(bodies, dtype):
    far = (bodies.points[:2] + FAR).astype(np.float32).astype(dtype)
    space = rh.AlignedSurfaces(bodies.template)
    metric = rh.ElasticMetric(space)
    for use in (
        lambda: metric.dist(*far),
        lambda: metric.dist_pairwise(far),
        lambda: rh.Template(far[0], bodies.template.faces),
        lambda: rh.procrustes(far, to=bodies.template.vertices),
        lambda: rh.solvers.LinearPath(3).solve(metric, *far),
        lambda: bodies.model.fit(far[0]),
    ):
        with pytest.raises(
            ArgumentError, match=r"5e\+06 .* step of 0\.\d+: this leaves 0\.\d digits"
        ):
            use()


@pytest.mark.parametrize(
    ("convert", "digits"),
    [
        (lambda points: (points + 2e4).astype(np.float32), r"[01]\.\d"),
        (lambda points: np.round(points + FAR, 3), r"1\.\d"),
        (lambda points: np.round(points + FAR, 2), r"0\.\d"),
        (lambda points: points.astype(np.float16), r"1\.\d"),
        (lambda points: np.round(1000 * points).astype(np.int32), r"1\.\d"),
    ],
)
def test_few_digits_are_warned_of_or_refused(bodies, convert, digits):
    # Warnings are errors here.
    with pytest.raises(
        (rh.PrecisionWarning, ArgumentError),
        match=rf"points are up to .*: this leaves {digits} digits",
    ):
        check_resolution(convert(bodies[0]), "points")


def test_distances_far_away_are_those_near(bodies):
    space = rh.AlignedSurfaces(bodies.template)
    for metric in (rh.ElasticMetric(space), rh.SRNFMetric(space)):
        near = metric.dist(bodies[0], bodies[13])
        np.testing.assert_allclose(metric.dist(bodies[0] + FAR, bodies[13] + FAR), near, rtol=1e-6)


def test_files_far_away(bodies, tmp_path):
    rh.save_mesh(tmp_path / "far.ply", (bodies[0] + FAR).astype(np.float32), bodies.template.faces)
    for read in (rh.load_mesh, rh.registration.load_scan, rh.Template.from_file):
        with pytest.raises(FileFormatError, match=r"far\.ply: .* digits of the usual distance"):
            read(tmp_path / "far.ply")
    lines = "\n".join(" ".join(f"{x:.2f}" for x in point) for point in bodies[0] + FAR)
    (tmp_path / "utm.xyz").write_text(lines)
    with pytest.raises((rh.PrecisionWarning, FileFormatError), match=r"utm\.xyz: .* 0\.\d digits"):
        rh.registration.load_scan(tmp_path / "utm.xyz")
