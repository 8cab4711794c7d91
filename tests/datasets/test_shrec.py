"""Class files and folders of meshes in the layouts people have, whole and damaged."""

import numpy as np
import pytest
from known_surfaces import sphere

from riemhuman.datasets import LabelledMeshes, load_shrec14
from riemhuman.datasets.shrec import read_classes
from riemhuman.descriptors import ShapeDNA
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io import save_mesh

CLASSES = "PSB 1\n2 5\n\nanna 0 3\n0\n1\n2\n\nbert 0 2\n3\n4\n"


def mesh_of(number):
    """Return a mesh with its own number of vertices, of its subject's width."""
    vertices, faces = sphere(1 + number % 2)
    return vertices * [1.0 + (number >= 3), 2.0, 1.0 + 0.01 * number], faces


def write_meshes(folder, names, ending="obj"):
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(names):
        save_mesh(folder / f"{name}.{ending}", *mesh_of(number))
    return folder


@pytest.fixture
def data(tmp_path):
    folder = write_meshes(tmp_path / "Real" / "Data", map(str, range(5)))
    (tmp_path / "Real" / "test.cla").write_text(CLASSES)
    return folder.parent


def test_labels_and_meshes(data):
    meshes = load_shrec14(data, scale=0.001)
    assert isinstance(meshes, LabelledMeshes)
    assert len(meshes) == 5
    assert meshes.subject.tolist() == [0, 0, 0, 1, 1]
    assert meshes.subject_names == ("anna", "bert")
    assert meshes.ids == ("0", "1", "2", "3", "4")
    for number, (vertices, faces) in enumerate(meshes):
        np.testing.assert_allclose(vertices, 0.001 * mesh_of(number)[0], rtol=1e-15)
        np.testing.assert_array_equal(faces, mesh_of(number)[1])
    np.testing.assert_array_equal(meshes[-1][0], meshes[4][0])


def test_formats_have_an_order_and_hidden_files_do_not_count(data):
    write_meshes(data / "Data", ["0"], "off")
    write_meshes(data / "Data", ["0"], "ply")
    (data / "Data" / "._1.obj").write_bytes(b"not a mesh")
    (data / "._test.cla").write_bytes(b"not a class file")
    files = load_shrec14(data).files
    assert [file.name for file in files] == ["0.ply", "1.obj", "2.obj", "3.obj", "4.obj"]


def test_nothing_is_left_out_silently(data):
    (data / "Data" / "1.obj").unlink()
    (data / "Data" / "4.obj").unlink()
    with pytest.raises(FileError, match=r"lacks 2 of the 5 .*test.cla lists: 1, 4$"):
        load_shrec14(data)


def test_damaged_meshes_are_named(data):
    (data / "Data" / "3.obj").write_text("v 0 0 zero\n")
    (data / "Data" / "1.obj").write_text("")
    meshes = load_shrec14(data)
    with pytest.raises(FileFormatError, match=r"3\.obj: line 1 is not valid"):
        meshes[3]
    with pytest.raises(FileFormatError, match=r"^body 1: .*1\.obj"):
        ShapeDNA(3).describe_all(meshes)


def test_folders(tmp_path, data):
    with pytest.raises(FileError, match="there is no folder"):
        load_shrec14(tmp_path / "nowhere")
    with pytest.raises(FileError, match=r"holds no class file"):
        load_shrec14(data / "Data")
    with pytest.raises(FileError, match=r"there is no file .*none.cla"):
        load_shrec14(data, data / "none.cla")
    (data / "more.cla").write_text(CLASSES)
    with pytest.raises(FileError, match="holds 2 class files: more.cla, test.cla; choose one"):
        load_shrec14(data)
    (tmp_path / "empty").mkdir()
    (tmp_path / "empty" / "x.cla").write_text(CLASSES)
    with pytest.raises(FileError, match="holds no mesh"):
        load_shrec14(tmp_path / "empty")
    write_meshes(data / "other", ["4"])
    with pytest.raises(FileFormatError, match="the id 4 matches several meshes, Data.4, other.4"):
        load_shrec14(data, data / "test.cla")


def test_class_hierarchies_and_white_space(tmp_path):
    file = tmp_path / "x.cla"
    file.write_text("\ufeffpsb 1 4 3 animal 0 0 dog animal 2\ta b\r\nhorse animal 1 c\n cat 0 0\n")
    assert read_classes(file) == {"dog": ("a", "b"), "horse": ("c",)}


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "does not begin with PSB"),
        ("PSB 1\nten 3\n", "its header is damaged: .* 'ten'"),
        ("PSB 1\n1 2\nanna 0 2\n0\n", "2 different meshes; found 1"),
        ("PSB 1\n1 1\nanna 0 1\n0\n1\n", "1 different meshes; found 1, .* and 1 further words"),
        ("PSB 1\n2 2\nanna 0 1\n0\nbert 0 1\n0\n", "found 2, 1 of them different"),
        ("PSB 1\n2 2\nanna 0 1\n0\nanna 0 1\n1\n", "class 2 of 2 repeats the name 'anna'"),
        ("PSB 1\n1 1\nanna 0 -1\n0\n", "class 1 of 1 is damaged"),
    ],
)
def test_damaged_class_files(tmp_path, text, message):
    (tmp_path / "x.cla").write_text(text)
    with pytest.raises(FileFormatError, match=message):
        read_classes(tmp_path / "x.cla")
