"""Meshes of a folder with a table of labels."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from riemhuman.datasets import Bodies, load_bodies, load_open_bodies
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    DegenerateSurfaceError,
    FileError,
    FileFormatError,
)
from riemhuman.io import save_mesh
from riemhuman.surfaces import Template, procrustes
from riemhuman.surfaces.distortion import triangle_areas

FILES = ["b2.ply", "b10.obj", "b11.off", "b20.ply"]
TABLE = (
    "file,subject,pose\nb2.ply,Ben,pose 10\nb10.obj,Anna,pose 2\nb11.off,Ben,pose 2\n"
    "b20.ply,Anna,pose 10\n"
)


@pytest.fixture(scope="module")
def mesh():
    rng = np.random.default_rng(5)
    sphere = trimesh.creation.icosphere(subdivisions=1)
    shapes = np.asarray(sphere.vertices) * [0.3, 0.9, 0.2]
    shapes = shapes + rng.normal(scale=0.02, size=(4, *shapes.shape))
    turns = Rotation.from_rotvec(rng.normal(scale=0.2, size=(4, 3))).as_matrix()
    points = np.einsum("nij,nvj->nvi", turns, shapes) + rng.normal(size=(4, 1, 3))
    return points, rng.permutation(np.asarray(sphere.faces))


@pytest.fixture
def folder(mesh, tmp_path):
    for name, points in zip(FILES, mesh[0], strict=True):
        save_mesh(tmp_path / name, points, mesh[1])
    (tmp_path / "labels.csv").write_text(TABLE, encoding="utf-8")
    return tmp_path


def check_labels(bodies):
    assert isinstance(bodies, Bodies)
    assert bodies.subject_names == ("Anna", "Ben")
    assert bodies.pose_names == ("pose 2", "pose 10")
    assert bodies.subject.tolist() == [1, 0, 1, 0]
    assert bodies.pose.tolist() == [1, 0, 0, 1]


def test_points_labels_and_template(folder, mesh):
    bodies = load_bodies(folder)
    check_labels(bodies)
    np.testing.assert_array_equal(bodies.points, procrustes(mesh[0], to=mesh[0][0]))
    np.testing.assert_array_equal(bodies.template.vertices, mesh[0][0])
    np.testing.assert_array_equal(bodies.template.faces, mesh[1])
    unaligned = load_bodies(str(folder), align=False, progress=True)
    np.testing.assert_array_equal(unaligned.points, mesh[0])
    assert bodies.model is None


def test_template_of_the_user_comes_first(folder, mesh):
    template = Template(mesh[0][2], mesh[1])
    for given in (template, folder / "b11.off"):
        bodies = load_bodies(folder, template=given)
        np.testing.assert_array_equal(bodies.template.vertices, mesh[0][2])
        np.testing.assert_array_equal(bodies.points, procrustes(mesh[0], to=mesh[0][2]))
    unaligned = load_bodies(folder, template=template, align=False)
    np.testing.assert_array_equal(unaligned.points, mesh[0])


def test_default_template_is_a_body_not_a_mean_whose_arms_shrink(tmp_path):
    shown = load_open_bodies("coarse", "natural")
    rows = ["file,subject,pose"]
    for number, points in enumerate(shown.points):
        save_mesh(tmp_path / f"{number}.ply", points, shown.template.faces)
        rows.append(f"{number},{shown.subject[number]},{shown.pose[number]}")
    (tmp_path / "labels.csv").write_text("\n".join(rows), encoding="utf-8")
    bodies = load_bodies(tmp_path)
    usual = np.mean([triangle_areas(p, shown.template.faces) for p in shown.points], axis=0)
    kept = np.quantile(bodies.template.face_areas / usual, 0.25)
    assert kept > 0.9  # of the mean of all vertices a quarter of the triangles keep below 0.44


def test_without_alignment_none_is_looked_for(tmp_path):
    # An octahedron and its mirror image, which no single rotation brings closest together.
    vertices = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1.0]])
    faces = [[a, b, c] for a in (0, 1) for b in (2, 3) for c in (4, 5)]
    points = vertices * np.array([[[1, 1, 1]], [[1, 1, -1]]])
    for name, surface in zip(("a", "b"), points, strict=True):
        save_mesh(tmp_path / f"{name}.ply", surface, faces)
    (tmp_path / "labels.csv").write_text("file,subject,pose\na,1,1\nb,1,2", encoding="utf-8")
    np.testing.assert_array_equal(load_bodies(tmp_path, align=False).points, points)
    with pytest.raises(ArgumentError, match="no single best alignment"):
        load_bodies(tmp_path)


def test_first_mesh_without_area_is_named(folder, mesh):
    flat = mesh[0][0].copy()
    flat[mesh[1][3]] = flat[mesh[1][3][0]]
    save_mesh(folder / FILES[0], flat, mesh[1])
    with pytest.raises(DegenerateSurfaceError, match=FILES[0]):
        load_bodies(folder)


@pytest.mark.parametrize(
    "change",
    [
        lambda text: text.replace(",", ";"),
        lambda text: text.replace(",", "\t"),
        lambda text: "\ufeff" + text.replace("\n", "\r\n"),
        lambda text: text.replace("file,subject,pose", " File , SUBJECT,Pose"),
        lambda text: text.replace(".ply", "").replace(".obj", "").replace(".off", ""),
        lambda text: text.replace("\n", ",remark\n") + "\n,,\n",
        lambda text: "\n".join([text.splitlines()[0], *text.splitlines()[:0:-1]]),
        lambda text: text.replace("Anna", '"Anna"'),
    ],
)
def test_spellings_of_the_table(folder, change):
    (folder / "labels.csv").unlink()
    table = folder / "table.txt"
    table.write_bytes(change(TABLE).encode())
    check_labels(load_bodies(folder, table))


def test_columns_come_in_any_order(folder):
    rows = [line.split(",") for line in TABLE.splitlines()]
    text = "\n".join(f"{pose},1.8,{file},{subject}" for file, subject, pose in rows)
    (folder / "labels.csv").write_text(text, encoding="utf-8")
    check_labels(load_bodies(folder))


def test_tables_that_do_not_match(folder):
    table = folder / "labels.csv"

    def write(text):
        table.write_text(text, encoding="utf-8")

    write(TABLE.replace("b10.obj", "b99.obj"))
    with pytest.raises(
        FileFormatError,
        match=r"labels.csv does not match .*: meshes without a row: b10.obj; rows without a "
        "mesh: b99.obj",
    ):
        load_bodies(folder)
    write("file,subject,pose\n" + "".join(f"c{i},a,b\n" for i in range(7)))
    with pytest.raises(FileFormatError, match=r"b20.ply; rows .* c0, c1, c2, c3, c4 and 2 more"):
        load_bodies(folder)
    write(TABLE + "b10.obj,Ben,pose 2\n")
    with pytest.raises(FileFormatError, match="line 6: b10.obj has a label already, on line 3"):
        load_bodies(folder)
    write(TABLE.replace("Ben,pose 2", ",pose 2"))
    with pytest.raises(FileFormatError, match=r"line 4: no subject given"):
        load_bodies(folder)
    write(TABLE.replace("b20.ply,Anna,pose 10", "b20.ply"))
    with pytest.raises(FileFormatError, match="line 5: no subject and no pose given"):
        load_bodies(folder)
    write("file,who,pose\n")
    with pytest.raises(FileFormatError, match="lacks the columns subject; .* 'file,who,pose'"):
        load_bodies(folder)
    write("")
    with pytest.raises(FileFormatError, match="lacks the columns file, subject, pose"):
        load_bodies(folder)


def test_names_without_ending_that_are_ambiguous(folder, mesh):
    save_mesh(folder / "b2.obj", mesh[0][0], mesh[1])
    text = TABLE.replace("b2.ply", "b2") + "b2.obj,Ben,pose 2\n"
    (folder / "labels.csv").write_text(text, encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"line 2: b2 may be b2.obj, b2.ply; name one"):
        load_bodies(folder)


def test_tables_that_cannot_be_read(folder):
    with pytest.raises(FileError, match="no table of labels .*absent.csv"):
        load_bodies(folder, folder / "absent.csv")
    with pytest.raises(FileError, match="is a folder; a table"):
        load_bodies(folder, folder)
    with pytest.raises(ArgumentTypeError, match="labels must be the path of a file; found 3"):
        load_bodies(folder, 3)
    (folder / "labels.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(FileFormatError, match="not text in UTF-8"):
        load_bodies(folder)
    (folder / "labels.csv").unlink()
    with pytest.raises(FileError, match=r"labels.csv; write one with the columns file, subject"):
        load_bodies(folder)


def test_meshes_that_do_not_fit(folder, mesh):
    points, faces = mesh
    with pytest.raises(ArgumentError, match="template must have the triangles .* 79 triangles"):
        load_bodies(folder, template=Template(points[0], faces[1:]))
    more = Template(np.vstack([points[0], [[9.0, 9.0, 9.0]]]), faces)
    with pytest.raises(ArgumentError, match="template has 43 vertices; the meshes have 42"):
        load_bodies(folder, template=more)
    save_mesh(folder / "b11.off", points[0], faces[::-1])
    with pytest.raises(FileFormatError, match=r"b11.off is not registered to .*b2.ply"):
        load_bodies(folder)
    with pytest.raises(FileError, match="no folder"):
        load_bodies(folder / "absent")


def test_other_units_are_refused_unless_any_scale_is_meant(folder, mesh):
    template = Template(1000 * mesh[0][0], mesh[1])
    with pytest.raises(ArgumentError, match=r"the mesh\[0\] is 1e\+03 times as small as the temp"):
        load_bodies(folder, template=template)
    save_mesh(folder / FILES[2], 100 * mesh[0][2], mesh[1])
    with pytest.raises(FileFormatError, match=r"b11\.off is .*centimetres and the other in metres"):
        load_bodies(folder)
    bodies = load_bodies(folder, template=template, align=False, scale=None)
    np.testing.assert_array_equal(bodies.points[2], 100 * mesh[0][2])


def test_what_is_missing_may_be_left_out(folder):
    table = folder / "some.csv"
    table.write_text(TABLE.replace("b10.obj,Anna", "b12.obj,Anna"), encoding="utf-8")
    bodies = load_bodies(folder, table, allow_missing=True)
    assert bodies.ids == ("b2", "b11", "b20")
    whole = load_bodies(folder)
    np.testing.assert_array_equal(bodies.points, whole.points[[0, 2, 3]])
    table.write_text("file,subject,pose\nother.ply,Anna,sits\n", encoding="utf-8")
    with pytest.raises(FileFormatError, match="meshes without a row"):
        load_bodies(folder, table, allow_missing=True)


def test_units_and_axes_of_files(folder, mesh, tmp_path):
    turned = tmp_path / "turned"
    turned.mkdir()
    for name, (x, y, z) in zip(FILES, np.moveaxis(mesh[0], -1, 1), strict=True):
        save_mesh(turned / name, 100 * np.stack([x, -z, y], axis=-1), mesh[1])
    (turned / "labels.csv").write_text(TABLE, encoding="utf-8")
    found = load_bodies(turned, unit="centimetres", up="z")
    np.testing.assert_allclose(found.points, load_bodies(folder).points, atol=1e-6)
