"""The verb components writes what the principal component analysis finds, whole or not at all."""

import json

import numpy as np
import pytest

from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import load_mesh, save_mesh
from riemhuman.statistics import TangentPCA
from riemhuman.surfaces import Template

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
def expected(bodies):
    """Return the one component that the library finds."""
    points = bodies.points[list(NUMBERS)]
    space = AlignedSurfaces(Template(points[0], bodies.template.faces))
    space.equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=0.0)
    return TangentPCA(space, 1).fit(points), points


def test_folder_holds_the_mean_its_neighbours_and_samples(run, standing, expected, tmp_path):
    output = tmp_path / "components"
    command = ("components", standing, "-o", f"{output}/", "-n", 1)
    finished = run(*command, "--samples", 1, "--seed", 3, "--json")
    assert finished.code == 0, finished.err
    names = sorted(path.name for path in output.iterdir())
    assert names == sorted([*BODIES, "components.html", "sample_0000.ply", "summary.json"])
    pca, points = expected
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


def test_a_terminal_shows_how_far_the_mean_is(run, standing, tmp_path, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    finished = run("components", standing, "-o", tmp_path / "components", "-n", 1)
    assert finished.code == 0
    assert "surface: " in finished.err
    assert " steps [" in finished.err


def test_failures(refused, standing, tmp_path):
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
