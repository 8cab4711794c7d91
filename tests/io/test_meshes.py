"""Mesh files of every kind are read in their own order; damaged ones raise errors."""

import os
import struct
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from cases import sphere_template

from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    FileError,
    FileFormatError,
    MissingDependencyError,
)
from riemhuman.io import (
    as_arrays,
    is_registered_scan,
    load_mesh,
    load_points,
    load_trusted,
    save_glb,
    save_mesh,
    to_pyvista,
    to_trimesh,
)
from riemhuman.surfaces import Template

ENDINGS = [".ply", ".obj", ".off"]
ENCODINGS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
CODES = {"char": "b", "uchar": "B", "short": "h", "int": "i", "uint": "I"}
CODES |= {"float": "f", "double": "d"}


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


def ply(elements, encoding, line_end="\n"):
    """Return a PLY file; elements are (name, properties, rows), with lists in their rows."""
    order = ENCODINGS[encoding]
    header, body = ["ply", f"format {encoding} 1.0", "comment a body"], b""
    for name, properties, rows in elements:
        header.append(f"element {name} {len(rows)}")
        header += [
            f"property {'list ' if len(words) == 3 else ''}{' '.join(words)}"
            for words in properties
        ]
        for row in rows:
            numbers, codes = [], ""
            for words, value in zip(properties, row, strict=True):
                values = value if len(words) == 3 else [value]
                if len(words) == 3:
                    numbers, codes = [*numbers, len(values)], codes + CODES[words[0]]
                numbers, codes = numbers + list(values), codes + CODES[words[-2]] * len(values)
            text = (" ".join(map(repr, numbers)) + line_end).encode()
            body += struct.pack(order + codes, *numbers) if order else text
    return line_end.join([*header, "end_header", ""]).encode() + body


def elements_of(vertices, faces, scalar="double", name="vertex_indices"):
    """Return the elements of a PLY file of a mesh."""
    positions = [(scalar, axis) for axis in "xyz"]
    corners = [[list(map(int, face))] for face in faces]
    return [
        ("vertex", positions, np.asarray(vertices).tolist()),
        ("face", [("uchar", "int", name)], corners),
    ]


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
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file


def assert_reads(file, mesh, *, single=False):
    vertices, faces = load_mesh(file)
    expected = np.asarray(mesh[0], dtype=np.float32) if single else mesh[0]
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int64)
    np.testing.assert_array_equal(vertices, expected)
    np.testing.assert_array_equal(faces, mesh[1])


def assert_refused(file, message=""):
    with pytest.raises(FileFormatError, match=rf"{file.name}: .*{message}"):
        load_mesh(file)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_ply_of_every_encoding(mesh, tmp_path, encoding):
    for scalar, name in (("float", "vertex_indices"), ("double", "vertex_index")):
        file = write(tmp_path, "body.PLY", ply(elements_of(*mesh, scalar, name), encoding))
        assert_reads(file, mesh, single=scalar == "float")


