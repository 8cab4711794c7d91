"""The commands tables, dist, matrix, retrieve, scores, plot and report."""

import json
import re
import sys
from dataclasses import asdict

import h5py
import numpy as np
import pytest
from open_bodies import coarse_bodies
from third_party import Extents, VertexOffsets

from riemhuman.cli._terminal import matrix_text
from riemhuman.geometry import AlignedSurfaces, AreaMetric, ElasticMetric
from riemhuman.io import save_mesh
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.retrieval import scores
from riemhuman.solvers import BasisPath, path_distances
from riemhuman.statistics import PersonMetric
from riemhuman.surfaces import DeformationBasis, Template, procrustes

NAMES = [f"body_{number}.ply" for number in (0, 1, 2, 20, 21, 22)]


def metric_of(template, a, lam, c):
    return ElasticMetric(AlignedSurfaces(template, equip=False), a=a, lam=lam, c=c)


def test_dist_is_that_of_the_library(run, scans, bodies):
    template = Template(bodies.points[0], bodies.template.faces)
    for options, weights in (
        ([], (1, 1e-4, 0)),
        (["--pose"], (0, 0, 1)),
        (["-a", "2", "-l", "0.01", "-c", "0.5"], (2, 0.01, 0.5)),
        (["-c", "3"], (1, 1e-4, 3)),
    ):
        finished = run("dist", scans / NAMES[0], scans / NAMES[3], *options, "--json")
        expected = metric_of(template, *weights).dist(*bodies.points[[0, 20]])
        record = json.loads(finished.out)
        assert (finished.code, finished.err) == (0, "")
        assert record["distance"] == expected
        assert record["metric"]["a"] == weights[0]


@pytest.fixture
def registered(bodies, tmp_path):
    """Return a folder of two bodies that carry the mark of registered scans, and one without."""
    for number, trusted in ((0, True), (20, True), (1, False)):
        marks = np.arange(bodies.template.n_vertices) > 5 if trusted else None
        save_mesh(
            tmp_path / f"body_{number}.ply", bodies.points[number], bodies.template.faces, marks
        )
    return tmp_path


def test_scanned_people_are_compared_in_any_pose(run, registered, bodies):
    """Unless another metric is asked for: it is chosen, said and recorded."""
    template = Template(bodies.points[0], bodies.template.faces)
    person = PersonMetric(AlignedSurfaces(template, equip=False))
    expected = person.dist(*bodies.points[[0, 20]])
    pair = registered / "body_0.ply", registered / "body_20.ply"
    finished = run("dist", *pair)
    assert float(finished.out) == pytest.approx(expected, rel=1e-9)
    assert "registered scans, so people are compared by PersonMetric (--person)" in finished.err
    assert "for comparison: same person, another pose ≈ 0.005; another person" in finished.err
    record = json.loads(run("dist", *pair, "--json").out)
    assert record["unit"] == "m"
    assert record["metric"] == {"name": "PersonMetric"}
    for options, weights in ((["--shape"], (1, 1e-4, 0)), (["-l", "1"], (1, 1, 0))):
        finished = run("dist", *pair, *options, "--any-scale")
        paper = metric_of(template, *weights).dist(*bodies.points[[0, 20]])
        assert float(finished.out) == pytest.approx(paper, rel=1e-9)
        assert finished.err == "riemhuman: the unit is that of the files\n"
    nearest = json.loads(run("retrieve", registered / "body_1.ply", registered, "--json").out)
    assert nearest["metric"]["name"] == "PersonMetric"


def test_metrics_of_scans_can_be_asked_for(run, scans, bodies):
    template = Template(bodies.points[0], bodies.template.faces)
    for option, cls in {"--area": AreaMetric, "--person": PersonMetric}.items():
        finished = run("dist", scans / NAMES[0], scans / NAMES[3], option, "--quiet")
        metric = cls(AlignedSurfaces(template, equip=False))
        expected = metric.dist(*bodies.points[[0, 20]])
        assert float(finished.out) == pytest.approx(expected, rel=1e-9)
        assert finished.err == ""
    assert "--area sets all weights" in run("dist", *[scans / NAMES[0]] * 2, "--area", "-c", 1).err


