"""Folders of registered meshes: FAUST, labelled folders and motions, in every layout and unit."""

import shutil

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from riemhuman.datasets import Bodies, RegisteredMeshes, find_meshes, load_bodies, load_faust
from riemhuman.datasets.registered_meshes import natural_key
from riemhuman.errors import (
    ArgumentError,
    DegenerateSurfaceError,
    FileError,
    FileFormatError,
)
from riemhuman.io.meshes import save_mesh
from riemhuman.surfaces import Template, procrustes

LEVELS = ["", "registrations", "training/registrations", "MPI-FAUST/training/registrations"]
FILES = ["b2.ply", "b10.obj", "b11.off", "b20.ply"]
TABLE = (
    "file,subject,pose\nb2.ply,Ben,pose 10\nb10.obj,Anna,pose 2\nb11.off,Ben,pose 2\n"
    "b20.ply,Anna,pose 10\n"
)


@pytest.fixture(scope="module")
def mesh():
    """Return 100 registered surfaces, each of its own position, and their triangles."""
    rng = np.random.default_rng(5)
    sphere = trimesh.creation.icosphere(subdivisions=1)
    shapes = np.asarray(sphere.vertices) * [0.3, 0.9, 0.2]
    shapes = shapes + rng.normal(scale=0.02, size=(100, *shapes.shape))
    rotations = Rotation.from_rotvec(rng.normal(scale=0.2, size=(100, 3))).as_matrix()
    points = np.einsum("nij,nvj->nvi", rotations, shapes) + rng.normal(size=(100, 1, 3))
    return points, rng.permutation(np.asarray(sphere.faces))


@pytest.fixture
def folder(mesh, tmp_path):
    """Return a folder of four labelled meshes, beside files that are no meshes."""
    for name, points in zip(FILES, mesh[0], strict=False):
        save_mesh(tmp_path / name, points, mesh[1])
    (tmp_path / "labels.csv").write_text(TABLE, encoding="utf-8")
    (tmp_path / ".hidden.ply").touch()
    (tmp_path / "notes.txt").touch()
    (tmp_path / "inner").mkdir()
    save_mesh(tmp_path / "inner" / "b1.ply", mesh[0][0], mesh[1])
    return tmp_path


def write_faust(folder, mesh, ending="ply", numbers=range(100)):
    folder.mkdir(parents=True, exist_ok=True)
    for number in numbers:
        save_mesh(folder / f"tr_reg_{number:03d}.{ending}", mesh[0][number], mesh[1])
    return folder


@pytest.fixture(scope="module")
def faust(tmp_path_factory, mesh):
    return write_faust(tmp_path_factory.mktemp("faust"), mesh)


@pytest.fixture
def own_faust(faust, tmp_path):
    return shutil.copytree(faust, tmp_path / "registrations")


def test_natural_order(folder):
    ordered = ["", "1", "2", "10", "10a", "a", "a1b2", "A1b10", "a2", "a²", "b"]
    shuffled = [ordered[i] for i in (4, 10, 2, 7, 0, 9, 1, 8, 3, 6, 5)]
    assert sorted(shuffled, key=natural_key) == ordered
    assert [file.name for file in find_meshes(str(folder))] == FILES


def test_meshes_are_read_on_access(folder, mesh):
    meshes = RegisteredMeshes(find_meshes(folder))
    assert len(meshes) == 4
    np.testing.assert_array_equal(meshes[:], mesh[0][:4])
    np.testing.assert_array_equal(meshes[::-2], mesh[0][3::-2])
    np.testing.assert_array_equal(meshes.faces, mesh[1])
    assert meshes[4:].shape == (0, 42, 3)
    (folder / FILES[1]).unlink()
    np.testing.assert_array_equal(meshes[0], meshes.reference)
    with pytest.raises(FileError, match=r"b10\.obj"):
        meshes[:]


def test_the_first_mesh_that_differs_is_named(folder, mesh):
    files = find_meshes(folder)
    points, faces = mesh
    for vertices, triangles, difference in (
        (points[1], np.roll(faces, 1, axis=1), ".*corners are listed in another order"),
        (points[1], faces[1:], "79 triangles found, 80 expected"),
        (points[1], np.vstack([faces[:-1], faces[:1]]), "1 of 80 triangles differ, .*index 79: "),
        (np.vstack([points[1], points[1][:1]]), faces, "it has 43 vertices, that one has 42"),
    ):
        save_mesh(files[1], vertices, triangles)
        message = rf"b10\.obj is not registered to .*b2\.ply: {difference}.*riemhuman register"
        with pytest.raises(FileFormatError, match=message):
            RegisteredMeshes(files)[:]
    assert len(RegisteredMeshes(files[1:2])[:]) == 1
    with pytest.raises(FileFormatError, match=r"b10\.obj .* registered to .*b11\.off"):
        RegisteredMeshes(files[1:2], files[2])[:]