VERTICES = [[0.5, 0, 1], [1, 0.25, 0], [0, 1, 0], [2, 2, 2]]
FACES = [[0, 1, 2], [3, 2, 1]]
VERTEX, FACE = elements_of(VERTICES, FACES, "float")
RAGGED = [[[1, 2]], [[]], [[3, 4, 5]], [[6]]]
RAGGED_LIST = ("uchar", "short", "neighbours")
LAYOUTS = {
    "lists per vertex": [
        ("vertex", [RAGGED_LIST, *VERTEX[1]], [
            [*extra, *row] for extra, row in zip(RAGGED, VERTICES, strict=True)
        ]),
        FACE,
    ],
    "lists per face": [
        VERTEX,
        ("face", [*FACE[1], RAGGED_LIST], [[FACES[0], [1, 2, 3, 4]], [FACES[1], [7]]]),
    ],
    "numbers between": [
        ("vertex", [VERTEX[1][2], ("uchar", "red"), *VERTEX[1][:2]], [
            [z, 255, x, y] for x, y, z in VERTICES
        ]),
        FACE,
    ],
    "something behind": [VERTEX, FACE, ("edge", [("int", "vertex1")], [[0]])],
    "nothing around": [("camera", VERTEX[1], []), VERTEX, FACE, ("s", [RAGGED_LIST], [])],
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_ply_of_every_layout(tmp_path, layout):
    for encoding, line_end in zip(ENCODINGS, ("\n", "\r\n", "\n"), strict=True):
        content = ply(LAYOUTS[layout], encoding, line_end)
        content = content.replace(b"a body", "ein Körper".encode("latin-1"))
        assert_reads(write(tmp_path, "body.ply", content), (VERTICES, FACES))
        if encoding != "ascii":
            assert_refused(write(tmp_path, "body.ply", content[:-1]))


@pytest.mark.parametrize("pattern", ["{0}", "{0}/{1}", "{0}//{1}", "{0}/{1}/{1}"])
def test_obj_with_texture_normals_and_materials(mesh, tmp_path, pattern):
    content = "# Körper \\\n".encode("latin-1") + obj(*mesh, pattern)
    for start in (b"", b"\xef\xbb\xbf"):
        assert_reads(write(tmp_path, "body.obj", start + content), mesh)


@pytest.mark.parametrize("name", ["a.obj", "a.off"])
def test_plain_and_unusual_layouts_are_read_alike(tmp_path, name):
    """Most files are read at once, unusual ones line by line; both accept and refuse the same."""
    is_obj = name == "a.obj"
    head = "" if is_obj else "OFF\n4 2 0\n"
    vertex, face = ("v ", "f ") if is_obj else ("", "3 ")
    first = int(is_obj)
    points = [(0.1, -1e-3, 2.0), (1.0, 0.0, 3e2), (0.5, 1.0, -4.0), (0.25, 7.0, 1.0)]
    lines = [f"{vertex}{x!r} {y!r} {z!r}" for x, y, z in points]
    lines += [
        f"{face}{first} {first + 1} {first + 2}",
        f"{face}{first + 2} {first + 1} {first + 3}",
    ]
    plain = head + "\n".join(lines) + "\n"
    for text in (
        plain,
        plain.replace("\n", "\r\n"),
        plain.replace(" ", "\t"),
        plain.replace("\n", " \n\n"),
        plain.replace("\n", " # a comment\n"),
        plain.replace("0.1", "+.1"),
        plain.replace("0.1", "\\\n 0.1") if is_obj else plain,
    ):
        vertices, faces = load_mesh(write(tmp_path, name, text))
        np.testing.assert_array_equal(vertices, points)
        assert faces.tolist() == [[0, 1, 2], [2, 1, 3]]
    for wrong in ("0.1.5", "0x1", "1-2", "0,1", "1_0", "0.1 2 3 x"):
        file = write(tmp_path, name, plain.replace("0.1", wrong))
        assert_refused(file, f"line {1 if is_obj else 3} is not valid")
    corner = str(first + 3)
    for wrong in (f"{corner}.5", "99", "-99", f"{corner}e0", "9" * 30):
        assert_refused(write(tmp_path, name, plain[::-1].replace(corner, wrong[::-1], 1)[::-1]))


def test_obj_with_relative_indices(tmp_path):
    indented = " v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert len(load_mesh(write(tmp_path, "indented.obj", indented))[0]) == 4
    early = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\nv 9 9 9\n"
    assert load_mesh(write(tmp_path, "early.obj", early))[1].tolist() == [[2, 1, 0]]


@pytest.mark.parametrize(
    "head", ["OFF {}", "# a body\nOFF # mesh\n\n{}", "COFF\r\n{}", "OFF{}", "\n{}", "ncoff\n{}"]
)
def test_off_of_every_kind(mesh, tmp_path, head):
    vertices, faces = mesh
    text = head.format(f"{len(vertices)} {len(faces)} 0\n")
    text += "".join(f"{x!r} {y!r} {z!r} 0 0 255 255 # v\n\n" for x, y, z in vertices.tolist())
    text += "".join("3  {} {} {} 255 0 0\n".format(*face) for face in faces)
    assert_reads(write(tmp_path, "body.off", text), mesh)


@pytest.mark.parametrize("file_type", ["stl", "stl_ascii"])
def test_stl(tmp_path, file_type):
    """Vertices come in the order of their first corner, and equal corners are one vertex."""
    sphere = trimesh.creation.icosphere(subdivisions=1)
    file = tmp_path / "body.stl"
    sphere.export(file, file_type=file_type)
    vertices, faces = load_mesh(file)
    np.testing.assert_allclose(vertices[faces], sphere.triangles, atol=1e-7)
    assert len(vertices) == len(sphere.vertices)
    assert (np.diff(np.unique(faces, return_index=True)[1]) > 0).all()
    content = file.read_bytes()
    for broken, message in (
        (content[: len(content) // 2], "truncated: its header" if file_type == "stl" else ""),
        (content[:-30], ""),
        (b"solid\nvertex 0 0 0\n", ""),
        (b"", ""),
    ):
        assert_refused(write(tmp_path, "broken.stl", broken), message)


def test_glb_of_ours(mesh, tmp_path):
    file = tmp_path / "body.glb"
    save_glb(file, [mesh[0], 2 * mesh[0]], mesh[1])
    assert_reads(file, mesh, single=True)
    (by_trimesh,) = trimesh.load(file, process=False).geometry.values()
    np.testing.assert_array_equal(by_trimesh.vertices, mesh[0].astype(np.float32))
    np.testing.assert_array_equal(by_trimesh.faces, mesh[1])


def test_glb_of_a_scene_of_trimesh(tmp_path):
    box, sphere = trimesh.creation.box(), trimesh.creation.icosphere(subdivisions=1)
    motion = trimesh.transformations.euler_matrix(0.3, 0.8, 0.1)
    motion[:3, 3] = 1, 2, 3
    scene = trimesh.Scene()
    scene.add_geometry(box)
    scene.add_geometry(sphere, transform=motion)
    scene.export(tmp_path / "scene.glb")
    vertices, faces = load_mesh(tmp_path / "scene.glb")
    moved = sphere.copy().apply_transform(motion)
    expected = np.concatenate([box.triangles, moved.triangles])
    np.testing.assert_allclose(vertices[faces], expected, atol=1e-6)
    content = (tmp_path / "scene.glb").read_bytes()
    for broken in (
        b"glTF",
        content[:-200],
        content.replace(b'"count":', b'"count":9'),
        content.replace(b'"bufferView":', b'"sparse":'),
    ):
        assert_refused(write(tmp_path, "broken.glb", broken))


def test_other_formats_are_read_by_meshio(tmp_path):
    meshio = pytest.importorskip("meshio")
    cells = [("line", [[0, 1]]), ("triangle", FACES), ("quad", [[0, 1, 2, 3]])]
    made = meshio.Mesh(np.array(VERTICES, dtype=float), cells)
    made.write(tmp_path / "surface.vtk", binary=False)
    expected = [*FACES, [0, 1, 2], [0, 2, 3]]
    assert_reads(tmp_path / "surface.vtk", (VERTICES, expected))
    assert as_arrays(made)[1].tolist() == expected
    assert_refused(write(tmp_path, "broken.vtk", b"# vtk"), "meshio cannot read it")
    poly = b"# vtk DataFile Version 4.2\nmade up\nASCII\nDATASET POLYDATA\nPOINTS 0 float\n"
    assert_refused(write(tmp_path, "poly.vtk", poly), r"\(not POLYDATA\).*save it as \.ply")


@pytest.mark.parametrize("ending", ENDINGS)
def test_saved_mesh_reads_back_bit_for_bit(mesh, tmp_path, ending):
    file = tmp_path / f"body{ending}"
    save_mesh(str(file), *mesh)
    assert_reads(file, mesh)
    turned = np.asfortranarray(mesh[0] * 2), mesh[1][:, [1, 0, 2]]  # not in the order of C
    save_mesh(file, *turned)
    assert_reads(file, turned)
    assert os.listdir(tmp_path) == [file.name]
    save_mesh(file, mesh[0][:-1], mesh[1])
    by_trimesh = trimesh.load_mesh(file, process=False, maintain_order=True)
    np.testing.assert_array_equal(by_trimesh.vertices, mesh[0][:-1])
    np.testing.assert_array_equal(by_trimesh.faces, mesh[1])


def test_trusted_vertices_of_ply_files(mesh, tmp_path):
    trusted = mesh[0][:, 0] > 0.0
    save_mesh(tmp_path / "body.ply", *mesh, trusted)
    assert_reads(tmp_path / "body.ply", mesh)
    np.testing.assert_array_equal(load_trusted(tmp_path / "body.ply"), trusted)
    assert is_registered_scan(tmp_path / "body.ply")
    by_trimesh = trimesh.load_mesh(tmp_path / "body.ply", process=False, maintain_order=True)
    np.testing.assert_array_equal(by_trimesh.vertices, mesh[0])
    save_mesh(tmp_path / "body.ply", *mesh)
    assert load_trusted(tmp_path / "body.ply") is None
    assert not is_registered_scan(tmp_path / "body.ply")
    save_mesh(tmp_path / "body.obj", *mesh, trusted)
    assert load_trusted(tmp_path / "body.obj") is None
    assert not is_registered_scan(tmp_path / "body.obj")
    (tmp_path / "body.ply").write_bytes(b"plyfile\n")
    with pytest.raises(FileFormatError, match=r"body\.ply: not a PLY file"):
        load_trusted(tmp_path / "body.ply")


def test_arguments_of_save_mesh(mesh, tmp_path):
    vertices, faces = mesh
    file = tmp_path / "body.ply"
    for error, arguments, message in [
        (ArgumentError, (file, vertices, faces + 44), r"faces\[0\] .*vertices holds 44"),
        (ArgumentError, (file, np.full_like(vertices, np.nan), faces), "vertices holds 132 NaN"),
        (ArgumentTypeError, (file, vertices, faces + 0.5), "faces"),
        (ArgumentError, (file, *mesh, [True]), r"trusted must be Boolean, of shape \(44,\)"),
        (ArgumentTypeError, (None, *mesh), "found None"),
        (FileFormatError, (tmp_path / "body.stl", *mesh), r"\.off, \.glb; found '.stl'"),
        (FileError, (tmp_path / "missing" / "body.ply", *mesh), "there is no folder .*missing"),
    ]:
        with pytest.raises(error, match=message):
            save_mesh(*arguments)
    assert os.listdir(tmp_path) == []
    file.mkdir()
    with pytest.raises(FileError, match="is not a regular file"):
        save_mesh(file, *mesh)


def test_places_of_files(mesh, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("~anna.ply", *([os.fsdecode(b"\xff.ply")] if sys.platform == "linux" else [])):
        save_mesh(name, *mesh)
        assert os.path.exists(tmp_path / name)
        assert_reads(Path(name), mesh)
    monkeypatch.setenv("HOME", str(tmp_path))
    save_mesh("~/body.ply", *mesh)
    assert_reads(Path("~/body.ply"), mesh)
    for load, path, error, message in [
        (load_mesh, "none.ply", FileError, r"there is no file .*none\.ply"),
        (load_mesh, "n" * 300 + ".ply", FileError, "(?i)name too long"),
        (load_mesh, tmp_path, FileError, "is a folder"),
        (load_mesh, 3, ArgumentTypeError, "path must be the path of a file; found 3"),
        (load_mesh, "scan.pcd", FileFormatError, "convert it to PLY first"),
        (load_points, "scan.e57", FileFormatError, "convert it to PLY first"),
        (load_mesh, "scan", FileFormatError, r"must be one of \.ply, \.obj, \.off, \.stl"),
    ]:
        with pytest.raises(error, match=message):
            load(path)


def test_truncated_files_are_refused(mesh, tmp_path):
    for ending in ENDINGS:
        file = tmp_path / f"body{ending}"
        save_mesh(file, *mesh)
        content = file.read_bytes()
        # Half an OBJ file may be a legal one; cut before the faces it is not.
        most = content.index(b"f ") if ending == ".obj" else len(content)
        for share in (0.02, 0.5, 0.97):
            assert_refused(write(tmp_path, file.name, content[: int(share * most)]))


FACET = "solid a\nvertex 0 0 0\nvertex 0,5 0 0\nvertex 0 1 0\nendfacet\nendsolid\n"


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", "v 0 0 0\nv 1 b 0\nf 1 1 2\n", "line 2 is not valid: 'v 1 b 0'"),
        ("a.obj", "v 0 0 0\n", "1 vertices and 0 faces"),
        ("a.obj", "v 0 0 0\nf 1 0 1\n", "line 2: a face refers to vertex 0; .* from 1, or back"),
        ("a.obj", "v 0 0 0\nf 1 1 -2\n", "line 2: a face refers to vertex -2; .* to -1$"),
        ("a.obj", "v 0,5 0,1 0,2\nf 1 1 1\n", "'v 0,5 0,1 0,2'; decimals need a point"),
        ("a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 1\n", r"faces\[0\] = \(0, 0, 1\).*out of range"),
        ("a.off", "OFF\n1 1 0\n0 0\n3 0 0 0\n", "line 3 is not valid: '0 0'"),
        ("a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 0\n0\n", "1 faces, 3 lines follow"),
        ("a.off", "OFF\n99999999999 1 0\n0 0 0\n", "1 lines follow"),
        ("a.off", "OFF BINARY\n4 4 0\n", "a binary OFF file; save it as text"),
        ("a.off", "4OFF\n1 0 0\n0 0 0 1\n", "four or more coordinates"),
        ("a.stl", FACET, "not all numbers; decimals need a point"),
    ],
)
def test_damage_of_text_files_is_named(tmp_path, name, content, message):
    assert_refused(write(tmp_path, name, content), message)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("float x", "float u", ""),
        ("element face", "element vertex", ""),
        ("element face", "element tristrips", "strips of triangles are not"),
        ("element face 2", "element face 1", "declares fewer rows than follow"),
        ("vertex_indices", "corners", ""),
        ("list uchar int", "int", ""),
        ("vertex 4", "vertex -4", ""),
        ("vertex 4", "vertex 99999999999", ""),
        ("3 0 1 2", "-1 0 1 2", ""),
        ("3 0 1 2", "4 0 1 2", ""),
        ("3 0 1 2", "3 0 1 9", ""),
        ("0.5 0", "nan 0", ""),
    ],
)
def test_damaged_ply(tmp_path, old, new, message):
    content = ply([VERTEX, FACE], "ascii").decode()
    assert old in content
    assert_refused(write(tmp_path, "body.ply", content.replace(old, new, 1)), message)


