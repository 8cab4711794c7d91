"""Mesh files: every flavour is read in its own order; damage is named, never guessed."""

import os
import stat
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from riemhuman.errors import ArgumentError, ArgumentTypeError, FileError, FileFormatError
from riemhuman.io import meshes as mesh_files
from riemhuman.io.meshes import load_mesh, save_mesh

ENDINGS = [".ply", ".obj", ".off"]
BYTE_ORDERS = {"ascii": None, "binary_little_endian": "<", "binary_big_endian": ">"}


@pytest.fixture(scope="module")
def mesh():
    """A bumpy sphere in shuffled order with coinciding vertices and one that no face uses."""
    rng = np.random.default_rng(3)
    sphere = trimesh.creation.icosphere(subdivisions=1)
    order = rng.permutation(len(sphere.vertices))
    vertices = np.empty((len(order) + 2, 3))
    vertices[order] = np.asarray(sphere.vertices) + rng.normal(scale=1e-3, size=(len(order), 3))
    vertices[-2] = vertices[0]
    vertices[-1] = [1 / 3, -1e-17, 1e9]
    faces = rng.permutation(order[np.asarray(sphere.faces)])
    faces[5][faces[5] == 0] = len(order)
    return vertices, faces


def ply(vertices, faces, encoding, scalar="double", name="vertex_indices", declared=None):
    """Write PLY from its specification; with five columns the last two are texture coordinates."""
    order, columns = BYTE_ORDERS[encoding], "xyzst"[: np.shape(vertices)[1]]
    n_vertices, n_faces = declared or (len(vertices), len(faces))
    header = [
        "ply",
        f"format {encoding} 1.0",
        "comment a body",
        f"element vertex {n_vertices}",
        *(f"property {scalar} {column}" for column in columns),
        f"element face {n_faces}",
        f"property list uchar int {name}",
        "end_header\n",
    ]
    rows, lists = np.asarray(vertices).tolist(), [[len(face), *map(int, face)] for face in faces]
    if order is None:
        body = "".join(" ".join(map(repr, row)) + "\n" for row in rows + lists).encode()
    else:
        kind = {"float": "f", "double": "d"}[scalar]
        body = b"".join(struct.pack(f"{order}{len(row)}{kind}", *row) for row in rows)
        body += b"".join(struct.pack(f"{order}B{row[0]}i", *row) for row in lists)
    return "\n".join(header).encode() + body


def obj(vertices, faces, face_pattern="{}"):
    return "".join(
        ["o body\nmtllib none.mtl\nvt 0 0\nvt 1 1\nvn 0 0 1\nvn 0 1 0\n"]
        + [f"v {x!r} {y!r} {z!r}\n" for x, y, z in np.asarray(vertices).tolist()]
        + [
            f"usemtl m{number % 3}\nf "
            + " ".join(face_pattern.format(i + 1, 1 + (i + number) % 2) for i in face)
            + "\n"
            for number, face in enumerate(np.asarray(faces).tolist())
        ]
    ).encode()


def write(tmp_path, name, content):
    file = tmp_path / name
    file.write_bytes(content)
    return file


def assert_reads(file, mesh, *, single=False):
    vertices, faces = load_mesh(file)
    expected = mesh[0].astype(np.float32) if single else mesh[0]
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int64)
    np.testing.assert_array_equal(vertices, expected)
    np.testing.assert_array_equal(faces, mesh[1])


@pytest.mark.parametrize("encoding", BYTE_ORDERS)
@pytest.mark.parametrize("scalar", ["float", "double"])
@pytest.mark.parametrize("name", ["vertex_indices", "vertex_index"])
def test_ply_of_every_encoding(mesh, tmp_path, encoding, scalar, name):
    file = write(tmp_path, "body.ply", ply(*mesh, encoding, scalar, name))
    assert_reads(file, mesh, single=scalar == "float")


@pytest.mark.parametrize("encoding", BYTE_ORDERS)
def test_ply_with_texture_coordinates_keeps_its_vertices(mesh, tmp_path, encoding):
    textured = np.hstack([mesh[0], mesh[0][:, :2]])
    assert_reads(write(tmp_path, "body.ply", ply(textured, mesh[1], encoding)), mesh)


def test_ply_with_windows_line_ends(mesh, tmp_path):
    content = ply(*mesh, "ascii").replace(b"\n", b"\r\n")
    assert_reads(write(tmp_path, "body.PLY", content), mesh)