def test_folders_and_files_that_cannot_be_read(folder):
    with pytest.raises(FileError, match="no folder .*nowhere"):
        find_meshes(folder / "nowhere")
    (folder / "empty").mkdir()
    with pytest.raises(FileError, match=r"empty holds no mesh: .*\.ply, \.obj, \.off"):
        find_meshes(folder / "empty")
    with pytest.raises(ArgumentError, match="no mesh file"):
        RegisteredMeshes([])
    (folder / FILES[0]).write_bytes(b"ply\n")
    with pytest.raises(FileFormatError, match=r"b2\.ply"):
        RegisteredMeshes(find_meshes(folder))


def test_faust(faust, mesh):
    points, faces = mesh
    bodies = load_faust(faust)
    assert isinstance(bodies, Bodies)
    np.testing.assert_array_equal(bodies.points, procrustes(points, to=points[0]))
    np.testing.assert_array_equal(bodies.template.vertices, points[0])
    np.testing.assert_array_equal(bodies.template.faces, faces)
    np.testing.assert_array_equal(10 * bodies.subject + bodies.pose, np.arange(100))
    assert bodies.ids[7] == "tr_reg_007"
    np.testing.assert_array_equal(load_faust(faust, align=False).points, points)
    template = Template(points[2], faces)
    for given in (template, faust / "tr_reg_002.ply"):
        np.testing.assert_array_equal(
            load_faust(faust, given).points, procrustes(points, to=points[2])
        )


@pytest.mark.parametrize(("level", "ending"), [(0, "off"), (2, "obj"), (3, "ply")])
def test_faust_in_every_layout(mesh, tmp_path, level, ending):
    for folder in (tmp_path / LEVELS[level], tmp_path / "training" / "scans"):
        folder.mkdir(parents=True, exist_ok=True)
    write_faust(tmp_path / LEVELS[level], mesh, ending, numbers=range(3))
    (tmp_path / LEVELS[level] / "._tr_reg_000.ply").write_bytes(b"not a mesh")
    (tmp_path / LEVELS[level] / "tr_reg_000.png").write_bytes(b"not a mesh")
    bodies = load_faust(tmp_path, align=False, allow_missing=True)
    np.testing.assert_array_equal(bodies.points, mesh[0][:3])


def test_missing_registrations_of_faust_are_named(own_faust, mesh):
    missing = [1, 4, 20, 33, 50, 99]
    for number in missing:
        (own_faust / f"tr_reg_{number:03d}.ply").unlink()
    with pytest.raises(FileError, match=r"6 of 100 .*tr_reg_001, .*tr_reg_050 and 1 more; allow"):
        load_faust(own_faust)
    bodies = load_faust(own_faust, allow_missing=True, align=False)
    present = np.setdiff1d(np.arange(100), missing)
    np.testing.assert_array_equal(bodies.points, mesh[0][present])
    np.testing.assert_array_equal(10 * bodies.subject + bodies.pose, present)


def check_labels(bodies):
    assert bodies.subject_names == ("Anna", "Ben")
    assert bodies.pose_names == ("pose 2", "pose 10")
    assert bodies.subject.tolist() == [1, 0, 1, 0]
    assert bodies.pose.tolist() == [1, 0, 0, 1]


def test_a_labelled_folder(folder, mesh):
    points = mesh[0][:4]
    bodies = load_bodies(folder)
    check_labels(bodies)
    np.testing.assert_array_equal(bodies.points, procrustes(points, to=points[0]))
    np.testing.assert_array_equal(bodies.template.vertices, points[0])
    assert bodies.ids == ("b2", "b10", "b11", "b20")
    np.testing.assert_array_equal(load_bodies(folder, align=False, progress=True).points, points)
    template = Template(points[2], mesh[1])
    np.testing.assert_array_equal(
        load_bodies(folder, template=template).points, procrustes(points, to=points[2])
    )


BAD_TABLES = {
    "b10.obj renamed": (
        TABLE.replace("b10.obj", "b99.obj"),
        r"labels.csv does not match .*: meshes without a row: b10.obj; rows without a mesh: b99.o",
    ),
    "a file twice": (
        TABLE + "b10.obj,Ben,pose 2\n",
        "line 6: b10.obj already has a label, on line 3",
    ),
    "no subject": (TABLE.replace("Ben,pose 2", ",pose 2"), r"line 4: no subject given"),
}


