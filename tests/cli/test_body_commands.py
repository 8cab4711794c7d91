"""The commands transfer, disentangle, align, fit, basis and convert-model."""

import functools
import json

import h5py
import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model, load_open_motions
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.io import load_mesh, save_mesh
from riemhuman.io.arrays import load_arrays
from riemhuman.measurements import Measurements, in_standard_pose
from riemhuman.plots import on_the_ground
from riemhuman.solvers import BasisMean, BasisPath, MotionTransfer, TangentPCA
from riemhuman.surfaces import DeformationBasis, Template
from riemhuman.surfaces.procrustes import procrustes


def test_motions_into_a_folder_or_a_file(run, scans, bodies, tmp_path):
    space = AlignedSurfaces(Template(bodies.points[0], bodies.template.faces), equip=False)
    path = MotionTransfer().solve(space, bodies.points[:2], bodies.points[20])
    moved = on_the_ground(path, like=bodies.points[:2])
    files = [scans / f"body_{number}.ply" for number in (0, 1)]
    command = ("transfer", *files, "--onto", scans / "body_20.ply", "-o")
    finished = run(*command, tmp_path / "moved", "--json")
    assert json.loads(finished.out)["n_frames"] == 2
    names = sorted(path.name for path in (tmp_path / "moved").iterdir())
    assert names == ["frame_0000.ply", "frame_0001.ply", "motion.html"]
    for name, frame in zip(names[:2], moved, strict=True):
        np.testing.assert_array_equal(load_mesh(tmp_path / "moved" / name)[0], frame)
    page = (tmp_path / "moved" / "motion.html").read_text(encoding="utf-8")
    assert "2 meshes, body_0.ply to body_1.ply, replayed on body_20.ply." in page
    assert run(*command, tmp_path / "moved", "-q").code == 2
    (tmp_path / "moved" / names[1]).unlink()
    assert run(*command, tmp_path / "moved", "-q", "--force").code == 0
    assert (tmp_path / "moved" / names[1]).exists()
    run(*command, tmp_path / "moved.npz")
    np.testing.assert_array_equal(np.load(tmp_path / "moved.npz")["path"], moved)


def test_disentangled_body(run, scans, bodies, tmp_path):
    files = (scans / "body_0.ply", scans / "body_21.ply")
    finished = run("disentangle", *files, "-o", tmp_path / "both.ply", "--json")
    space = AlignedSurfaces(Template(bodies.points[0], bodies.template.faces), equip=False)
    metrics = ElasticMetric(space, 1.0, 1.0, 0.0), ElasticMetric(space, 0.0, 0.0, 1.0)
    both = load_mesh(tmp_path / "both.ply")[0]
    record = json.loads(finished.out)
    parts = (("shape_distance", 0, 21), ("pose_distance", 21, 0))
    for metric, (name, alike, unlike) in zip(metrics, parts, strict=True):
        found = record[name]
        assert found == pytest.approx(float(metric.dist(both, bodies.points[alike])))
        assert found < metric.dist(both, bodies.points[unlike])


def test_align_takes_out_rigid_motions(run, scans, bodies, tmp_path):
    files = [scans / f"body_{number}.ply" for number in (0, 20)]
    said = run("align", *files, "-o", tmp_path / "aligned", "--output-units", "in").out
    found, _ = load_mesh(tmp_path / "aligned" / "body_20.ply")
    np.testing.assert_allclose(found, procrustes(bodies.points[20], bodies.points[0]), atol=1e-6)
    assert (tmp_path / "aligned" / "aligned.html").exists()
    shown = [line.split() for line in said.splitlines()[1:-1]]
    assert {row[1] for row in shown} == {"in"}
    apart = np.sqrt(np.mean(np.sum((found - bodies.points[0]) ** 2, axis=-1)))
    np.testing.assert_allclose([float(row[0]) for row in shown], [0, apart / 0.0254], atol=0.051)


def test_units_and_axes_make_other_verbs_measure_the_same(run, bodies, scans, tmp_path):
    ours = run("dist", scans / "body_0.ply", scans / "body_1.ply")
    turned = 1000 * bodies.points[:2, :, [0, 2, 1]] * [1, -1, 1]  # z up, in millimetres
    files = [tmp_path / "a.ply", tmp_path / "b.ply"]
    for file, surface in zip(files, turned, strict=True):
        save_mesh(file, surface, bodies.template.faces)
    theirs = run("dist", *files, "--unit", "millimetres", "--up", "z")
    assert float(theirs.out) == pytest.approx(float(ours.out), rel=1e-5)


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
    return motion[:12]


def write_frames(folder, knees, faces, ending="ply"):
    folder.mkdir(parents=True)
    for number, frame in enumerate(knees):
        save_mesh(folder / f"frame{number}.{ending}", frame, faces)
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