@pytest.mark.parametrize("pattern", ["{0}", "{0}/{1}", "{0}//{1}", "{0}/{1}/{1}"])
def test_obj_with_texture_normals_and_materials_keeps_vertices_and_faces(mesh, tmp_path, pattern):
    file = write(tmp_path, "body.obj", obj(*mesh, pattern))
    assert_reads(file, mesh)


def test_obj_with_relative_indices_and_continued_lines(mesh, tmp_path):
    vertices, faces = mesh
    lines = [f"v {x!r} \\\n {y!r} {z!r}\n" for x, y, z in vertices.tolist()]
    lines += ["f {} {} {}\r\n".format(*(face - len(vertices))) for face in faces]
    assert_reads(write(tmp_path, "body.obj", "".join(lines).encode("utf-8")), mesh)


def test_obj_comments_in_any_encoding(mesh, tmp_path):
    content = "# Körper\n".encode("latin-1") + obj(*mesh)
    assert_reads(write(tmp_path, "body.obj", content), mesh)


@pytest.mark.parametrize("head", ["OFF\n{}", "OFF {}", "# a body\nOFF # mesh\n\n{}", "COFF\r\n{}"])
def test_off_of_every_flavour(mesh, tmp_path, head):
    vertices, faces = mesh
    text = head.format(f"{len(vertices)} {len(faces)} 0\n")
    text += "".join(f"{x!r} {y!r} {z!r} 0 0 255 255 # v\n\n" for x, y, z in vertices.tolist())
    text += "".join("3  {} {} {} 255 0 0\n".format(*face) for face in faces)
    assert_reads(write(tmp_path, "body.off", text.encode()), mesh)


@pytest.mark.parametrize("ending", ENDINGS)
def test_saved_mesh_reads_back_bit_for_bit(mesh, tmp_path, ending):
    file = tmp_path / f"body{ending}"
    save_mesh(str(file), *mesh)
    assert_reads(file, mesh)
    save_mesh(file, mesh[0] * 2, mesh[1])
    assert_reads(file, (mesh[0] * 2, mesh[1]))
    assert os.listdir(tmp_path) == [file.name]


@pytest.mark.parametrize("ending", ENDINGS)
def test_saved_mesh_is_read_by_trimesh(mesh, tmp_path, ending):
    vertices, faces = mesh[0][:-1], mesh[1]
    save_mesh(tmp_path / f"body{ending}", vertices, faces)
    read = trimesh.load_mesh(tmp_path / f"body{ending}", process=False, maintain_order=True)
    np.testing.assert_array_equal(read.vertices, vertices)
    np.testing.assert_array_equal(read.faces, faces)


def test_saved_file_has_the_permissions_of_any_new_file(mesh, tmp_path):
    save_mesh(tmp_path / "body.ply", *mesh)
    (tmp_path / "other").touch()
    modes = {stat.S_IMODE(file.stat().st_mode) for file in tmp_path.iterdir()}
    assert len(modes) == 1


def test_failed_save_leaves_the_old_file_and_nothing_else(mesh, tmp_path, monkeypatch):
    file = tmp_path / "body.ply"
    save_mesh(file, *mesh)

    def full_disk(self, content):
        with open(self, "wb") as stream:
            stream.write(content[:10])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(FileError, match=r"body\.ply cannot be written: No space left"):
        save_mesh(file, mesh[0] * 2, mesh[1])
    assert_reads(file, mesh)
    assert os.listdir(tmp_path) == ["body.ply"]


def test_bad_arrays_are_refused_before_the_disk_is_touched(mesh, tmp_path):
    vertices, faces = mesh
    file = tmp_path / "body.ply"
    with pytest.raises(ArgumentError, match=r"faces\[0\] .*vertices holds 44"):
        save_mesh(file, vertices, faces + 44)
    with pytest.raises(ArgumentError, match="vertices holds 132 NaN"):
        save_mesh(file, np.full_like(vertices, np.nan), faces)
    with pytest.raises(ArgumentTypeError, match="faces"):
        save_mesh(file, vertices, faces + 0.5)
    assert os.listdir(tmp_path) == []


def test_places_where_no_file_can_be_written(mesh, tmp_path):
    (tmp_path / "folder.ply").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(FileError, match=r"folder\.ply is a folder"):
        save_mesh(tmp_path / "folder.ply", *mesh)
    for parent in ("missing", "file"):
        with pytest.raises(FileError, match=f"there is no folder .*{parent}"):
            save_mesh(tmp_path / parent / "body.ply", *mesh)


