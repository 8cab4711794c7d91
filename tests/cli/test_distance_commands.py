"""The commands dist, matrix and retrieve agree with the library and with each other."""

import json
import os
import re
import shutil

import numpy as np
import pytest

from riemhuman.geometry import AlignedSurfaces, AreaMetric, ElasticMetric
from riemhuman.io import save_mesh
from riemhuman.solvers import BasisPath, path_distances
from riemhuman.surfaces import DeformationBasis, Template, procrustes

NAMES = [f"body_{number}.ply" for number in (0, 1, 2, 20, 21, 22)]


def metric_of(template, a, lam, c):
    return ElasticMetric(AlignedSurfaces(template, equip=False), a=a, lam=lam, c=c)


@pytest.mark.parametrize(
    ("options", "weights"),
    [
        ([], (1, 1e-4, 0)),
        (["--pose"], (0, 0, 1)),
        (["-a", "2", "-l", "0.01", "-c", "0.5"], (2, 0.01, 0.5)),
        (["-c", "3"], (1, 1e-4, 3)),
    ],
)
def test_dist_is_that_of_the_library(run, scans, bodies, options, weights):
    finished = run("dist", scans / NAMES[0], scans / NAMES[3], *options, "--json")
    template = Template(bodies.points[0], bodies.template.faces)
    expected = metric_of(template, *weights).dist(bodies.points[0], bodies.points[20])
    record = json.loads(finished.out)
    assert (finished.code, finished.err) == (0, "")
    assert record["distance"] == expected
    assert record["metric"]["a"] == weights[0]
    plain = run("dist", scans / NAMES[0], scans / NAMES[3], *options)
    assert float(plain.out) == pytest.approx(expected, rel=1e-9)


@pytest.fixture
def registered(bodies, tmp_path):
    """Return a folder of two bodies that carry the mark of registered scans, and one without."""
    for number, trusted in ((0, True), (20, True), (1, False)):
        marks = np.arange(bodies.template.n_vertices) > 5 if trusted else None
        save_mesh(
            tmp_path / f"body_{number}.ply", bodies.points[number], bodies.template.faces, marks
        )
    return tmp_path


def test_scanned_people_are_compared_by_areas(run, registered, bodies):
    """Unless another metric is asked for: it is chosen, said and recorded."""
    template = Template(bodies.points[0], bodies.template.faces)
    areas = AreaMetric(AlignedSurfaces(template, equip=False))
    expected = areas.dist(*bodies.points[[0, 20]])
    pair = registered / "body_0.ply", registered / "body_20.ply"
    finished = run("dist", *pair)
    assert float(finished.out) == pytest.approx(expected, rel=1e-9)
    assert "registered scans: people are compared by smoothed areas" in finished.err
    assert "the unit is the metre" in finished.err
    assert "for comparison: same person, another pose ≈ 0.024; another person" in finished.err
    assert "the unit is that of the files" in run("dist", *pair, "--any-scale").err
    record = json.loads(run("dist", *pair, "--json").out)
    assert record["unit"] == "m"
    assert record["metric"] == {"name": "AreaMetric", "time": areas.time}
    for options, weights in ((["--shape"], (1, 1e-4, 0)), (["-l", "1"], (1, 1, 0))):
        finished = run("dist", *pair, *options)
        paper = metric_of(template, *weights).dist(*bodies.points[[0, 20]])
        assert float(finished.out) == pytest.approx(paper, rel=1e-9)
        assert "registered scans" not in finished.err
    matrix = run("matrix", registered, "--csv", "-")
    assert "registered scans" in matrix.err
    nearest = json.loads(run("retrieve", registered / "body_1.ply", registered, "--json").out)
    assert nearest["metric"]["name"] == "AreaMetric"


def test_areas_can_be_asked_for(run, scans, bodies):
    finished = run("dist", scans / NAMES[0], scans / NAMES[3], "--area", "--quiet")
    template = Template(bodies.points[0], bodies.template.faces)
    areas = AreaMetric(AlignedSurfaces(template, equip=False))
    assert float(finished.out) == pytest.approx(areas.dist(*bodies.points[[0, 20]]), rel=1e-9)
    assert finished.err == ""
    assert "--area sets all weights" in run("dist", *[scans / NAMES[0]] * 2, "--area", "-c", 1).err


@pytest.mark.parametrize("options", [[], ["--pose", "--align"], ["--precision", "single"]])
def test_matrix_is_that_of_the_library(run, scans, bodies, tmp_path, options):
    output = tmp_path / "D.npz"
    finished = run("matrix", scans, "-o", output, *options)
    assert finished.code == 0
    assert str(output) in finished.out
    points = bodies.points[[0, 1, 2, 20, 21, 22]]
    template = Template(points[0], bodies.template.faces)
    if "--align" in options:
        points = procrustes(points, to=template.vertices)
    weights = (0, 0, 1) if "--pose" in options else (1, 1e-4, 0)
    precision = "single" if "single" in options else "double"
    expected = metric_of(template, *weights).dist_pairwise(points, precision=precision)
    with np.load(output) as saved:
        assert saved["names"].tolist() == NAMES
        np.testing.assert_array_equal(saved["distances"], expected)
        assert str(weights[0]) in str(saved["metric"])


