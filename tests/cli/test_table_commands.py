"""The commands tables, scores, plot, view and report."""

import json
import re
from dataclasses import asdict

import h5py
import numpy as np
import pytest
from third_party import Extents, VertexOffsets

from riemhuman.geometry import AlignedSurfaces
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.meshes import save_mesh
from riemhuman.registration import simulated_scan
from riemhuman.retrieval import scores
from riemhuman.surfaces import DeformationBasis


def test_tables_of_a_labelled_folder(run, scans):
    finished = run("tables", "--bodies", scans, "--labels", scans / "labels.csv")
    assert "6 bodies: 2 people, 3 poses, 1,202 vertices, 2,400 triangles" in finished.out
    assert len(re.findall(r"15 distances: \d+\.\d s", finished.err)) == 6
    who, how = finished.out.split("How do they stand?")
    row = r"{} metric(?: \([^)]*\))? +(\d+\.\d)"
    found = {
        name: [float(re.search(row.format(name), part)[1]) for part in (who, how)]
        for name in ("shape", "pose", "area")
    }
    assert found == {"shape": [100.0, 0.0], "pose": [0.0, 100.0], "area": [100.0, 0.0]}


def test_all_representations(run, scans, monkeypatch):
    def compared(bodies):
        return {"height": Extents(), "offsets": VertexOffsets(AlignedSurfaces(bodies.template))}

    monkeypatch.setattr("riemhuman.retrieval.representations", compared)
    finished = run("tables", "--all", "--bodies", scans)
    assert re.search(r"^height .* \d+\.\d", finished.out, re.MULTILINE)
    assert "an asterisk marks the best of a column" in finished.out
    records = json.loads(run("tables", "--all", "--bodies", scans, "--json").out)
    assert [record["representation"] for record in records] == 2 * ["height"] + 2 * ["offsets"]
    assert records[0]["scores"]["nn"] >= 0


LABELS = "labels.csv"


@pytest.fixture(scope="module")
def matrix(scans, bodies, tmp_path_factory):
    """Return the file of a distance matrix of the scans."""
    file = tmp_path_factory.mktemp("matrix") / "D.npz"
    names = sorted((path.name for path in scans.glob("*.ply")), key=lambda name: int(name[5:-4]))
    places = np.random.default_rng(0).normal(size=(len(names), 3))
    distances = np.linalg.norm(places[:, None] - places, axis=-1)
    save_arrays(file, {"distances": distances, "names": np.array(names)})
    return file


def test_view_lays_a_scan_over_its_body_in_either_order(run, refused, bodies, tmp_path):
    faces = bodies.template.faces
    scan = simulated_scan(bodies.points[0], faces, rng=0, n_points=3000)
    save_mesh(tmp_path / "body.ply", bodies.points[0], faces)
    np.save(tmp_path / "scan.npy", 1000.0 * scan.points)
    for files in (("scan.npy", "body.ply"), ("body.ply", "scan.npy")):
        page = tmp_path / "over.html"
        finished = run("view", *[tmp_path / name for name in files], "-o", page, "--force")
        assert finished.code == 0
        assert "scan.npy over body.ply" in page.read_text(encoding="utf-8")
    np.save(tmp_path / "other.npy", np.random.default_rng(0).uniform(0, 1.7, (2000, 3)))
    message = refused("view", tmp_path / "other.npy", tmp_path / "body.ply", "-o", page, "-f")
    assert "does not lie over the body" in message


def test_view_shows_meshes_motions_and_paths(run, scans, bodies, tmp_path):
    page = tmp_path / "both.html"
    finished = run("view", scans / "body_0.ply", scans / "body_1.ply", "-o", page)
    assert (finished.code, finished.out) == (0, f"{page}\n")
    assert '"label":"body_0"' in page.read_text(encoding="utf-8")
    run("view", scans, "--motion", "-o", tmp_path / "motion.html")
    assert '"n_frames":6' in (tmp_path / "motion.html").read_text(encoding="utf-8")
    arrays = {"path": bodies.points[:3], "faces": bodies.template.faces}
    save_arrays(tmp_path / "path.npz", arrays)
    run("view", tmp_path / "path.npz", "-o", tmp_path / "path.html")
    assert '"n_frames":3' in (tmp_path / "path.html").read_text(encoding="utf-8")
    # The folder of a geodesic holds its path, beside meshes or without them.
    run("view", tmp_path, "-o", tmp_path / "folder.html")
    page = (tmp_path / "folder.html").read_text(encoding="utf-8")
    assert '"n_frames":3' in page
    assert f"<title>{tmp_path.name}</title>" in page
    run("view", tmp_path, "-o", tmp_path / "path.png")
    assert (tmp_path / "path.png").read_bytes().startswith(b"\x89PNG")