def with_header(content, old, new):
    header, end, body = content.partition(b"end_header\n")
    return (header + end).replace(old, new) + body


VARIANTS = {
    "unusual.ply": lambda files: (
        b"\xef\xbb\xbf"
        + files["a.ply"]
        .replace(b"\n", b" \n", 9)
        .replace(b"element vertex", b"ELEMENT  Vertex")
        .replace(b"property", b"\nproperty", 1)
        + b"\n\n"
    ),
    "cr.ply": lambda files: files["a.ply"].replace(b"\n", b"\r"),
    "cr_binary.ply": lambda files: with_header(files["b.ply"], b"\n", b"\r"),
    "spaces_binary.ply": lambda files: with_header(files["b.ply"], b"\n", b"\t \n") + b"\n",
    "byte.stl": lambda files: files["b.stl"] + b"\n",
    "solid.stl": lambda files: b"solid made by a program".ljust(80) + files["b.stl"][80:],
    "unusual.stl": lambda files: b"\xef\xbb\xbf" + files["a.stl"].upper().replace(b"\n", b"\r"),
    "utf16.off": lambda files: files["a.off"].decode().encode("utf-16"),
}


def test_variants_that_other_programs_write(tmp_path):
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    # The first corner is at 0, 0, 0.625, which begins like a line end in binary files.
    vertices = np.array([[0, 0, 0.625], [0, 1, 0], [1, 0, 0], [0, 0, 1.0]])
    vertices[0, 0] = np.frombuffer(b"\n\n\n\n\n\n\n@", "<f8")[0]
    save_mesh(tmp_path / "a.off", vertices, faces)
    save_mesh(tmp_path / "b.ply", vertices, faces)
    body = trimesh.Trimesh(vertices, faces, process=False)
    files = {
        "a.ply": ply(elements_of(vertices, faces), "ascii"),
        "b.ply": (tmp_path / "b.ply").read_bytes(),
        "a.off": (tmp_path / "a.off").read_bytes(),
        "a.stl": trimesh.exchange.stl.export_stl_ascii(body).encode(),
        "b.stl": trimesh.exchange.stl.export_stl(body),
    }
    for name, change in VARIANTS.items():
        content = change(files)
        assert content not in files.values()
        found = load_mesh(write(tmp_path, name, content))
        np.testing.assert_allclose(found[0][found[1]], vertices[faces], rtol=1e-6, err_msg=name)