def test_files_that_cannot_be_read(tmp_path, monkeypatch):
    with pytest.raises(FileError, match=r"there is no file .*none\.ply"):
        load_mesh(tmp_path / "none.ply")
    with pytest.raises(FileError, match="is a folder"):
        load_mesh(tmp_path)
    with pytest.raises(OSError, match="there is no file"):
        load_mesh(str(tmp_path / "none.obj"))

    def denied(self):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "body.off").touch()
    monkeypatch.setattr(Path, "read_bytes", denied)
    with pytest.raises(FileError, match=r"body\.off cannot be read: Permission denied"):
        load_mesh(tmp_path / "body.off")


@pytest.mark.parametrize("ending", [".stl", "", ".npz"])
def test_other_endings_are_refused(mesh, tmp_path, ending):
    file = write(tmp_path, f"body{ending}", b"")
    for act in (lambda: load_mesh(file), lambda: save_mesh(file, *mesh)):
        with pytest.raises(FileFormatError, match=r"\.ply, \.obj, \.off"):
            act()


def test_path_of_the_wrong_type_is_refused(mesh):
    with pytest.raises(ArgumentTypeError, match="path must be the path of a file; found 3"):
        load_mesh(3)
    with pytest.raises(ArgumentTypeError, match="found None"):
        save_mesh(None, *mesh)


def assert_refused(file, message):
    with pytest.raises(FileFormatError, match=rf"{file.name}: .*{message}"):
        load_mesh(file)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize(
    "content", [b"", b"\0\xff" * 300, b"<html></html>"], ids=["empty", "bytes", "html"]
)
def test_garbage_is_refused(tmp_path, ending, content):
    assert_refused(write(tmp_path, f"body{ending}", content), "")


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("share", [0.02, 0.2, 0.5, 0.8, 0.97])
def test_truncated_files_are_refused(mesh, tmp_path, ending, share):
    # Half an OBJ file may be a legal one; cut before the faces or inside them it is not.
    file = tmp_path / f"body{ending}"
    save_mesh(file, *mesh)
    content = file.read_bytes()
    if ending == ".obj":
        share = min(share, content.index(b"f ") / len(content))
    file.write_bytes(content[: int(share * len(content))])
    assert_refused(file, "")


@pytest.mark.parametrize("encoding", BYTE_ORDERS)
@pytest.mark.parametrize("n_missing", [1, 10, 300, 700])
def test_truncated_ply_is_refused(mesh, tmp_path, encoding, n_missing):
    content = ply(*mesh, encoding, "float").rstrip(b"\n")
    if encoding == "ascii":
        n_missing += content[::-1].index(b"\n")
    assert_refused(write(tmp_path, "body.ply", content[:-n_missing]), "")


def test_ascii_ply_that_ends_among_its_vertices_says_so(mesh, tmp_path):
    rows = ply(*mesh, "ascii").split(b"\n")
    content = b"\n".join(rows[: rows.index(b"end_header") + 6])
    file = write(tmp_path, "body.ply", content)
    assert_refused(file, "the PLY header declares 44 rows of vertex; 5 found")


@pytest.mark.parametrize("row", [3, 50])
def test_ascii_ply_with_a_number_missing_or_misspelt_is_refused(mesh, tmp_path, row):
    head, _, body = ply(*mesh, "ascii").partition(b"end_header\n")
    rows = body.split(b"\n")
    start = rows[row].rpartition(b" ")[0]
    for broken in (start, start + b" x", rows[row] + b"x"):
        changed = [*rows[:row], broken, *rows[row + 1 :]]
        content = head + b"end_header\n" + b"\n".join(changed)
        assert_refused(write(tmp_path, "body.ply", content), "")


@pytest.mark.parametrize("encoding", BYTE_ORDERS)
def test_ply_with_more_declared_than_there_is_refused(mesh, tmp_path, encoding):
    vertices, faces = mesh
    for declared in ((len(vertices), len(faces) + 1), (len(vertices) + 1, len(faces))):
        content = ply(*mesh, encoding, declared=declared)
        assert_refused(write(tmp_path, "body.ply", content), "")


def test_ply_without_faces_is_refused(mesh, tmp_path):
    content = ply(mesh[0], [], "ascii")
    assert_refused(write(tmp_path, "body.ply", content), "44 vertices and 0 faces")


