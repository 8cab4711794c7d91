"""The verb mean writes the mean that the library finds."""

import json

import numpy as np
import pytest

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import load_mesh
from riemhuman.solvers import BasisMean
from riemhuman.surfaces import DeformationBasis, Template, procrustes


@pytest.mark.parametrize("align", [False, True])
def test_mean_is_that_of_the_library(run, scans, bodies, tmp_path, align):
    files = [scans / f"body_{number}.ply" for number in (0, 1, 20)]
    options = ["--n-components", 6, "--json", *(["--align"] if align else [])]
    finished = run("mean", *files, "-o", tmp_path / "mean.obj", *options)
    points = bodies.points[[0, 1, 20]]
    template = Template(points[0], bodies.template.faces)
    if align:
        points = procrustes(points, to=template.vertices)
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=0.1)
    expected = BasisMean(DeformationBasis.from_laplacian(template, 6)).solve(metric, points)
    record = json.loads(finished.out)
    assert record["variance"] == expected.variance
    vertices, faces = load_mesh(tmp_path / "mean.obj")
    np.testing.assert_array_equal(vertices, expected.point)
    np.testing.assert_array_equal(faces, bodies.template.faces)


def test_mean_of_a_folder(run, scans, tmp_path):
    options = ("--pose", "--n-components", 3)
    finished = run("mean", scans, "-o", tmp_path / "mean.ply", *options)
    assert "Mean of 6, (a, λ, c) = (0, 0, 1)" in finished.err
    assert "converged   yes, after" in finished.out
    assert load_mesh(tmp_path / "mean.ply")[0].shape == (1202, 3)


def test_failures(refused, scans, tmp_path):
    one = scans / "body_0.ply"
    assert "ending must be" in refused("mean", one, "-o", tmp_path / "mean.npz")
    assert "is a folder" in refused("mean", one, "-o", _folder(tmp_path / "mean.ply"))
    assert "exists; --force" in refused("mean", one, "-o", one)
    assert "absent.ply" in refused("mean", one, tmp_path / "absent.ply", "-o", tmp_path / "m.ply")
    assert [path.name for path in tmp_path.iterdir()] == ["mean.ply"]


def _folder(path):
    path.mkdir()
    return path