def test_polygons_are_split_alike_from_every_source(tmp_path):
    """The first polygon is concave, and the last one bent."""
    corners = np.array([[0, 0, 0], [3, 0, 0], [1, 1, 0], [0, 3, 0], [0, 0, 1.0]])
    polygons = [[1, 2, 3, 0], [0, 1, 4], [4, 3, 2, 1, 0]]
    points = "\n".join(" ".join(map(str, corner)) for corner in corners)
    counted = "\n".join(" ".join(map(str, [len(polygon), *polygon])) for polygon in polygons)
    expected = load_mesh(write(tmp_path, "first.off", f"OFF 5 3\n{points}\n{counted}"))[1].tolist()
    assert expected[:3] == [[0, 1, 2], [0, 2, 3], [0, 1, 4]]
    assert len(expected) == 6
    lines = ["v " + line for line in points.split("\n")]
    lines += ["f " + " ".join(str(k + 1) for k in polygon) for polygon in polygons]
    files = [
        write(tmp_path, "surface.off", f"OFF\n5 3 0\n{points}\n{counted}\n"),
        write(tmp_path, "surface.obj", "\n".join(lines) + "\n"),
    ]
    for encoding in ENCODINGS:
        content = ply(elements_of(corners, polygons), encoding)
        files.append(write(tmp_path, f"{encoding}.ply", content))
    for file in files:
        assert_reads(file, (corners, expected))
    listed = np.concatenate([[len(polygon), *polygon] for polygon in polygons])
    like_pyvista = SimpleNamespace(points=corners, faces=listed)
    assert as_arrays(like_pyvista)[1].tolist() == expected
    assert Template(like_pyvista).faces.tolist() == expected
    for wrong in ([4, 0, 1, 2], [-1, 0, 1], [2, 0, 1]):
        with pytest.raises(ArgumentError, match="corners"):
            as_arrays(SimpleNamespace(points=corners, faces=np.array(wrong)))


