"""Meshes of a folder: found in natural order, and read only if they share one triangulation."""

import numpy as np
import pytest
import trimesh

from riemhuman.datasets import RegisteredMeshes, find_meshes
from riemhuman.datasets.registered_meshes import natural_key
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileError, FileFormatError
from riemhuman.io import save_mesh

NAMES = ("body_2.obj", "body_10.ply", "body_10a.off")


@pytest.fixture
def mesh():
    sphere = trimesh.creation.icosphere(subdivisions=1)
    return np.asarray(sphere.vertices) * np.arange(1, 4)[:, None, None], np.asarray(sphere.faces)


@pytest.fixture
def folder(mesh, tmp_path):
    for name, vertices in zip(NAMES, mesh[0], strict=True):
        save_mesh(tmp_path / name, vertices, mesh[1])
    (tmp_path / ".hidden.ply").touch()
    (tmp_path / "notes.txt").touch()
    (tmp_path / "inner").mkdir()
    save_mesh(tmp_path / "inner" / "body_1.ply", mesh[0][0], mesh[1])
    return tmp_path


def test_found_in_natural_order(folder):
    assert [file.name for file in find_meshes(folder)] == list(NAMES)
    assert [file.name for file in find_meshes(str(folder))] == list(NAMES)


def test_natural_order():
    ordered = ["", "1", "2", "10", "10a", "a", "a1b2", "A1b10", "a2", "a²", "b"]
    shuffled = [ordered[i] for i in (4, 10, 2, 7, 0, 9, 1, 8, 3, 6, 5)]
    assert sorted(shuffled, key=natural_key) == ordered


def test_read_together_or_one_by_one(folder, mesh):
    files = find_meshes(folder)
    for progress in (False, True):
        points, faces = load_registered(files, progress=progress)
        np.testing.assert_array_equal(points, mesh[0])
        np.testing.assert_array_equal(faces, mesh[1])
    meshes = RegisteredMeshes(files)
    assert len(meshes) == 3
    assert meshes.files == tuple(files)
    np.testing.assert_array_equal(meshes[1], mesh[0][1])
    np.testing.assert_array_equal(meshes[::-2], mesh[0][::-2])
    assert meshes[3:].shape == (0, 42, 3)


def test_files_are_read_when_they_are_asked_for(folder):
    meshes = RegisteredMeshes(find_meshes(folder))
    (folder / NAMES[1]).unlink()
    assert meshes[0].shape == (42, 3)
    with pytest.raises(FileError, match=r"body_10\.ply"):
        meshes[:]


def test_the_first_that_differs_is_named(folder, mesh):
    files = find_meshes(folder)
    points, faces = mesh
    save_mesh(files[1], points[1], np.roll(faces, 1, axis=1))
    with pytest.raises(
        FileFormatError,
        match=r"body_10\.ply is not registered to .*body_2\.obj: the corners of all triangles",
    ):
        load_registered(files)
    save_mesh(files[1], points[1], faces[1:])
    with pytest.raises(FileFormatError, match=r"body_10\.ply .*79 triangles found, 80 expected"):
        load_registered(files)
    save_mesh(files[1], np.vstack([points[1], points[1][:1]]), faces)
    with pytest.raises(FileFormatError, match=r"body_10\.ply .*has 43 vertices, that one has 42"):
        load_registered(files)
    load_registered(files[1:2])
    with pytest.raises(FileFormatError, match=r"body_10\.ply .* registered to .*body_10a\.off"):
        load_registered(files[1:2], files[2])


def test_folders_and_files_that_cannot_be_read(folder):
    with pytest.raises(FileError, match="no folder .*nowhere"):
        find_meshes(folder / "nowhere")
    with pytest.raises(FileError, match="is a file, not a folder"):
        find_meshes(folder / NAMES[0])
    (folder / "empty").mkdir()
    with pytest.raises(FileError, match=r"empty holds no mesh: .*\.ply, \.obj, \.off"):
        find_meshes(folder / "empty")
    with pytest.raises(ArgumentTypeError, match="found 3"):
        find_meshes(3)
    with pytest.raises(ArgumentError, match="no mesh file"):
        load_registered([])
    (folder / NAMES[1]).write_bytes(b"ply\n")
    with pytest.raises(FileFormatError, match=r"body_10\.ply"):
        load_registered(find_meshes(folder))


def test_meshes_in_another_unit_are_refused(folder, mesh):
    vertices, faces = mesh[0][0], mesh[1]
    files = [*find_meshes(folder)[:1], folder / "in_mm.ply"]
    save_mesh(files[1], 1000 * vertices, faces)
    with pytest.raises(FileFormatError, match=r"in_mm.ply is .*one were in millimetres and the"):
        load_registered(files)
    points, _ = load_registered(files, scale=None)
    np.testing.assert_array_equal(points[1], 1000 * vertices)