def test_matrix_as_table_and_json(run, scans, tmp_path):
    run("matrix", scans, "-o", tmp_path / "D.npz", "--csv", tmp_path / "D.csv")
    with np.load(tmp_path / "D.npz") as saved:
        distances = saved["distances"]
    table = (tmp_path / "D.csv").read_text(encoding="utf-8")
    printed = run("matrix", scans, "--csv", "-", "--quiet")
    assert (printed.out, printed.err) == (table, "")
    heading, *rows = [line.split(",") for line in table.splitlines()]
    assert heading[1:] == [row[0] for row in rows] == NAMES
    np.testing.assert_array_equal(np.array([row[1:] for row in rows], dtype=float), distances)
    record = json.loads(run("matrix", scans, "-o", tmp_path / "E.npz", "--json").out)
    assert record["distances"] == distances.tolist()
    assert record["names"] == NAMES


def test_matrix_of_lengths_of_paths(run, bodies, tmp_path):
    scans, points = tmp_path / "scans", bodies.points[[0, 1, 20]]
    scans.mkdir()
    for name, surface in zip("abc", points, strict=True):
        save_mesh(scans / f"{name}.ply", surface, bodies.template.faces)
    output, table = tmp_path / "D.npz", tmp_path / "D.csv"
    options = ("-a", 1, "-l", 1, "-c", 0.1, "--paths", "--n-nodes", 3, "--n-components", 6)
    finished = run("matrix", scans, "-o", output, "--csv", table, *options)
    assert finished.code == 0, finished.err
    template = Template(points[0], bodies.template.faces)
    solver = BasisPath(DeformationBasis.from_laplacian(template, 6), n_nodes=3)
    metric = metric_of(template, 1.0, 1.0, 0.1)
    expected = path_distances(solver, metric, points)
    with np.load(output) as saved:
        np.testing.assert_array_equal(saved["lengths"], expected.lengths)
        np.testing.assert_allclose(
            saved["distances"], metric.dist_pairwise(points, precision="double"), rtol=1e-9
        )
    rows = [line.split(",")[1:] for line in table.read_text(encoding="utf-8").splitlines()[1:]]
    np.testing.assert_array_equal(np.array(rows, dtype=float), expected.lengths)
    assert f"{np.median(expected.excess):.2f} % in the median" in finished.out
    kept = ("--resume", tmp_path / "work", "-o", tmp_path / "E.npz")
    assert run("matrix", scans, *kept, *options).code == 0
    with np.load(tmp_path / "E.npz") as saved:
        np.testing.assert_array_equal(saved["lengths"], expected.lengths)


@pytest.mark.skipif(os.name == "nt", reason="names of files are others there")
def test_names_that_others_have_chosen(run, scans, tmp_path):
    names = [b"=1+1.ply", b"\xff.ply", b"two\nlines.ply"]
    for number, name in enumerate(names):
        shutil.copy(scans / f"body_{number}.ply", os.path.join(os.fsencode(tmp_path), name))
    finished = run("matrix", tmp_path, "--csv", "-")
    rows = finished.out.splitlines()
    assert rows[0] == r"file,'=1+1.ply,two lines.ply,\udcff.ply"
    assert (finished.code, len(rows)) == (0, 4)


def test_retrieve_ranks_by_dist(run, scans):
    query = scans / NAMES[4]
    record = json.loads(run("retrieve", query, scans, "--pose", "--json").out)
    found = [(result["file"], result["distance"]) for result in record["results"]]
    assert len(found) == 5
    assert str(query) not in [file for file, _ in found]
    assert [distance for _, distance in found] == sorted(distance for _, distance in found)
    assert found[0][0] == str(scans / NAMES[1])  # the other person in the same pose
    for file, distance in found:
        alone = json.loads(run("dist", query, file, "--pose", "--json").out)["distance"]
        assert distance == pytest.approx(alone, rel=1e-9)
    nearest = run("retrieve", query, scans, "--shape", "-k", "2").out.splitlines()
    assert [line.split()[0] for line in nearest] == ["1", "2"]
    assert {line.split()[2] for line in nearest} == {str(scans / NAMES[i]) for i in (3, 5)}


def test_dist_says_what_is_usual_under_the_metric(run, scans):
    files = (scans / NAMES[0], scans / NAMES[1])
    usual = {}
    for preset in ("--shape", "--pose"):
        finished = run("dist", *files, preset)
        assert re.fullmatch(r"[\d.e-]+\n", finished.out)
        said = re.search(r"another pose ≈ (\S+); .* same pose ≈ (\S+) ", finished.err)
        usual[preset] = tuple(map(float, said.groups()))
        assert run("dist", *files, preset, "--quiet").err == ""
    assert usual["--shape"][0] < usual["--shape"][1]
    assert usual["--pose"][0] > usual["--pose"][1]


def test_dist_says_that_one_body_is_rotated(run, scans, bodies, tmp_path):
    rotated = tmp_path / "rotated.ply"
    save_mesh(rotated, bodies.points[1][:, [2, 1, 0]] * [1.0, 1.0, -1.0], bodies.template.faces)
    said = run("dist", scans / NAMES[0], rotated, "--pose").err
    aligned = float(run("dist", scans / NAMES[0], rotated, "--pose", "--align").out)
    assert "B is rotated relative to A" in said
    assert f"without the rotation, the distance is {aligned:.4g}" in said
    for options in (["--shape"], ["--pose", "--align"], ["--pose", "--quiet"]):
        assert "rotated" not in run("dist", scans / NAMES[0], rotated, *options).err
    assert "rotated" not in run("dist", scans / NAMES[0], scans / NAMES[1], "--pose").err