def test_matrix_is_that_of_the_library(run, scans, bodies, tmp_path):
    points = bodies.points[[0, 1, 2, 20, 21, 22]]
    template = Template(points[0], bodies.template.faces)
    aligned = procrustes(points, to=template.vertices)
    for options, weights, surfaces, precision in (
        ((), (1, 1e-4, 0), points, "double"),
        (("--pose", "--align", "--precision", "single"), (0, 0, 1), aligned, "single"),
    ):
        files = (tmp_path / f"{precision}.npz", tmp_path / f"{precision}.csv")
        finished = run("matrix", scans, "-o", files[0], "--csv", files[1], *options, "--json")
        assert finished.code == 0
        assert json.loads(finished.out)["names"] == NAMES
        expected = metric_of(template, *weights).dist_pairwise(surfaces, precision=precision)
        with np.load(files[0]) as saved:
            assert saved["names"].tolist() == NAMES
            np.testing.assert_array_equal(saved["distances"], expected)
            assert str(weights[0]) in str(saved["metric"])
        heading, *rows = [line.split(",") for line in files[1].read_text("utf-8").splitlines()]
        assert heading[1:] == [row[0] for row in rows] == NAMES
        np.testing.assert_array_equal(np.array([row[1:] for row in rows], float), expected)
    printed = run("matrix", scans, "--csv", "-", "--quiet")
    assert (printed.out, printed.err) == ((tmp_path / "double.csv").read_text("utf-8"), "")


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


def test_retrieve_ranks_by_dist(run, scans):
    query = scans / NAMES[4]
    record = json.loads(run("retrieve", query, scans, "--pose", "--json").out)
    found = [(result["file"], result["distance"]) for result in record["results"]]
    assert len(found) == 5
    assert str(query) not in [file for file, _ in found]
    assert [distance for _, distance in found] == sorted(distance for _, distance in found)
    assert found[0][0] == str(scans / NAMES[1])  # the other person in the same pose
    alone = json.loads(run("dist", query, found[0][0], "--pose", "--json").out)["distance"]
    assert found[0][1] == pytest.approx(alone, rel=1e-9)
    nearest = run("retrieve", query, scans, "--shape", "-k", "2").out.splitlines()
    assert {line.split()[2] for line in nearest} == {str(scans / NAMES[i]) for i in (3, 5)}


def test_dist_says_that_one_body_is_rotated(run, scans, bodies, tmp_path):
    rotated = tmp_path / "rotated.ply"
    save_mesh(rotated, bodies.points[1][:, [2, 1, 0]] * [1.0, 1.0, -1.0], bodies.template.faces)
    said = run("dist", scans / NAMES[0], rotated, "--pose").err
    aligned = float(run("dist", scans / NAMES[0], rotated, "--pose", "--align").out)
    assert "B is rotated relative to A" in said
    assert f"without the rotation, the distance is {aligned:.4g}" in said
    assert "rotated" not in run("dist", scans / NAMES[0], rotated, "--shape").err
    assert run("dist", scans / NAMES[0], rotated, "--pose", "--quiet").err == ""


# The commands tables, scores, plot, view and report.


def test_tables_of_a_labelled_folder(run, scans):
    finished = run("tables", "--bodies", scans, "--labels", scans / "labels.csv")
    assert "6 bodies: 2 people, 3 poses, 1,202 vertices, 2,400 triangles" in finished.out
    who, how = finished.out.split("How do they stand?")
    row = r"{} metric(?: \([^)]*\))? +(\d+\.\d)"
    found = {
        name: [float(re.search(row.format(name), part)[1]) for part in (who, how)]
        for name in ("shape", "pose", "area", "person")
    }
    assert found.pop("pose") == [0.0, 100.0]
    assert all(scores == [100.0, 0.0] for scores in found.values())