def test_folders_of_meshes_are_motions(run, knees, bodies, tmp_path):
    expected, faces = DeformationBasis.from_motions([knees], 3, 2), bodies.template.faces
    one = write_frames(tmp_path / "knees", knees, faces)
    for motions in ([one], [write_frames(tmp_path / "all" / "knees", knees, faces, "off").parent]):
        finished = run("basis", *motions, "-o", tmp_path / "b.npz", "-n", 3, "--step", 2, "-f")
        assert finished.code == 0, finished.err
        found = DeformationBasis.load(tmp_path / "b.npz")
        np.testing.assert_array_equal(found.vectors, expected.vectors)
    assert "explained variance  0.9" in finished.out


def test_dynamic_faust(run, knees, bodies, tmp_path):
    with h5py.File(tmp_path / "registrations_m.hdf5", "w") as file:
        file["50002_knees"] = np.moveaxis(knees, 0, -1)
        file["50002_hips"] = np.moveaxis(knees[::-1], 0, -1)
        file["faces"] = bodies.template.faces
    output = tmp_path / "b.npz"
    run("basis", tmp_path, "-o", output, "-n", 3, "--step", 2, "--sequences", "knees")
    expected = DeformationBasis.from_motions([knees], 3, 2).vectors
    np.testing.assert_array_equal(DeformationBasis.load(output).vectors, expected)


def test_motions_of_one_basis_share_triangles_and_fit_the_step(refused, knees, bodies, tmp_path):
    output, faces = ("-o", tmp_path / "basis.npz"), bodies.template.faces
    frames = write_frames(tmp_path / "knees", knees, faces)
    assert "step=500" in refused("basis", frames, *output, "--step", 500)
    assert "exceeds the rank" in refused("basis", frames, *output)
    other = write_frames(tmp_path / "other", knees[:3], faces[::-1])
    said = refused("basis", frames, other, *output)
    assert "with knees as the template, the triangles of other must be" in said
    save_mesh(frames / "frame4.ply", knees[0], faces[::-1])
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


# The commands geodesic, mean and components write what the library finds, whole or not at all.


def test_folder_holds_meshes_pictures_animation_and_page(run, scans, bodies, tmp_path):
    output = tmp_path / "path"
    ends = scans / "body_0.ply", scans / "body_1.ply"
    options = ("-o", f"{output}/", "--n-nodes", 3, "--n-components", 6)
    finished = run("geodesic", *ends, *options, "--json")
    assert finished.code == 0, finished.err
    names = sorted(path.name for path in output.iterdir())
    pages = ["path.glb", "path.html", "path.npz", "path.png", "summary.json"]
    assert names == [*pages, *(f"time_{i:04d}.ply" for i in range(3))]
    template = Template(bodies.points[0], bodies.template.faces)
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=0.1)
    basis = DeformationBasis.from_laplacian(template, 6)
    result = BasisPath(basis, n_nodes=3).solve(metric, *bodies.points[:2])
    for i, surface in enumerate(on_the_ground(result.path)):
        np.testing.assert_array_equal(load_mesh(output / f"time_{i:04d}.ply")[0], surface)
    record = json.loads(finished.out)
    assert record["energy"] == result.energy
    assert record["length"] == metric.length(result.path)
    assert record["distance"] == metric.dist(result.path[0], result.path[-1])
    assert record["distance"] <= record["length"] <= record["energy"] ** 0.5 * (1 + 1e-12)
    assert record["converged"] is True
    summary = json.loads((output / "summary.json").read_text(encoding="utf-8"))
    assert record == summary | {"output": str(output)}
    assert json.loads(run("info", output, "--json").out)["first"] == "time_0000.ply"

    again = run("geodesic", *ends, *options)
    assert (again.code, again.out) == (2, "")
    assert "holds an earlier result; --force replaces it" in again.err


def test_one_file_by_its_ending_with_own_basis_and_metric(run, scans, bodies, tmp_path):
    ends = scans / "body_0.ply", scans / "body_1.ply"
    basis = DeformationBasis.from_laplacian(bodies.template, 6)
    basis.save(tmp_path / "basis.npz")
    options = ("--basis", tmp_path / "basis.npz", "-c", 0, "--n-nodes", 3, "--json", "-q")
    run("geodesic", *ends, "-o", tmp_path / "path.npz", *options)
    template = Template(bodies.points[0], bodies.template.faces)
    metric = ElasticMetric(AlignedSurfaces(template), a=1.0, lam=1.0, c=0.0)
    result = BasisPath(basis, n_nodes=3).solve(metric, *bodies.points[:2])
    stored = np.load(tmp_path / "path.npz")["path"]
    np.testing.assert_array_equal(stored, on_the_ground(result.path))


def test_a_path_that_did_not_converge_is_written_with_a_warning(run, scans, tmp_path, monkeypatch):
    ends = scans / "body_0.ply", scans / "body_1.ply"
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


@pytest.mark.slow
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
    definitions = Measurements(bodies.model).definitions
    points = in_standard_pose(definitions, np.stack([load_mesh(file)[0] for file in files]))
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
    assert (output / "components.html").exists()
    assert "holds an earlier result" in run(*command).err
