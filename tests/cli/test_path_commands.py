"""The commands geodesic, mean and components write what the library finds, whole or not at all."""

import functools
import json

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import load_mesh, save_mesh
from riemhuman.measurements import Measurements, in_standard_pose
from riemhuman.solvers import BasisMean, BasisPath, TangentPCA
from riemhuman.surfaces import DeformationBasis, Template, procrustes

FOLDER = ["path.glb", "path.html", "path.npz", "path.png", "summary.json"]


@pytest.fixture
def ends(scans):
    return scans / "body_0.ply", scans / "body_1.ply"


@pytest.fixture(scope="module")
def expected(bodies):
    """Return the metric and the path that the library finds with five times and six harmonics."""
    template = Template(bodies.points[0], bodies.template.faces)
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=0.1)
    basis = DeformationBasis.from_laplacian(template, 6)
    return metric, BasisPath(basis, n_nodes=5).solve(metric, *bodies.points[:2])


def test_folder_holds_meshes_pictures_animation_and_page(run, ends, expected, tmp_path):
    output = tmp_path / "path"
    options = ("-o", f"{output}/", "--n-nodes", 5, "--n-components", 6)
    finished = run("geodesic", *ends, *options, "--json")
    assert finished.code == 0, finished.err
    names = sorted(path.name for path in output.iterdir())
    assert names == [*FOLDER, *(f"time_{i:04d}.ply" for i in range(5))]
    metric, result = expected
    for i, surface in enumerate(result.path):
        np.testing.assert_array_equal(load_mesh(output / f"time_{i:04d}.ply")[0], surface)
    record = json.loads(finished.out)
    assert record["energy"] == result.energy
    assert record["length"] == metric.length(result.path)
    assert record["distance"] == metric.dist(result.path[0], result.path[-1])
    assert record["distance"] <= record["length"] <= record["energy"] ** 0.5 * (1 + 1e-12)
    assert record["converged"] is True
    summary = json.loads((output / "summary.json").read_text(encoding="utf-8"))
    assert record == summary | {"output": str(output)}
    assert (output / "path.png").read_bytes().startswith(b"\x89PNG")
    page = (output / "path.html").read_text(encoding="utf-8")
    assert "<p>From body_0.ply to body_1.ply in " in page
    assert (output / "path.glb").read_bytes().startswith(b"glTF")
    assert json.loads(run("info", output, "--json").out)["first"] == "time_0000.ply"

    again = run("geodesic", *ends, *options)
    assert (again.code, again.out) == (2, "")
    assert "holds an earlier result; --force replaces it" in again.err
    assert [path.name for path in tmp_path.iterdir()] == ["path"]


def test_one_file_by_its_ending_with_own_basis_and_metric(run, ends, bodies, tmp_path):
    basis = DeformationBasis.from_laplacian(bodies.template, 6)
    basis.save(tmp_path / "basis.npz")
    options = ("--basis", tmp_path / "basis.npz", "-c", 0, "--n-nodes", 3, "--json", "-q")
    record = json.loads(run("geodesic", *ends, "-o", tmp_path / "path.npz", *options).out)
    assert record["metric"] == {"name": "ElasticMetric", "a": 1.0, "lam": 1.0, "c": 0.0}
    template = Template(bodies.points[0], bodies.template.faces)
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=0.0)
    result = BasisPath(basis, n_nodes=3).solve(metric, *bodies.points[:2])
    assert record["energy"] == result.energy
    np.testing.assert_array_equal(np.load(tmp_path / "path.npz")["path"], result.path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["basis.npz", "path.npz"]


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
    finished = run("geodesic", *ends, "-o", output, "--n-nodes", 3, "--n-components", 3)
    assert finished.code == 1  # done, but not trusted
    assert "riemhuman: warning: BasisPath stopped without converging" in finished.err
    assert "converged   no, after 1 iteration\n" in finished.out
    assert output.exists()


def test_mean_is_that_of_the_library(run, scans, bodies, tmp_path):
    files = [scans / f"body_{number}.ply" for number in (0, 1, 20)]
    options = ("--n-components", 6, "--align", "--picture", tmp_path / "mean.html", "--json")
    finished = run("mean", *files, "-o", tmp_path / "mean.obj", *options)
    template = Template(bodies.points[0], bodies.template.faces)
    points = procrustes(bodies.points[[0, 1, 20]], to=template.vertices)
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=0.1)
    expected = BasisMean(DeformationBasis.from_laplacian(template, 6)).solve(metric, points)
    assert json.loads(finished.out)["variance"] == expected.variance
    vertices, faces = load_mesh(tmp_path / "mean.obj")
    np.testing.assert_array_equal(vertices, expected.point)
    np.testing.assert_array_equal(faces, bodies.template.faces)
    assert "Karcher mean" in (tmp_path / "mean.html").read_text(encoding="utf-8")