def test_all_representations(run, scans, monkeypatch):
    def compared(bodies):
        return {"height": Extents(), "offsets": VertexOffsets(AlignedSurfaces(bodies.template))}

    monkeypatch.setattr("riemhuman.retrieval.representations", compared)
    finished = run("tables", "--all", "--bodies", scans)
    assert re.search(r"^height .* \d+\.\d", finished.out, re.MULTILINE)
    records = json.loads(run("tables", "--all", "--bodies", scans, "--json").out)
    assert [record["representation"] for record in records] == 2 * ["height"] + 2 * ["offsets"]
    assert records[0]["scores"]["nn"] >= 0


@pytest.fixture(scope="module")
def matrix(scans, bodies, tmp_path_factory):
    """Return the file of a distance matrix of the scans."""
    file = tmp_path_factory.mktemp("matrix") / "D.npz"
    names = sorted((path.name for path in scans.glob("*.ply")), key=lambda name: int(name[5:-4]))
    places = np.random.default_rng(0).normal(size=(len(names), 3))
    distances = np.linalg.norm(places[:, None] - places, axis=-1)
    save_arrays(file, {"distances": distances, "names": np.array(names)})
    return file


def test_plot_shows_the_bodies_of_a_folder(run, refused, scans, matrix, tmp_path, monkeypatch):
    page, labels = tmp_path / "map.html", ["--labels", scans / "labels.csv"]
    options = ("--bodies", scans, "--by", "pose")
    assert run("plot", matrix, *labels, *options, "-o", page).code == 0
    assert page.read_text(encoding="utf-8").count("data-item=") == 6
    picture = tmp_path / "map.png"
    assert run("plot", matrix, *labels, "--bodies", scans, "-o", picture).code == 0
    assert "--bodies" in refused("plot", matrix, *labels, "-o", page, "--force")
    assert "hold" in refused("plot", matrix, "--bodies", tmp_path, "-o", picture, "--force")
    monkeypatch.setitem(sys.modules, "sklearn.manifold", None)
    assert "[report]'" in refused("plot", matrix, "--method", "t-sne", "-o", tmp_path / "b.png")


def test_scores_are_those_of_the_library(run, scans, matrix):
    finished = run("scores", matrix, "--labels", scans / "labels.csv", "--json")
    found = json.loads(finished.out)
    distances = load_arrays(matrix, ["distances"])["distances"]
    people = scores(distances, [0, 0, 0, 1, 1, 1])
    assert found["subject"]["nn"] == people.nn
    assert found["subject"]["mean_average_precision"] == people.mean_average_precision


def test_meshes_without_labels_are_left_out_if_they_may(run, refused, scans, matrix, tmp_path):
    table = tmp_path / "labels.csv"
    lines = (scans / "labels.csv").read_text(encoding="utf-8").splitlines()
    lines[-1] = lines[-1].replace("body_22.ply", "gone.ply")
    table.write_text("\n".join(lines), encoding="utf-8")
    given = ("scores", matrix, "--labels", table, "--json")
    assert "rows without a mesh: gone.ply" in refused(*given)
    found = json.loads(run(*given, "--allow-missing").out)
    distances = load_arrays(matrix, ["distances"])["distances"]
    assert found["subject"] == asdict(scores(distances[:5, :5], [0, 0, 0, 1, 1]))


