"""The commands transfer, disentangle, align, fit, basis and convert-model."""

import json

import h5py
import numpy as np
import pytest

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model, load_open_motions
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import load_mesh, save_mesh
from riemhuman.io.arrays import load_arrays
from riemhuman.solvers import MotionTransfer
from riemhuman.surfaces import DeformationBasis, Template
from riemhuman.surfaces.procrustes import procrustes


@pytest.fixture
def moved(bodies):
    """Return the third mesh moved as the first two."""
    space = AlignedSurfaces(Template(bodies.points[0], bodies.template.faces), equip=False)
    return MotionTransfer().solve(space, bodies.points[:2], bodies.points[20])


def test_motion_into_a_folder(run, scans, moved, tmp_path):
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    onto = scans / "body_20.ply"
    finished = run("transfer", *files, "--onto", onto, "-o", tmp_path / "moved", "--json")
    assert finished.code == 0, finished.err
    assert json.loads(finished.out)["n_frames"] == 2
    names = sorted(path.name for path in (tmp_path / "moved").iterdir())
    assert names == ["frame_0000.ply", "frame_0001.ply", "motion.html"]
    for name, frame in zip(names[:2], moved, strict=True):
        np.testing.assert_array_equal(load_mesh(tmp_path / "moved" / name)[0], frame)
    page = (tmp_path / "moved" / "motion.html").read_text(encoding="utf-8")
    assert "2 meshes, body_0.ply to body_1.ply, replayed on body_20.ply." in page
    again = ("transfer", *files, "--onto", onto, "-o", tmp_path / "moved", "-q")
    assert run(*again).code == 2
    (tmp_path / "moved" / names[1]).unlink()
    assert run(*again, "--force").code == 0
    assert (tmp_path / "moved" / names[1]).exists()


def test_motion_into_a_file(run, scans, moved, tmp_path):
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    onto = ("--onto", scans / "body_20.ply")
    finished = run("transfer", *files, *onto, "-o", tmp_path / "moved.npz")
    assert "meshes      2" in finished.out
    np.testing.assert_array_equal(np.load(tmp_path / "moved.npz")["path"], moved)
    assert run("transfer", *files, *onto, "-o", tmp_path / "moved.glb").code == 0
    assert (tmp_path / "moved.glb").read_bytes()[:4] == b"glTF"


def test_disentangled_body(run, scans, bodies, tmp_path):
    files = (scans / "body_0.ply", scans / "body_21.ply")
    finished = run("disentangle", *files, "-o", tmp_path / "both.ply", "--json")
    space = AlignedSurfaces(Template(bodies.points[0], bodies.template.faces), equip=False)
    metrics = ElasticMetric(space, 1.0, 1.0, 0.0), ElasticMetric(space, 0.0, 0.0, 1.0)
    both = load_mesh(tmp_path / "both.ply")[0]
    record = json.loads(finished.out)
    parts = (("shape_distance", 0, 21), ("pose_distance", 21, 0))
    for metric, (name, own, other) in zip(metrics, parts, strict=True):
        found = record[name]
        assert found == pytest.approx(float(metric.dist(both, bodies.points[own])))
        assert found < metric.dist(both, bodies.points[other])


# z up, in millimetres.
TURN = 1000 * np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]).T


@pytest.fixture
def turned(bodies, tmp_path):
    """Return a folder of meshes in millimetres with z up."""
    folder = tmp_path / "turned"
    folder.mkdir()
    for name, f in zip("ab", bodies.points[:2] @ TURN, strict=True):
        save_mesh(folder / f"{name}.ply", f, bodies.template.faces)
    return folder


def test_align_takes_out_rigid_motions(run, scans, bodies, tmp_path):
    finished = run("align", scans, "-o", tmp_path / "aligned", "--json")
    record = json.loads(finished.out)
    assert record["root_mean_square"][0] == pytest.approx(0, abs=1e-6)
    found, _ = load_mesh(tmp_path / "aligned" / "body_20.ply")
    np.testing.assert_allclose(found, procrustes(bodies.points[20], bodies.points[0]), atol=1e-6)
    assert (tmp_path / "aligned" / "aligned.html").exists()
    for system, unit, size in (("cm", "mm", 1e-3), ("in", "in", 0.0254)):
        said = run("align", scans, "-o", tmp_path / f"aligned_{system}", "--units", system).out
        shown = [line.split() for line in said.splitlines()[1:-1]]
        assert {row[1] for row in shown} == {unit}
        expected = np.array(record["root_mean_square"]) / size
        np.testing.assert_allclose([float(row[0]) for row in shown], expected, atol=0.051)


def test_units_and_axes_make_other_verbs_measure_the_same(run, turned, scans):
    ours = run("dist", scans / "body_0.ply", scans / "body_1.ply")
    theirs = run("dist", turned / "a.ply", turned / "b.ply", "--unit", "millimetres", "--up", "z")
    assert float(theirs.out) == pytest.approx(float(ours.out), rel=1e-5)