def test_obj_and_off_without_faces_are_refused(mesh, tmp_path):
    assert_refused(write(tmp_path, "body.obj", b"v 0 0 0\n"), "1 vertices and 0 faces")
    assert_refused(write(tmp_path, "body.off", b"OFF 1 0 0\n0 0 0\n"), "1 vertices and 0 faces")


@pytest.mark.parametrize("encoding", BYTE_ORDERS)
@pytest.mark.parametrize("all_faces", [True, False])
def test_polygons_of_ply_are_split_by_the_order_of_their_corners(
    mesh, tmp_path, encoding, all_faces
):
    faces = [[*face, face[0]] if all_faces or i == 7 else face for i, face in enumerate(mesh[1])]
    _, found = load_mesh(write(tmp_path, "body.ply", ply(mesh[0], faces, encoding)))
    expected = []
    for face in faces:
        expected += [face[:3]] if len(face) == 3 else [face[:3], [face[0], face[2], face[3]]]
    np.testing.assert_array_equal(found, expected)


def test_polygons_of_obj_and_off_are_split_by_the_order_of_their_corners(tmp_path):
    corners = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    text = "v " + corners.replace("\n", "\nv ")[:-2] + "f 1 2 3\nf 1 2 3 4\n"
    for name, content in (("a.obj", text), ("b.off", f"OFF 4 2 0\n{corners}3 0 1 2\n4 0 1 2 3\n")):
        _, faces = load_mesh(write(tmp_path, name, content.encode()))
        assert faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]
    message = "1 of 2 have fewer, the first at index 1 with 2"
    assert_refused(write(tmp_path, "c.obj", text[:-5].encode()), message)
    text = f"OFF 4 2 0\n{corners}3 0 1 2\n2 0 1\n"
    assert_refused(write(tmp_path, "d.off", text.encode()), message)


@pytest.mark.parametrize("encoding", BYTE_ORDERS)
def test_ply_with_bad_vertices_or_faces_is_refused(mesh, tmp_path, encoding):
    vertices, faces = mesh
    holed = vertices.copy()
    holed[4, 1] = np.nan
    file = write(tmp_path, "body.ply", ply(holed, faces, encoding))
    assert_refused(file, r"vertices .*\(4, 1\)")
    file = write(tmp_path, "body.ply", ply(vertices, faces + 3, encoding))
    assert_refused(file, r"faces\[.*out of range")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("body.obj", "v 0 0 0\nv 1 b 0\nf 1 1 2\n", "line 2 is not valid: 'v 1 b 0'"),
        ("body.obj", "v 0 0\n", "line 1 is not valid"),
        ("body.obj", "v 0 0 0\nf 1 1 2\n", r"faces\[0\] = \(0, 0, 1\).*out of range"),
        ("body.obj", "v 0 0 0\nf 0 1 1\n", r"faces\[0\] = \(-1, 0, 0\).*out of range"),
        ("body.obj", "v 0 0 0\nf 1 1 -2\n", r"faces\[0\] = \(0, 0, -1\).*out of range"),
        ("body.obj", "v 0 0 nan\nf 1 1 1\n", r"vertices .*\(0, 2\)"),
        ("body.off", "OFF\n1 1 0\n0 0 0\n3 0 0 1\n", r"faces\[0\] = \(0, 0, 1\).*out of range"),
        ("body.off", "OFF\n1 1 0\n0 inf 0\n3 0 0 0\n", r"vertices .*\(0, 1\)"),
        ("body.off", "OFF\n1 1 0\n0 0\n3 0 0 0\n", "not a valid vertex line: '0 0'"),
        ("body.off", "OFF\n1 1 0\n0 0 0\n3 0 x 0\n", "not a valid face line: '3 0 x 0'"),
        ("body.off", "OFF\n1 1 0\n0 0 0\n", "truncated: .*1 vertices and 1 faces, 1 lines"),
        ("body.off", "OFF\nvertices\n", "numbers of vertices and faces"),
        ("body.off", "OFF\n", "numbers of vertices and faces"),
        ("body.off", "OFF BINARY\n", "numbers of vertices and faces"),
        ("body.off", "4OFF\n1 1 0\n", "does not begin with 'OFF'"),
        ("body.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "header has no end"),
    ],
)
def test_damage_is_named(tmp_path, name, content, message):
    assert_refused(write(tmp_path, name, content.encode()), message)


