"""The main job: what it prints, what it refuses."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

from riemhuman import retrieval
from riemhuman.__main__ import main
from riemhuman.datasets import Bodies, load_open_bodies
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import save_mesh


def test_prints_the_tables(capsys):
    assert main(["--resolution", "coarse"]) == 0
    printed = capsys.readouterr().out
    assert "100 bodies: 10 people, 10 poses, 1,202 vertices, 2,400 triangles" in printed
    assert len(re.findall(r"4,950 distances \.\.\. \d+\.\d s", printed)) == 5
    who, how = printed.split("How do they stand?")
    shape_on_people, shape_on_poses = (
        float(re.search(r"shape metric \(1, 0.0001, 0\)  +(\d+\.\d)", part)[1])
        for part in (who.split("Who is it?")[1], how)
    )
    pose_on_people, pose_on_poses = (
        float(re.search(r"pose metric \(0, 0, 1\)  +(\d+\.\d)", part)[1])
        for part in (who.split("Who is it?")[1], how)
    )
    assert shape_on_people > 90 > 20 > shape_on_poses
    assert pose_on_poses > 90 > 20 > pose_on_people


def test_reads_registrations(tmp_path, capsys):
    bodies = load_open_bodies("coarse")
    for i, points in enumerate(bodies.points):
        save_mesh(tmp_path / f"tr_reg_{i:03d}.ply", points, bodies.template.faces)
    assert main(["--faust", str(tmp_path)]) == 0
    registrations = capsys.readouterr().out
    assert main(["--resolution", "coarse"]) == 0
    embedded = capsys.readouterr().out

    def shape_row(text):
        return re.search(r"shape metric .*\d$", text, re.MULTILINE)[0]

    # The shape metric sees neither the template nor rigid motions.
    assert shape_row(registrations) == shape_row(embedded)


def test_reads_a_labelled_folder(tmp_path, capsys):
    bodies = load_open_bodies("coarse")
    rows = ["file,subject,pose"]
    for i in (0, 1, 20, 21):
        save_mesh(tmp_path / f"{i}.off", bodies.points[i], bodies.template.faces)
        rows.append(f"{i},person {i // 10},pose {i % 10}")
    (tmp_path / "table.csv").write_text("\n".join(rows), encoding="utf-8")
    labels = ["--labels", str(tmp_path / "table.csv")]
    assert main(["--bodies", str(tmp_path), *labels]) == 0
    printed = capsys.readouterr().out
    assert "4 bodies: 2 people, 2 poses, 1,202 vertices" in printed
    assert len(re.findall(r"shape metric \(1, 0.0001, 0\) +100.0  100.0", printed)) == 1
    assert main(["--bodies", str(tmp_path)]) == 2
    assert "labels.csv; write one with the columns" in capsys.readouterr().err
    assert main(labels) == 2
    assert "--labels needs --bodies FOLDER" in capsys.readouterr().err


def test_the_verb_is_optional(capsys):
    printed = []
    for arguments in (["--resolution", "coarse"], ["tables", "--resolution", "coarse"]):
        assert main(arguments) == 0
        printed.append(re.sub(r"\d+\.\d s", "", capsys.readouterr().out))
    assert printed[0] == printed[1]


def test_tables_as_json(capsys):
    assert main(["--resolution", "coarse", "--json"]) == 0
    captured = capsys.readouterr()
    tables = json.loads(captured.out)
    assert "4,950 distances" in captured.err
    scores = tables["Who is it?"]["shape metric (1, 0.0001, 0)"]
    assert (
        scores["nn"] > 90 > 20 > tables["How do they stand?"]["shape metric (1, 0.0001, 0)"]["nn"]
    )
    assert scores["n_queries"] == 100


def test_natural_and_other_people(capsys):
    choice = ["--resolution", "coarse", "--json", "--quiet", "--open", "natural"]
    found = []
    for options in ([], ["--people", "1"]):
        assert main([*choice, *options]) == 0
        tables = json.loads(capsys.readouterr().out)
        found.append(tables["How do they stand?"]["pose metric (0, 0, 1)"])
    people = [load_open_bodies("coarse", "natural", people=seed) for seed in (None, 1)]
    for scores, bodies in zip(found, people, strict=True):
        metric = ElasticMetric(AlignedSurfaces(bodies.template), a=0.0, lam=0.0, c=1.0)
        expected = retrieval.scores(metric.dist_pairwise(bodies.points), bodies.pose)
        assert scores["first_tier"] == pytest.approx(expected.first_tier)


def few_bodies(resolution):
    bodies = load_open_bodies(resolution)
    chosen = [0, 2, 80, 82]
    return Bodies(
        points=bodies.points[chosen],
        subject=bodies.subject[chosen],
        pose=bodies.pose[chosen],
        template=bodies.template,
        model=bodies.model,
        subject_names=bodies.subject_names,
        pose_names=bodies.pose_names,
    )


def test_all_representations(monkeypatch, capsys):
    few = few_bodies("coarse")
    monkeypatch.setattr("riemhuman.datasets.load_open_bodies", lambda *of: few)
    assert main(["--all", "--resolution", "coarse"]) == 0
    printed = capsys.readouterr().out
    who, how = printed.split("How do they stand?")
    for name in ("shape metric", "SRNF", "model shape vector", "APT", "ShapeDNA", "HKS", "WKS"):
        assert re.search(rf"^{name}.* \d+\.\d", who, re.MULTILINE), name
    assert re.search(r"^(Better|Nothing is better) than pose metric \(0, 0, 1\)", how, re.MULTILINE)
    assert re.search(r"^shape code, trained here.* \d+\.\d", who, re.MULTILINE)
    assert "GDVAE intrinsic 27.0, 24.8, 46.2 (shape)" in how
    assert "failed" not in printed

    assert main(["--all", "--resolution", "coarse", "--json"]) == 0
    records = json.loads(capsys.readouterr().out)
    assert {"representation": "HKS", "task": "shape"}.items() <= records[-6].items()
    assert records[-6]["scores"]["nn"] == 100.0


def test_quiet_prints_tables_alone(capsys):
    assert main(["--resolution", "coarse", "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    assert "distances" not in captured.out
    assert "How do they stand?" in captured.out


def test_refuses_a_missing_folder(tmp_path, capsys):
    assert main(["--faust", str(tmp_path / "absent")]) == 2
    captured = capsys.readouterr()
    assert "absent" in captured.err
    assert "Traceback" not in captured.err


def test_keyboard_interrupt_ends_quietly(monkeypatch, capsys):
    def interrupt(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("riemhuman.datasets.load_open_bodies", interrupt)
    assert main([]) == 130
    assert capsys.readouterr().err == "riemhuman: interrupted\n"


def test_runs_as_a_module():
    finished = subprocess.run(
        [sys.executable, "-m", "riemhuman", "--help"], capture_output=True, text=True, check=True
    )
    assert "--faust FOLDER" in finished.stdout


@pytest.mark.parametrize("arguments", [["--resolution", "huge"], ["unknown"]])
def test_usage_errors(arguments):
    with pytest.raises(SystemExit, match="2"):
        main(arguments)


def test_matrices_are_those_of_dist():
    from riemhuman.geometry import AlignedSurfaces, ElasticMetric

    bodies = load_open_bodies("coarse")
    metric = ElasticMetric(AlignedSurfaces(bodies.template))
    few = bodies.points[::33]
    distances = metric.dist(few[:, None], few[None])
    for precision, tolerance in (("double", 1e-12), ("single", 1e-5)):
        found = metric.dist_pairwise(few, precision=precision)
        np.testing.assert_allclose(found, distances, rtol=tolerance, atol=0)