def test_pyvista_and_back():
    pyvista = pytest.importorskip("pyvista")
    template = sphere_template()
    mesh = to_pyvista(2 * template.vertices, template.faces)
    np.testing.assert_allclose(mesh.area, 4 * template.face_areas.sum(), rtol=1e-6)
    np.testing.assert_array_equal(Template(mesh).faces, template.faces)
    np.testing.assert_array_equal(as_arrays(mesh)[0], 2 * template.vertices)
    quads = as_arrays(pyvista.Plane(i_resolution=2, j_resolution=2))[1]
    assert quads.shape == (8, 3)


def test_trimesh_and_back():
    template = sphere_template()
    vertices, faces = np.eye(4, 3)[[0, 1, 2, 0, 1, 3]], [[0, 1, 2], [3, 4, 5]]
    for expected in ((template.vertices, template.faces), (vertices, faces)):
        for source in (to_trimesh(*expected), expected):
            for found, wanted in zip(as_arrays(source), expected, strict=True):
                np.testing.assert_array_equal(found, wanted)
    assert as_arrays(template)[0] is not None
    with pytest.raises(ArgumentTypeError, match="must have vertices and faces.*found ndarray"):
        as_arrays(np.eye(3))


def test_missing_libraries_are_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(MissingDependencyError, match=r"\.\[meshes\]"):
        load_mesh(write(tmp_path, "a.vtk", b""))


def test_a_polygon_of_many_corners(tmp_path):
    """Its vertices are mapped into memory, and its corners are more than a byte counts."""
    angles = np.linspace(0, 2 * np.pi, 500, endpoint=False)
    circle = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    vertex, _ = elements_of(circle, [])
    face = ("face", [("uint", "int", "vertex_indices")], [[list(range(len(circle)))]])
    content = ply([vertex, face], "binary_little_endian")
    vertices, faces = load_mesh(write(tmp_path, "circle.ply", content))
    assert np.array_equal(vertices, circle)
    assert faces[-1].tolist() == [0, 498, 499]