@pytest.mark.parametrize("ending", ENDINGS)
@pytest.mark.parametrize("line_end", [b"\r", b"\r\n"])
def test_other_line_ends_are_read(mesh, tmp_path, ending, line_end):
    save_mesh(tmp_path / f"body{ending}", *mesh)
    content = (tmp_path / f"body{ending}").read_bytes()
    if ending == ".ply":
        content = ply(*mesh, "ascii")
    assert_reads(write(tmp_path, f"body{ending}", content.replace(b"\n", line_end)), mesh)


@pytest.mark.parametrize("ending", ENDINGS[1:])
def test_a_byte_order_mark_hides_no_line(mesh, tmp_path, ending):
    save_mesh(tmp_path / f"body{ending}", *mesh)
    content = (tmp_path / f"body{ending}").read_bytes()
    assert_reads(write(tmp_path, f"body{ending}", b"\xef\xbb\xbf" + content), mesh)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("body.off", "OFF\n3 1 0\n{rows}3 0 1 2\n3 2 1 0\n", "more lines follow: '3 2 1 0'"),
        ("body.off", "OFF\n3 1 0 7\n{rows}3 0 1 2\n", "numbers of vertices and faces"),
        ("body.off", "OFF\n3 -1 0\n{rows}", "numbers of vertices and faces"),
        ("body.off", "OFF\n-3 3 0\n{rows}3 0 1 2\n", "numbers of vertices and faces"),
        ("body.off", "OFF\n3 1 0\n{rows}-2 0 1 2 9\n", "not a valid face line: '-2 0 1 2 9'"),
        ("body.off", "OFF\n3 1 0\n{rows}3 0 1\n", "not a valid face line: '3 0 1'"),
        ("body.off", "OFF\n3 1 0\n{rows}3 0 1 0_2\n", "not a valid face line: '3 0 1 0_2'"),
        ("body.off", "OFF\n3 1 0\n{rows}3 0 1 2 red\n", "not a valid face line"),
        ("body.off", "OFF\n1_0 1 0\n{rows}3 0 1 2\n", "numbers of vertices and faces"),
        ("body.obj", "v 0 0 1_0\nf 1 1 1\n", "line 1 is not valid: 'v 0 0 1_0'"),
        ("body.obj", "v 0 0 1\nf 1 1 0_1\n", "line 2 is not valid: 'f 1 1 0_1'"),
        ("body.obj", "v 0 0 \u0661\nf 1 1 1\n", "line 1 is not valid"),
        ("body.obj", "v 0 0 1\u2028v 1 1 1\nf 1 1 2\n", "line 1 is not valid"),
        ("body.obj", "v 0 0 1\nf 1 1 9223372036854775809\n", "line 2 is not valid"),
    ],
)
def test_numbers_and_lines_are_those_of_the_format(tmp_path, name, content, message):
    content = content.format(rows="0 0 0\n1 0 0\n0 1 0\n") if "{rows}" in content else content
    assert_refused(write(tmp_path, name, content.encode()), message)


def test_comments_of_obj_hide_no_line(mesh, tmp_path):
    content = obj(*mesh).replace(b"v ", b"# made in C:\\bodies\\\nv ", 1)
    content = content.replace(b"\nf ", b" # last vertex\nf ", 1).replace(b"\nusemtl m1", b" # a")
    assert_reads(write(tmp_path, "body.obj", content), mesh)


def test_negative_indices_of_obj_count_from_the_latest_vertex(mesh, tmp_path):
    vertices, faces = mesh
    lines = [f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist()]
    order = np.argsort(faces.max(axis=1), kind="stable")
    content, n_seen = "", 0
    for face in faces[order].tolist():
        content += "".join(lines[n_seen : max(face) + 1])
        n_seen = max(n_seen, max(face) + 1)
        content += "f {} {} {}\n".format(*(corner - n_seen for corner in face))
    content += "".join(lines[n_seen:])
    assert_reads(write(tmp_path, "body.obj", content.encode()), (vertices, faces[order]))


def test_home_folder_is_understood(mesh, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    save_mesh("~/body.ply", *mesh)
    assert_reads(Path("~/body.ply"), mesh)
    assert (tmp_path / "body.ply").exists()


def test_readers_and_writers_know_the_same_formats():
    assert list(mesh_files._READERS) == list(mesh_files._WRITERS) == ENDINGS
