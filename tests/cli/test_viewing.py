"""The verbs view, plot and scores, and the pictures that other verbs make."""

import json
from dataclasses import asdict

import numpy as np
import pytest

from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.retrieval import scores

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


def test_view_refuses(refused, scans, tmp_path):
    assert "must be .html" in refused("view", scans, "-o", tmp_path / "page.png")
    save_arrays(tmp_path / "other.npz", {"vectors": np.zeros(3)})
    assert "path" in refused("view", tmp_path / "other.npz", "-o", tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()


@pytest.mark.parametrize("options", [[], ["--by", "pose"], ["--method", "t-sne"]], ids=str)
def test_plot_draws_a_map(run, scans, matrix, tmp_path, options):
    picture = tmp_path / "map.svg"
    finished = run("plot", matrix, "--labels", scans / LABELS, "-o", picture, *options)
    assert finished.code == 0
    assert picture.read_text(encoding="utf-8").startswith("<?xml")
    assert ("stress" in finished.out) == ("--method" not in options)


def test_plot_needs_no_labels(run, matrix, tmp_path):
    assert run("plot", matrix, "-o", tmp_path / "map.png", "--quiet").code == 0
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


def test_scores_are_those_of_the_library(run, scans, matrix):
    finished = run("scores", matrix, "--labels", scans / LABELS, "--json")
    found = json.loads(finished.out)
    distances = load_arrays(matrix, ["distances"])["distances"]
    people = scores(distances, [0, 0, 0, 1, 1, 1])
    assert found["subject"]["nn"] == people.nn
    assert found["subject"]["mean_average_precision"] == people.mean_average_precision
    printed = run("scores", matrix, "--labels", scans / LABELS).out
    assert f"{people.first_tier:8.1f}" in printed.splitlines()[1]


def test_scores_refuse_labels_of_other_files(refused, matrix, tmp_path):
    table = tmp_path / "labels.csv"
    table.write_text("file,subject,pose\nother.ply,anna,sits\n", encoding="utf-8")
    assert "rows without a mesh: other.ply" in refused("scores", matrix, "--labels", table)


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
    assert finished.out.startswith("5 meshes")


@pytest.mark.parametrize("ending", [".png", ".html"])
def test_a_mean_makes_a_picture_too(run, scans, tmp_path, ending):
    picture = tmp_path / f"mean{ending}"
    meshes = [scans / f"body_{k}.ply" for k in (0, 20)]
    options = ("--n-components", 4, "--picture", picture)
    assert run("mean", *meshes, "-o", tmp_path / "mean.ply", *options).code == 0
    start = b"\x89PNG" if ending == ".png" else b"<!doctype html>"
    assert picture.read_bytes().startswith(start)


def test_a_picture_that_cannot_be_written_is_refused_before_the_work(refused, scans, tmp_path):
    output = tmp_path / "mean.ply"
    said = refused("mean", scans, "-o", output, "--picture", tmp_path / "mean.gif")
    assert "must be .png or .html" in said
    assert not output.exists()
