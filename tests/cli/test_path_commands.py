"""The commands geodesic, mean and components write what the library finds, whole or not at all."""

import functools
import json
import sys

import numpy as np
import pytest

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import load_mesh, save_mesh
from riemhuman.solvers import BasisMean, BasisPath
from riemhuman.statistics import TangentPCA
from riemhuman.surfaces import DeformationBasis, Template, procrustes

FOLDER = ["path.glb", "path.html", "path.png", "summary.json"]


@pytest.fixture
def ends(scans):
    return scans / "body_0.ply", scans / "body_1.ply"


@pytest.fixture(scope="module")
def expected(bodies):
    """Return the metric and what the library finds with five times and twelve harmonics."""
    template = Template(bodies.points[0], bodies.template.faces)
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=0.1)
    basis = DeformationBasis.from_laplacian(template, 12)
    return metric, BasisPath(basis, n_nodes=5).solve(metric, *bodies.points[:2])


def test_folder_holds_meshes_pictures_animation_and_page(run, ends, expected, tmp_path):
    output = tmp_path / "path"
    options = ("-o", f"{output}/", "--n-nodes", 5, "--n-components", 12)
    finished = run("geodesic", *ends, *options, "--json")
    assert finished.code == 0, finished.err
    names = sorted(path.name for path in output.iterdir())
    assert names == [*FOLDER, *(f"time_{i:02d}.ply" for i in range(5))]
    metric, result = expected
    for i, surface in enumerate(result.path):
        np.testing.assert_array_equal(load_mesh(output / f"time_{i:02d}.ply")[0], surface)
    record = json.loads(finished.out)
    assert record["energy"] == result.energy
    assert record["length"] == metric.length(result.path)
    assert record["distance"] == metric.dist(result.path[0], result.path[-1])
    assert record["distance"] <= record["length"] <= record["energy"] ** 0.5 * (1 + 1e-12)
    assert record["converged"] is True
    summary = json.loads((output / "summary.json").read_text(encoding="utf-8"))
    assert summary == {key: record[key] for key in summary}
    assert (output / "path.png").read_bytes().startswith(b"\x89PNG")
    page = (output / "path.html").read_text(encoding="utf-8")
    assert "<p>From body_0.ply to body_1.ply in " in page
    assert f"no path is shorter than {json.loads(finished.out)['distance']:.4g}\u00a0m" in page
    assert (output / "path.glb").read_bytes().startswith(b"glTF")

    again = run("geodesic", *ends, *options)
    assert (again.code, again.out) == (2, "")
    assert "holds an earlier result; --force replaces it" in again.err
    (output / "time_04.ply").unlink()
    finished = run("geodesic", *ends, *options, "--force")
    assert finished.code == 0
    assert f"{result.energy:.8g}" in finished.out
    assert (output / "time_04.ply").exists()
    assert [path.name for path in tmp_path.iterdir()] == ["path"]


