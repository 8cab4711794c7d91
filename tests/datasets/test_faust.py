"""The FAUST loader, on made-up registrations in every layout users have."""

import shutil

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from riemhuman.datasets import Bodies, load_faust
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileError, FileFormatError
from riemhuman.io.meshes import save_mesh
from riemhuman.surfaces import Template, procrustes

LEVELS = ["", "registrations", "training/registrations", "MPI-FAUST/training/registrations"]


@pytest.fixture(scope="module")
def mesh():
    """Return 100 registered surfaces, each lying differently, and their triangles."""
    rng = np.random.default_rng(5)
    sphere = trimesh.creation.icosphere(subdivisions=1)
    shapes = np.asarray(sphere.vertices) * [0.3, 0.9, 0.2]
    shapes = shapes + rng.normal(scale=0.02, size=(100, *shapes.shape))
    turns = Rotation.from_rotvec(rng.normal(scale=0.2, size=(100, 3))).as_matrix()
    points = np.einsum("nij,nvj->nvi", turns, shapes) + rng.normal(size=(100, 1, 3))
    return points, rng.permutation(np.asarray(sphere.faces))


def write_registrations(folder, mesh, ending="ply", numbers=range(100)):
    points, faces = mesh
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        save_mesh(folder / f"tr_reg_{number:03d}.{ending}", points[number], faces)
    return folder


@pytest.fixture(scope="module")
def registrations(mesh, tmp_path_factory):
    return write_registrations(tmp_path_factory.mktemp("faust"), mesh)


@pytest.fixture
def own_copy(registrations, tmp_path):
    return shutil.copytree(registrations, tmp_path / "registrations")


def test_order_subjects_and_poses(registrations, mesh):
    bodies = load_faust(registrations, align=False)
    assert isinstance(bodies, Bodies)
    assert len(bodies) == 100
    np.testing.assert_array_equal(bodies.points, mesh[0])
    np.testing.assert_array_equal(bodies.template.faces, mesh[1])
    assert (bodies.subject[37], bodies.pose[37]) == (3, 7)
    np.testing.assert_array_equal(10 * bodies.subject + bodies.pose, np.arange(100))
    assert len(set(bodies.subject_names)) == len(set(bodies.pose_names)) == 10
    assert bodies.model is None


def test_template_is_the_first_registration(registrations, mesh):
    bodies = load_faust(str(registrations))
    np.testing.assert_array_equal(bodies.template.vertices, mesh[0][0])
    np.testing.assert_array_equal(bodies.points, procrustes(mesh[0], to=mesh[0][0]))
    unaligned = load_faust(registrations, align=False)
    np.testing.assert_array_equal(unaligned.template.vertices, mesh[0][0])


def test_template_of_the_user_comes_first(registrations, mesh, tmp_path):
    points, faces = mesh
    template = Template(points[42], faces)
    template.save(tmp_path / "template.obj")
    for given in (template, tmp_path / "template.obj", str(tmp_path / "template.obj")):
        bodies = load_faust(registrations, given)
        np.testing.assert_array_equal(bodies.template.vertices, points[42])
        np.testing.assert_array_equal(bodies.points, procrustes(points, to=points[42]))
    assert load_faust(registrations, template).template is template
    np.testing.assert_array_equal(load_faust(registrations, template, align=False).points, points)


@pytest.mark.sampled(5)
@pytest.mark.parametrize("level", range(len(LEVELS)))
@pytest.mark.parametrize("ending", ["ply", "obj", "off", "PLY"])
def test_every_level_and_format(mesh, tmp_path, level, ending):
    write_registrations(tmp_path / LEVELS[level], mesh, ending)
    (tmp_path / LEVELS[level] / "._tr_reg_000.ply").write_bytes(b"not a mesh")
    (tmp_path / LEVELS[level] / "tr_reg_000.png").write_bytes(b"not a mesh")
    (tmp_path / "training" / "scans").mkdir(parents=True, exist_ok=True)
    bodies = load_faust(tmp_path, align=False)
    np.testing.assert_array_equal(bodies.points, mesh[0])


def test_a_folder_may_mix_formats_and_ply_comes_first(own_copy, mesh):
    write_registrations(own_copy, (mesh[0] + 1.0, mesh[1]), "obj", numbers=[3, 4])
    write_registrations(own_copy, (mesh[0] + 2.0, mesh[1]), "off", numbers=[4])
    (own_copy / "tr_reg_004.ply").unlink()
    offsets = load_faust(own_copy, align=False).points - mesh[0]
    np.testing.assert_allclose(offsets[[3, 4, 5], 0, 0], [0.0, 1.0, 0.0], atol=1e-15)


def test_missing_registrations_are_named(own_copy, mesh):
    for number in (1, 50, 99):
        (own_copy / f"tr_reg_{number:03d}.ply").unlink()
    with pytest.raises(FileError, match=r"3 of 100 .*tr_reg_001, tr_reg_050, tr_reg_099; allow"):
        load_faust(own_copy)
    bodies = load_faust(own_copy, allow_missing=True, align=False)
    kept = np.setdiff1d(np.arange(100), [1, 50, 99])
    np.testing.assert_array_equal(bodies.points, mesh[0][kept])
    np.testing.assert_array_equal(10 * bodies.subject + bodies.pose, kept)


def test_many_missing_registrations_are_counted(mesh, tmp_path):
    write_registrations(tmp_path, mesh, numbers=[7])
    with pytest.raises(FileError, match=r"99 of 100 .*tr_reg_004 and 94 more"):
        load_faust(tmp_path)
    assert len(load_faust(tmp_path, allow_missing=True)) == 1


def test_folders_without_registrations(tmp_path, registrations):
    with pytest.raises(FileError, match=r"no folder .*nowhere"):
        load_faust(tmp_path / "nowhere")
    with pytest.raises(FileError, match=r"is a file, not a folder"):
        load_faust(registrations / "tr_reg_000.ply")
    with pytest.raises(FileError, match=r"holds no registrations: .*training/registrations"):
        load_faust(tmp_path, allow_missing=True)
    with pytest.raises(ArgumentTypeError, match="folder must be the path of a folder; found 3"):
        load_faust(3)


def test_damaged_registration_is_named(own_copy):
    (own_copy / "tr_reg_012.ply").write_bytes(b"ply\n")
    with pytest.raises(FileFormatError, match=r"tr_reg_012\.ply"):
        load_faust(own_copy)


def test_registration_of_another_mesh_is_named(own_copy, mesh):
    points, faces = mesh
    save_mesh(own_copy / "tr_reg_012.ply", points[12][:, [1, 2, 0]], faces[::-1])
    with pytest.raises(FileFormatError, match=r"tr_reg_012\.ply .*tr_reg_000\.ply: .*index 0"):
        load_faust(own_copy)
    save_mesh(own_copy / "tr_reg_012.ply", np.vstack([points[12], points[12][:1]]), faces)
    with pytest.raises(
        FileFormatError, match=r"tr_reg_012\.ply .*tr_reg_000\.ply: it has 43 vertices.* 42"
    ):
        load_faust(own_copy)


def test_template_of_another_mesh_is_refused(registrations, mesh):
    points, faces = mesh
    with pytest.raises(ArgumentError, match=r"template must have the triangles .* 79 triangles"):
        load_faust(registrations, Template(points[0], faces[1:]))
    more = np.vstack([points[0], [[9.0, 9.0, 9.0]]])
    with pytest.raises(ArgumentError, match="template has 43 vertices; the meshes have 42"):
        load_faust(registrations, Template(more, faces))
    with pytest.raises(ArgumentTypeError, match="found 3"):
        load_faust(registrations, 3)