def test_options_reach_the_report(run, scans, bodies, tmp_path, monkeypatch):
    asked = {}

    def make_report(output, **settings):
        asked.update(settings, output=output)
        return output / "index.html"

    monkeypatch.setattr("riemhuman.report.make_report", make_report)
    monkeypatch.setattr("riemhuman.cli._distance_commands._N_COMPONENTS", 4)
    rng = np.random.default_rng(0)
    frames = bodies[0] + 0.01 * rng.standard_normal((61, *bodies[0].shape), dtype=np.float32)
    with h5py.File(tmp_path / "registrations_m.hdf5", "w") as file:
        file["faces"] = bodies.template.faces
        file["50002_hips"] = np.moveaxis(frames, 0, -1)
    labels = scans / "labels.csv"
    arguments = ("--bodies", scans, "--labels", labels, "--dfaust", tmp_path, "-o", tmp_path)
    assert run("report", *arguments).out == f"{tmp_path / 'index.html'}\n"
    assert asked["bodies"].subject.tolist() == [1, 1, 1, 0, 0, 0]
    assert asked["bodies"].subject_names == ("athletic woman", "tall slim woman")
    expected = DeformationBasis.from_motions([frames], 4)
    np.testing.assert_allclose(asked["basis"].vectors, expected.vectors, atol=1e-9)
    assert asked["quick"] is False
    assert asked["scans"] is None
    monkeypatch.setattr("riemhuman.datasets.load_open_bodies", lambda *chosen: chosen)
    run("report", "--quick", "--open", "natural", "--people", 4, "--scans", tmp_path)
    assert asked["scans"] == tmp_path
    assert asked["bodies"] == ("coarse", "natural", 4)
    assert (asked["basis"], asked["quick"]) == (None, True)
    assert str(asked["output"]) == "riemhuman-report"


def test_a_map_that_misses_the_distances_is_not_drawn(run, refused, tmp_path):
    """Twelve bodies all equally far from each other: a plane holds three of those."""
    file, picture = tmp_path / "D.npz", tmp_path / "map.png"
    save_arrays(file, {"distances": 1 - np.eye(12), "names": np.array([*"abcdefghijkl"])})
    message = refused("plot", file, "-o", picture)
    assert "off by 35 %, and of the 5 bodies nearest to each, a map keeps 45 %" in message
    assert not picture.exists()


def test_people_are_drawn_though_a_plane_misses_their_distances(run, tmp_path, monkeypatch):
    """The matrix of a newcomer: distances of bodies, which are almost equal, as a table."""
    monkeypatch.chdir(tmp_path)
    bodies = coarse_bodies()[::4]
    metric = ElasticMetric(AlignedSurfaces(bodies.template, equip=False))
    names = [f"{name}.ply" for name in bodies.ids]
    distances = metric.dist_pairwise(bodies.points)
    (tmp_path / "D.csv").write_text(matrix_text(names, distances), encoding="utf-8")
    found = json.loads(run("plot", "D.csv", "--json").out)
    assert 0.3 < found["stress"] < 0.4
    assert found["neighbours_kept"] > 0.5
    # Columns in another order than rows, as spreadsheets leave them.
    order = np.random.default_rng(0).permutation(len(names))
    rows = [line.split(",") for line in (tmp_path / "D.csv").read_text("utf-8").splitlines()]
    shuffled = [";".join([row[0], *(row[1 + k] for k in order)]) for row in rows]
    (tmp_path / "other.tsv").write_text("\n".join(shuffled), encoding="utf-8")
    again = json.loads(run("plot", "other.tsv", "-o", "b.png", "--json").out)
    assert again == found | {"output": "b.png"}


def test_names_are_no_formulas_and_tables_matrices(refused, tmp_path):
    assert matrix_text(["=1+1.ply"], np.zeros((1, 1))).splitlines()[0] == "file,'=1+1.ply"
    file = tmp_path / "D.csv"
    for text, message in (
        ("", "holds no matrix"),
        ("file,a,b\na,0,1\n", "must have the same names"),
        ("file,a,a\na,0,1\na,1,0\n", "each once"),
        ("file,a,b\na,0,1\nb,x,0\n", "line 3: 'x' is not a number"),
    ):
        file.write_text(text, encoding="utf-8")
        assert message in refused("plot", file, "-o", tmp_path / "map.png")