@pytest.mark.parametrize("case", BAD_TABLES)
def test_tables_that_do_not_match(folder, case):
    text, message = BAD_TABLES[case]
    (folder / "labels.csv").write_text(text, encoding="utf-8")
    with pytest.raises(FileFormatError, match=message):
        load_bodies(folder)


def test_tables_that_cannot_be_read(folder):
    with pytest.raises(FileError, match="no table of labels .*absent.csv"):
        load_bodies(folder, folder / "absent.csv")
    (folder / "labels.csv").unlink()
    with pytest.raises(FileError, match=r"labels.csv; write one with the columns file, subject"):
        load_bodies(folder)


def test_missing_meshes_may_be_left_out(folder):
    table = folder / "some.csv"
    table.write_text(TABLE.replace("b10.obj,Anna", "b12.obj,Anna"), encoding="utf-8")
    assert load_bodies(folder, table, allow_missing=True).ids == ("b2", "b11", "b20")
    with pytest.raises(FileError, match=r"holds no registrations: .*training/registrations"):
        load_faust(folder, allow_missing=True)


def test_templates_and_meshes_that_do_not_fit(folder, mesh):
    points, faces = mesh
    with pytest.raises(FileFormatError, match=r"b2\.ply is not .* the template: 80 triangles fo"):
        load_bodies(folder, template=Template(points[0], faces[1:]))
    more = Template(np.vstack([points[0], [[9.0, 9.0, 9.0]]]), faces)
    with pytest.raises(FileFormatError, match="it has 42 vertices, that one has 43"):
        load_bodies(folder, template=more)
    flat = points[0].copy()
    flat[faces[3]] = flat[faces[3][0]]
    save_mesh(folder / FILES[0], flat, faces)
    with pytest.raises(DegenerateSurfaceError, match=FILES[0]):
        load_bodies(folder)


def test_quads_are_split_as_in_the_reference(tmp_path):
    """A quad that is convex in one pose and concave in another stays registered."""
    quads = np.array([[0, 1, 2, 3], [1, 0, 4, 2], [2, 4, 0, 3]])
    for name, place in (("a", 0.9), ("b", 0.2)):
        points = np.array([[0, 0, 0], [0, 1, 0], [place, place, 0], [1, 0, 0], [0, 0, -1.0]])
        lines = ["v {} {} {}\n".format(*row) for row in points]
        lines += ["f {} {} {} {}\n".format(*row) for row in quads + 1]
        (tmp_path / f"{name}.obj").write_text("".join(lines))
    files = [tmp_path / "b.obj", tmp_path / "a.obj"]
    assert RegisteredMeshes(files).faces.tolist() != RegisteredMeshes(files[::-1]).faces.tolist()
    assert RegisteredMeshes(files)[:].shape == RegisteredMeshes(files[::-1])[:].shape == (2, 5, 3)


def test_meshes_in_another_unit_are_refused(folder, mesh):
    template = Template(1000 * mesh[0][0], mesh[1])
    with (
        pytest.warns(UserWarning, match="the template is .* as a body in millimetres is"),
        pytest.raises(FileFormatError, match=r"b2\.ply is 1e\+03 times as small as the template"),
    ):
        load_bodies(folder, template=template)
    save_mesh(folder / FILES[2], 100 * mesh[0][2], mesh[1])
    with pytest.raises(FileFormatError, match=r"b11\.off is .*centimetres and the other in metres"):
        load_bodies(folder)
    bodies = load_bodies(folder, template=template, align=False, scale=None)
    np.testing.assert_array_equal(bodies.points[2], 100 * mesh[0][2])


def test_bodies_in_another_unit_alone_are_noticed(folder, mesh):
    for name, points in zip(FILES, mesh[0], strict=False):
        save_mesh(folder / name, 1000 * points, mesh[1])
    with pytest.warns(UserWarning, match=r"b2\.ply is .* as a body in millimetres is"):
        bodies = load_bodies(folder)
    converted = load_bodies(folder, unit="millimetres")
    np.testing.assert_allclose(bodies.points[0], 1000 * converted.points[0])
    assert load_bodies(folder, scale=None).points.shape == bodies.points.shape


def test_units_and_axes_are_converted(folder, mesh, tmp_path):
    rotated = tmp_path / "rotated"
    rotated.mkdir()
    for name, (x, y, z) in zip(FILES, np.moveaxis(mesh[0][:4], -1, 1), strict=True):
        save_mesh(rotated / name, 100 * np.stack([x, -z, y], axis=-1), mesh[1])
    (rotated / "labels.csv").write_text(TABLE, encoding="utf-8")
    bodies = load_bodies(rotated, unit="centimetres", up="z")
    np.testing.assert_allclose(bodies.points, load_bodies(folder).points, atol=1e-6)