def test_pages_are_not_written_under_the_ending_of_something_else(refused, scans, tmp_path):
    for name in ("a.avi", "a.glb"):
        message = refused("view", scans / "body_0.ply", "-o", tmp_path / name)
        assert ".html" in message
        assert name in message
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("options", [["--by", "pose"], ["--method", "t-sne"]], ids=str)
def test_plot_draws_a_map(run, scans, matrix, tmp_path, options):
    picture = tmp_path / "map.svg"
    finished = run("plot", matrix, "--labels", scans / LABELS, "-o", picture, *options)
    assert finished.code == 0
    assert picture.read_text(encoding="utf-8").startswith("<?xml")
    assert ("stress" in finished.out) == ("--method" not in options)


def test_plot_shows_the_bodies_of_a_folder(run, refused, scans, matrix, tmp_path):
    page, labels = tmp_path / "map.html", ["--labels", scans / LABELS]
    assert run("plot", matrix, *labels, "--bodies", scans, "-o", page).code == 0
    assert page.read_text(encoding="utf-8").count("data-item=") == 6
    picture = tmp_path / "map.png"
    assert run("plot", matrix, *labels, "--bodies", scans, "-o", picture).code == 0
    message = refused("plot", matrix, *labels, "-o", page, "--force")
    assert "--bodies" in message
    message = refused("plot", matrix, "--bodies", tmp_path, "-o", picture, "--force")
    assert "holds no" in message or "does not hold" in message


def test_plot_without_labels_names_points_by_files_and_explains_its_scale(
    run, matrix, tmp_path, monkeypatch
):
    figures = []
    save = "riemhuman.plots.figures.save_figure"
    monkeypatch.setattr(save, lambda figure, file: figures.append(figure))
    assert run("plot", matrix, "-o", tmp_path / "map.png", "--quiet").code == 0
    (ax,) = figures[0].axes
    texts = [text.get_text() for text in ax.texts]
    assert {f"body_{number}" for number in (0, 1, 2, 20, 21, 22)} <= set(texts)
    assert "under the metric, in metres" in ax.get_xlabel()


def test_scores_are_those_of_the_library(run, scans, matrix):
    finished = run("scores", matrix, "--labels", scans / LABELS, "--json")
    found = json.loads(finished.out)
    distances = load_arrays(matrix, ["distances"])["distances"]
    people = scores(distances, [0, 0, 0, 1, 1, 1])
    assert found["subject"]["nn"] == people.nn
    assert found["subject"]["mean_average_precision"] == people.mean_average_precision
    printed = run("scores", matrix, "--labels", scans / LABELS).out
    assert printed.splitlines()[0] == f"Who is it?          {people}"


def test_meshes_without_labels_are_left_out_if_they_may(run, refused, scans, matrix, tmp_path):
    table = tmp_path / "labels.csv"
    lines = (scans / LABELS).read_text(encoding="utf-8").splitlines()
    table.write_text("\n".join([*lines[:-1], "gone.ply,cleo,sits"]), encoding="utf-8")
    given = ("scores", matrix, "--labels", table, "--json")
    assert "rows without a mesh: gone.ply" in refused(*given)
    found = json.loads(run(*given, "--allow-missing").out)
    distances = load_arrays(matrix, ["distances"])["distances"]
    assert found["subject"] == asdict(scores(distances[:5, :5], [0, 0, 0, 1, 1]))
    picture = tmp_path / "map.png"
    finished = run("plot", matrix, "--labels", table, "--allow-missing", "-o", picture)
    assert finished.out.startswith("meshes      5")


def test_options_reach_the_report(run, scans, bodies, tmp_path, monkeypatch):
    asked = {}

    def make_report(output, **settings):
        asked.update(settings, output=output)
        return output / "index.html"

    monkeypatch.setattr("riemhuman.report.make_report", make_report)
    rng = np.random.default_rng(0)
    frames = bodies[0] + 0.01 * rng.standard_normal((1011, *bodies[0].shape), dtype=np.float32)
    with h5py.File(tmp_path / "registrations_m.hdf5", "w") as file:
        file["faces"] = bodies.template.faces
        file["50002_hips"] = np.moveaxis(frames, 0, -1)
    labels = scans / "labels.csv"
    arguments = ("--bodies", scans, "--labels", labels, "--dfaust", tmp_path, "-o", tmp_path)
    assert run("report", *arguments).out == f"{tmp_path / 'index.html'}\n"
    assert asked["bodies"].subject.tolist() == [1, 1, 1, 0, 0, 0]
    assert asked["bodies"].subject_names == ("athletic woman", "tall slim woman")
    expected = DeformationBasis.from_motions([frames], 100)
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
    assert "distances are off by two thirds; --method t-sne" in message
    assert not picture.exists()
