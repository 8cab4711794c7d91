"""The commands of motions print and write what the library finds."""

import functools
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import riemhuman as rh


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three people raise a knee, one folder of meshes each."""
    root = tmp_path_factory.mktemp("motions")
    for motion, step in zip(
        rh.datasets.load_open_motions("coarse", sequences="knees")[:3], (6, 8, 10), strict=True
    ):
        name = root / motion.subject.replace(" ", "_")
        name.mkdir()
        for k, frame in enumerate(motion[:41:step]):
            rh.save_mesh(name / f"frame_{k:04d}.ply", frame, motion.faces)
    return root


@pytest.fixture(scope="module")
def people(folder):
    return sorted(folder.iterdir())


def test_distance_beside_usual_ones(run, people):
    finished = run("motions", "dist", *people[:2])
    m1, m2 = (rh.datasets.load_mesh_motions(folder)[0] for folder in people[:2])
    space = rh.AlignedSurfaces(rh.Template(m1[0], m1.faces))
    pose = rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    expected = rh.motions.DynamicTimeWarping(pose, between_frames=True).dist(m1, m2)
    assert float(finished.out) == pytest.approx(expected, rel=1e-7)
    same, other = map(float, re.findall(r"≈ ([0-9.]+)", finished.err))
    assert 0.0 < same < other


@pytest.mark.slow
def test_rotations_and_travel(run, people, tmp_path):
    rotations = json.loads(
        run("motions", "dist", *people[:2], "--metric", "rotation", "--json").out
    )
    m1, m2 = (rh.datasets.load_mesh_motions(folder)[0] for folder in people[:2])
    space = rh.AlignedSurfaces(rh.Template(m1[0], m1.faces))
    measure = rh.motions.DynamicTimeWarping(rh.RotationMetric(space), between_frames=True)
    assert rotations["distance"] == pytest.approx(measure.dist(m1, m2), rel=1e-9)
    carried = tmp_path / "carried"
    carried.mkdir()
    for k, frame in enumerate(m1):
        rh.save_mesh(carried / f"frame_{k}.ply", frame + [0.05 * k, 0.0, 0.0], m1.faces)
    still = float(run("motions", "dist", people[0], carried).out)
    travelling = float(run("motions", "dist", people[0], carried, "--travel", "1").out)
    assert still < 1e-6 < 0.5 < travelling


@pytest.mark.everyday("velocities")
@pytest.mark.parametrize("by", ["velocities", "rate-invariant"])
def test_matrix(run, folder, people, tmp_path, by):
    file = tmp_path / "D.npz"
    finished = run("motions", "matrix", folder, "-o", file, "--by", by, "-q")
    assert finished.code == 0, finished.err
    arrays = np.load(file)
    assert arrays["names"].tolist() == [place.name for place in people]
    single = run("motions", "dist", *people[:2], "--by", by, "-q")
    assert float(single.out) == pytest.approx(arrays["distances"][0, 1], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("by", ["warping", "rate-invariant"])
def test_the_page_of_an_alignment_has_both_motions_and_the_warp(run, people, monkeypatch, by):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    finished = run("motions", "align", *people[:2], "--by", by, "--json", "-q")
    page = Path(json.loads(finished.out)["page"])
    assert opened == [page.as_uri()]
    text = page.read_text(encoding="utf-8")
    shutil.rmtree(page.parent)
    assert people[0].name in text
    assert 'data-part="warp"' in text
    (lasts,) = re.findall(r'"lasts":\[(\d+),(\d+)\]', text)
    counts = [len(list(place.glob("*.ply"))) for place in people[:2]]
    assert [int(last) + 1 for last in lasts] == counts


def test_alignment(run, refused, folder, people, tmp_path):
    assert "one motion each; found 4" in refused("motions", "dist", folder, people[0])
    travel = ("--by", "rate-invariant", "--travel", "1")
    assert "--travel is for --by warping" in refused("motions", "dist", *people[:2], *travel)
    options = ("--n-times", "5", "-q")
    assert run("motions", "align", *people[:2], "-o", tmp_path / "both.npz", *options).code == 0
    arrays = np.load(tmp_path / "both.npz")
    assert arrays["first"].shape == arrays["second"].shape == (5, 1202, 3)
    assert (np.diff(arrays["second_times"]) >= 0).all()


def test_a_mean_that_did_not_converge_is_not_trusted(run, people, tmp_path, monkeypatch):
    hasty = functools.partial(rh.solvers.NearestSurface, max_iter=1, tolerance=1e-300)
    monkeypatch.setattr("riemhuman.motions.motion_statistics.NearestSurface", hasty)
    mean = tmp_path / "mean"
    command = ("motions", "mean", *people[:2], "-o", mean, "--n-times", "2", "-q")
    finished = run(*command)
    assert "NearestSurface stopped without converging" in finished.err
    assert finished.code == 1
    assert len(list(mean.glob("frame_*.ply"))) == 2
    assert '"n_frames":2' in (mean / "motion.html").read_text(encoding="utf-8")
    assert run(*command).code == 2


def test_where_a_motion_occurs(run, people):
    found = run("motions", "find", people[1], people[1], "-k", "1", "--json", "-q")
    (part,) = json.loads(found.out)
    assert (part["first"], part["last"]) == (0, 5)
    assert part["distance"] == pytest.approx(0.0, abs=1e-6)
    assert "seconds" not in part  # which meshes do not tell


def test_recordings(run, tmp_path):
    jump = Path(__file__).parents[1] / "mocap" / "recordings" / "cmu_01_01.bvh"
    text = jump.read_text().splitlines()
    start = next(k for k, line in enumerate(text) if line.startswith("Frames:"))
    part = [*text[:start], "Frames: 12", text[start + 1], *text[start + 22 : start + 34]]
    (tmp_path / "part.bvh").write_text("\n".join(part) + "\n")
    finished = run("motions", "find", tmp_path / "part.bvh", jump, "-k", "1", "--json", "-q")
    assert finished.code == 0, finished.err
    (found,) = json.loads(finished.out)
    assert abs(found["first"] - 20) <= 1
    assert abs(found["last"] - 31) <= 1
    rate = rh.datasets.load_bvh(jump).frames_per_second
    assert np.allclose(found["seconds"], np.array([found["first"], found["last"]]) / min(rate, 30))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:betas in the files")
def test_recordings_of_amass(run, tmp_path):
    fields = {"poses": np.zeros((8, 156)), "trans": np.zeros((8, 3)), "betas": np.zeros(16)}
    fields["poses"][:, 0], fields["trans"][:, 2] = np.pi / 2.0, 0.9  # upright along z
    fields |= {"gender": "neutral", "dmpls": np.zeros((8, 8))}
    fields |= {"markers_latent_vids": np.array({}, dtype=object)}
    np.savez(tmp_path / "a.npz", **fields, mocap_framerate=60.0)
    facts = json.loads(run("info", tmp_path / "a.npz", "--json").out)
    assert (facts["kind"], facts["frames"]) == ("motion of AMASS", 8)
    assert facts["left_out"] == "dmpls (soft tissue), markers_latent_vids"
    assert run("view", tmp_path / "a.npz", "-o", tmp_path / "a.html").code == 0
    assert '"n_frames":8' in (tmp_path / "a.html").read_text(encoding="utf-8")