def test_one_file_by_its_ending(run, ends, expected, tmp_path):
    options = ("--n-nodes", 5, "--n-components", 12, "--quiet")
    for ending in ("npz", "glb"):
        finished = run("geodesic", *ends, "-o", tmp_path / f"path.{ending}", *options)
        assert (finished.code, finished.err) == (0, "")
    with np.load(tmp_path / "path.npz") as saved:
        np.testing.assert_array_equal(saved["path"], expected[1].path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["path.glb", "path.npz"]


def test_basis_and_metric_of_ones_own(run, ends, bodies, tmp_path):
    basis = DeformationBasis.from_laplacian(bodies.template, 6)
    basis.save(tmp_path / "basis.npz")
    options = ("--basis", tmp_path / "basis.npz", "-c", 0, "--n-nodes", 3, "--json")
    record = json.loads(run("geodesic", *ends, "-o", tmp_path / "path.npz", *options).out)
    assert record["metric"] == {"name": "elastic", "a": 1.0, "lam": 1.0, "c": 0.0}
    metric = ElasticMetric(
        AlignedSurfaces(Template(bodies.points[0], bodies.template.faces)), a=1.0, lam=1.0, c=0.0
    )
    result = BasisPath(basis, n_nodes=3).solve(metric, *bodies.points[:2])
    assert record["energy"] == result.energy


def test_failures_leave_nothing(refused, ends, scans, bodies, tmp_path, monkeypatch):
    assert "absent.ply" in refused("geodesic", ends[0], "absent.ply", "-o", tmp_path / "path")
    assert "n_nodes" in refused("geodesic", *ends, "-o", tmp_path / "path", "--n-nodes", 1)
    assert "no folder" in refused("geodesic", *ends, "-o", tmp_path / "absent" / "path")
    assert ".npz or / (a folder)" in refused("geodesic", *ends, "-o", tmp_path / "path.gif")
    assert list(tmp_path.iterdir()) == []
    assert "holds something else (body_0.ply)" in refused("geodesic", *ends, "-o", scans, "-f")
    small = tmp_path / "small.npz"
    DeformationBasis(np.ones((1, 2, 3)), orthonormalize=True).save(small)
    message = refused("geodesic", *ends, "-o", tmp_path / "path", "--basis", small)
    assert "small.npz: the basis belongs to another template" in message
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    message = refused("geodesic", *ends, "-o", tmp_path / "path.png")
    assert "pip install 'riemhuman[plot]'" in message
    assert list(tmp_path.iterdir()) == [small]


def test_interruption_while_writing_leaves_nothing(run, ends, tmp_path, monkeypatch):
    def interrupt(*arguments, **settings):
        raise KeyboardInterrupt

    monkeypatch.setattr("riemhuman.io.save_glb", interrupt)
    finished = run("geodesic", *ends, "-o", tmp_path / "path", "--n-nodes", 2)
    assert finished.code == 130
    assert finished.err.endswith("riemhuman: interrupted\n")
    assert list(tmp_path.iterdir()) == []


def test_a_path_that_did_not_converge_is_written_with_a_warning(run, ends, tmp_path, monkeypatch):
    hasty = functools.partial(BasisPath, max_iter=1, tolerance=1e-300)
    monkeypatch.setattr("riemhuman.solvers.BasisPath", hasty)
    output = tmp_path / "path.npz"
    finished = run("geodesic", *ends, "-o", output, "--n-nodes", 3, "--n-components", 3, "--json")
    assert finished.code == 1  # done, but not trusted
    assert "riemhuman: warning: BasisPath stopped without converging" in finished.err
    assert json.loads(finished.out)["converged"] is False
    assert output.exists()


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


def test_failures_of_mean(refused, scans, tmp_path):
    one = scans / "body_0.ply"
    assert "ending must be" in refused("mean", one, "-o", tmp_path / "mean.npz")
    assert "is a folder" in refused("mean", one, "-o", _folder(tmp_path / "mean.ply"))
    assert "exists; --force" in refused("mean", one, "-o", one)
    assert "absent.ply" in refused("mean", one, tmp_path / "absent.ply", "-o", tmp_path / "m.ply")
    assert [path.name for path in tmp_path.iterdir()] == ["mean.ply"]


def _folder(path):
    path.mkdir()
    return path


NUMBERS = (0, 20, 40, 60)
BODIES = ["component_1_minus.ply", "component_1_plus.ply", "mean.ply"]


@pytest.fixture(scope="module")
def standing(bodies, tmp_path_factory):
    """Return a folder of four people in one pose."""
    folder = tmp_path_factory.mktemp("standing")
    for number in NUMBERS:
        save_mesh(folder / f"body_{number}.ply", bodies.points[number], bodies.template.faces)
    return folder


@pytest.fixture(scope="module")
def expected_components(bodies):
    """Return the one component that the library finds."""
    points = bodies.points[list(NUMBERS)]
    space = AlignedSurfaces(Template(points[0], bodies.template.faces))
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.0)
    return TangentPCA(space, 1).fit(points), points


def test_folder_holds_the_mean_its_neighbours_and_samples(
    run, standing, expected_components, tmp_path
):
    output = tmp_path / "components"
    command = ("components", standing, "-o", f"{output}/", "-n", 1)
    finished = run(*command, "--samples", 1, "--seed", 3, "--json")
    assert finished.code == 0, finished.err
    names = sorted(path.name for path in output.iterdir())
    assert names == sorted([*BODIES, "components.html", "sample_0000.ply", "summary.json"])
    pca, points = expected_components
    end = 2 * np.sqrt(pca.explained_variance_[0])
    less, more = pca.inverse_transform(np.array([[-end], [end]]))
    meshes = [name for name in names if name.endswith(".ply")]
    for name, surface in zip(meshes, [less, more, pca.mean_, pca.sample(1, 3)], strict=True):
        np.testing.assert_array_equal(load_mesh(output / name)[0], surface)

    record = json.loads(finished.out)
    assert record["metric"] == {"name": "elastic", "a": 1.0, "lam": 1.0, "c": 0.0}
    assert record["files"] == [str(standing / f"body_{number}.ply") for number in NUMBERS]
    assert record["explained_variance_ratio"] == pca.explained_variance_ratio_.tolist()
    assert record["coordinates"] == pca.transform(points).tolist()
    summary = json.loads((output / "summary.json").read_text(encoding="utf-8"))
    assert record == summary | {"output": str(output)}

    again = run(*command)
    assert (again.code, again.out) == (2, "")
    assert "holds an earlier result; --force replaces it" in again.err
    finished = run(*command, "--force", "--pose", "--align")
    assert "Components of 4, (a, λ, c) = (0, 0, 1)" in finished.err
    assert finished.out.startswith("component 1  ")
    assert sorted(path.name for path in output.iterdir()) == sorted(
        [*BODIES, "components.html", "summary.json"]
    )
    assert [path.name for path in tmp_path.iterdir()] == ["components"]


def test_failures_of_components(refused, standing, tmp_path):
    output = ("-o", tmp_path / "out")
    assert "-n 4 needs at least 5 meshes" in refused("components", standing, *output, "-n", 4)
    assert "-n must be" in refused("components", standing, *output, "-n", 0)
    assert "--samples must be" in refused("components", standing, *output, "--samples", -1)
    assert "--seed must be" in refused("components", standing, *output, "--seed", -1)
    assert "absent" in refused("components", tmp_path / "absent", *output, "-n", 1)
    assert "holds something else" in refused("components", standing, "-o", standing)
    assert "leave it out" in refused("components", standing, *output, "--pose", "-a", 1)
    assert "λ of --shape is too small" in refused("components", standing, *output, "--shape")
    same = [standing / "body_0.ply"] * 2
    assert "all coincide" in refused("components", *same, *output, "-n", 1)
    assert list(tmp_path.iterdir()) == []