def test_labelled_folders_take_template_unit_and_what_is_there(run, refused, turned, scans):
    (turned / "labels.csv").write_text(
        "file,subject,pose\na.ply,anna,sits\nb.ply,anna,sits\nc.ply,ben,sits\n"
        "body_0.ply,ben,stands\n", encoding="utf-8",
    )  # fmt: skip
    options = ("--unit", "millimetres", "--up", "z", "--template", turned / "b.ply")
    assert "rows without a mesh" in refused("tables", "--bodies", turned, *options, "--json")
    finished = run("tables", "--bodies", turned, *options, "--allow-missing", "--json")
    assert finished.code == 0
    assert "shape metric (1, 0.0001, 0)" in finished.out


def test_fit_is_that_of_the_library(run, scans, bodies, tmp_path):
    output, picture = tmp_path / "fit.npz", tmp_path / "fit.html"
    options = ("--picture", picture, "--json")
    finished = run("fit", scans / "body_0.ply", scans / "body_20.ply", "-o", output, *options)
    assert finished.code == 0
    arrays = load_arrays(output, ["betas", "pose", "trans", "distances", "names"])
    assert arrays["names"].tolist() == ["body_0.ply", "body_20.ply"]
    model = bodies.model
    shown = model(arrays["betas"], arrays["pose"], arrays["trans"])
    gaps = np.linalg.norm(shown - bodies.points[[0, 20]], axis=-1)
    np.testing.assert_allclose(gaps, arrays["distances"], atol=1e-5)
    means = json.loads(finished.out)["mean_distance_mm"]
    np.testing.assert_allclose(means, 1000 * arrays["distances"].mean(axis=1))
    assert '"label":"body_20, model"' in picture.read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def knees():
    (motion,) = load_open_motions("coarse", "lean runner", "knees", frames_per_second=10)
    return motion


def write_frames(folder, knees, ending="ply"):
    folder.mkdir(parents=True)
    for number, frame in enumerate(knees):
        save_mesh(folder / f"frame{number}.{ending}", frame, knees.faces)
    return folder


def test_open_motions(run, tmp_path):
    output = tmp_path / "basis.npz"
    people = ("--subjects", "lean runner", "average man", "--sequences", "knees")
    options = ("--open", "--resolution", "coarse", *people, "-n", 4, "--step", 20, "--json")
    record = json.loads(run("basis", *options, "-o", output).out)
    motions = load_open_motions("coarse", ["lean runner", "average man"], "knees")
    expected = DeformationBasis.from_motions(motions, 4, 20)
    np.testing.assert_array_equal(DeformationBasis.load(output).vectors, expected.vectors)
    assert record["explained_variance"] == expected.explained_variance_ratio.sum()
    assert record["n_motions"] == 2
    assert record["n_frames"] == sum(map(len, motions))


def test_folders_of_meshes_are_motions(run, knees, tmp_path):
    expected = DeformationBasis.from_motions([knees[:]], 3, 2)
    one = write_frames(tmp_path / "knees", knees)
    for motions in ([one], [write_frames(tmp_path / "all" / "knees", knees, "off").parent]):
        finished = run("basis", *motions, "-o", tmp_path / "b.npz", "-n", 3, "--step", 2, "-f")
        assert finished.code == 0, finished.err
        found = DeformationBasis.load(tmp_path / "b.npz")
        np.testing.assert_array_equal(found.vectors, expected.vectors)
    assert "explained variance  0.9" in finished.out


def test_dynamic_faust(run, knees, tmp_path):
    with h5py.File(tmp_path / "registrations_m.hdf5", "w") as file:
        file["50002_knees"] = np.moveaxis(knees[:], 0, -1)
        file["50002_hips"] = np.moveaxis(knees[::-1], 0, -1)
        file["faces"] = knees.faces
    output = tmp_path / "b.npz"
    run("basis", tmp_path, "-o", output, "-n", 3, "--step", 2, "--sequences", "knees")
    expected = DeformationBasis.from_motions([knees[:]], 3, 2).vectors
    np.testing.assert_array_equal(DeformationBasis.load(output).vectors, expected)


def test_motions_of_one_basis_share_triangles_and_fit_the_step(refused, knees, tmp_path):
    output = ("-o", tmp_path / "basis.npz")
    frames = write_frames(tmp_path / "knees", knees)
    assert "step=500" in refused("basis", frames, *output, "--step", 500)
    assert "exceeds the rank" in refused("basis", frames, *output)
    other = tmp_path / "other"
    other.mkdir()
    for number in range(3):
        save_mesh(other / f"{number}.ply", knees[0], knees.faces[::-1])
    said = refused("basis", frames, other, *output)
    assert "with knees as the template, the triangles of other must be" in said
    save_mesh(frames / "frame4.ply", knees[0], knees.faces[::-1])
    assert "frame4.ply is not registered" in refused("basis", frames, *output, "--step", 1)


def test_models_become_plain_arrays_of_some_coefficients(run, tmp_path):
    original, target = load_open_model("coarse"), tmp_path / "model.npz"
    original.save(tmp_path / "open.npz")
    finished = run("convert-model", tmp_path / "open.npz", "-o", target, "--n-betas", 4)
    assert finished.code == 0, finished.err
    assert "shape coefficients  4" in finished.out
    betas = np.arange(4.0)
    expected = original(np.pad(betas, (0, original.n_betas - 4)))
    np.testing.assert_allclose(BodyModel.from_file(target)(betas), expected, atol=1e-12)