@pytest.mark.filterwarnings("always::riemhuman.errors.MixedPosesWarning")
def test_components_of_one_pose_and_of_several(run, scans, bodies, tmp_path):
    """Of several poses there is a warning; bodies in the standard pose are in one."""
    files = [scans / f"body_{number}.ply" for number in (0, 1, 20)]
    command = ("components", *files, "-n", 1, "--json")
    mixed = run(*command, "-o", f"{tmp_path / 'mixed'}/")
    assert mixed.code == 0
    assert "in different poses" in mixed.err
    assert "--standard-pose" in mixed.err
    straight = run(*command, "-o", f"{tmp_path / 'straight'}/", "--standard-pose")
    assert straight.code == 0
    assert "in different poses" not in straight.err
    assert json.loads(straight.out)["standard_pose"]
    own = Measurements(bodies.model).definitions
    points = in_standard_pose(own, np.stack([load_mesh(file)[0] for file in files]))
    mean = load_mesh(tmp_path / "straight" / "mean.ply")[0]
    # The mean of three people in the same pose is among them.
    distances = np.linalg.norm(procrustes(points, to=mean) - mean, axis=-1).mean(axis=-1)
    assert distances.max() < 0.06
    refused = run(*command, "-o", f"{tmp_path / 'more'}/", "--model", files[0])
    assert "--model needs --standard-pose" in refused.err


def test_components_are_those_of_the_library(run, tmp_path):
    output = tmp_path / "components"
    template = sphere_template()
    points, files = surfaces(template, 3, size=0.1), [tmp_path / f"{name}.ply" for name in "abc"]
    for file, surface in zip(files, points, strict=True):
        save_mesh(file, surface, template.faces)
    command = ("components", *files, "-o", f"{output}/", "-n", 1)
    finished = run(*command, "--samples", 1, "--seed", 3, "--json")
    assert finished.code == 0, finished.err
    space = AlignedSurfaces(Template(points[0], template.faces))
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.0)
    pca = TangentPCA(space, 1).fit(points)
    end = 2 * np.sqrt(pca.explained_variance_[0])
    less, more = pca.inverse_transform(np.array([[-end], [end]]))
    written = {"component_1_minus": less, "component_1_plus": more, "mean": pca.mean_}
    for name, surface in (written | {"sample_0000": pca.sample(1, 3)}).items():
        np.testing.assert_array_equal(load_mesh(output / f"{name}.ply")[0], surface)
    record = json.loads(finished.out)
    assert record["files"] == list(map(str, files))
    assert record["explained_variance_ratio"] == pca.explained_variance_ratio_.tolist()
    assert record["coordinates"] == pca.transform(points).tolist()
    assert {path.name for path in output.iterdir()} == {
        *("component_1_minus.ply", "component_1_plus.ply", "mean.ply", "sample_0000.ply"),
        *("components.html", "summary.json"),
    }
    assert "holds an earlier result" in run(*command).err
