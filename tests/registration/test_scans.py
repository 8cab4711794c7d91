"""Scans and their landmarks are read from every kind of file, in every unit."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.errors import FileFormatError
from riemhuman.registration import load_landmarks, load_scan
from riemhuman.registration.scans import as_scan


@pytest.fixture(scope="module")
def surface():
    bodies = rh.datasets.load_open_bodies("coarse")
    return bodies[0], bodies.template.faces


@pytest.mark.parametrize("suffix", [".ply", ".obj", ".off"])
def test_meshes_are_read(tmp_path, surface, suffix):
    points, faces = surface
    file = tmp_path / f"scan{suffix}"
    rh.save_mesh(file, points, faces)
    scan = load_scan(file)
    np.testing.assert_array_equal(scan.points, points)
    np.testing.assert_array_equal(scan.faces, faces)
    assert scan.unit == "metres"


@pytest.mark.parametrize("suffix", [".npy", ".xyz", ".ply"])
@pytest.mark.parametrize("with_normals", [False, True])
def test_loose_points_are_read(tmp_path, surface, suffix, with_normals):
    points = surface[0]
    normals = np.tile([0.6, 0.0, 0.8], (len(points), 1))
    rows = np.concatenate([points, normals], axis=1) if with_normals else points
    file = tmp_path / f"scan{suffix}"
    if suffix == ".npy":
        np.save(file, rows)
    elif suffix == ".xyz":
        np.savetxt(file, rows, fmt="%.17g")
    else:
        names = ("x", "y", "z", "nx", "ny", "nz")[: rows.shape[1]]
        header = "".join(f"property double {name}\n" for name in names)
        text = f"ply\nformat ascii 1.0\nelement vertex {len(rows)}\n{header}end_header\n"
        file.write_text(text + "\n".join(" ".join(map(repr, row)) for row in rows.tolist()))
    scan = load_scan(file)
    np.testing.assert_array_equal(scan.points, points)
    assert scan.faces is None
    if with_normals:
        np.testing.assert_allclose(scan.normals, normals, atol=1e-15)
    else:
        assert scan.normals is None


def test_colours_are_no_normals(tmp_path, surface):
    rows = np.concatenate([surface[0], np.full((len(surface[0]), 3), 200.0)], axis=1)
    np.save(tmp_path / "scan.npy", rows)
    assert load_scan(tmp_path / "scan.npy").normals is None


@pytest.mark.parametrize(
    ("size", "unit"), [(1.0, "metres"), (100.0, "centimetres"), (1000.0, "millimetres")]
)
def test_units_are_noticed(tmp_path, surface, size, unit):
    np.save(tmp_path / "scan.npy", size * surface[0])
    scan = load_scan(tmp_path / "scan.npy")
    assert scan.unit == unit
    np.testing.assert_allclose(scan.points, surface[0], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("scan.xyz", "1 2 3\n1 2\n", "it has 2 numbers, and line 1 has 3"),
        ("scan.xyz", "1 2 3\n1 2 nan\n", "holds 1 NaN or infinite"),
        ("scan.ply", "ply\nformat ascii 1.0\nend_header\n", "must have vertices"),
        ("scan.txt", "", "the ending must be one of .ply"),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(rh.errors.FileFormatError, match=rf"{name}: .*{message}"):
        load_scan(tmp_path / name)


def test_sizes_of_no_body_and_few_points_are_refused(tmp_path, surface):
    file = tmp_path / "scan.npy"
    np.save(file, 39.37 * surface[0])
    np.testing.assert_allclose(load_scan(file, "inches").points, surface[0])
    np.save(file, 10.0 * surface[0])
    with pytest.raises(rh.errors.ArgumentError, match=r"scan.npy is 1\d.* long.*unit="):
        load_scan(file)
    np.save(file, np.ones((10, 3)))
    with pytest.raises(rh.errors.ArgumentError, match="has 10 points; at least 200"):
        load_scan(file)


def test_a_table_with_and_without_a_header(tmp_path):
    file = tmp_path / "marks.csv"
    for header in ("", "Name,x,y,z\n"):
        file.write_text(f"{header}left_wrist, 0.62, 1.31, 0.05\nhead,0,1.6,0\n", encoding="utf-8")
        found = load_landmarks(file)
        assert list(found) == ["left_wrist", "head"]
        np.testing.assert_array_equal(found["left_wrist"], [0.62, 1.31, 0.05])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no rows"),
        ("head,1,2\n", r"landmarks must have shape \(1, 3\); found \(1, 2\)"),
        ("head,1,2,3\nhead,1,2,4\n", "line 2: the name 'head' is repeated"),
        ("head,1,2,high\n", "line 1: 'high' is not a number"),
        ("head,1,2,nan\n", "NaN"),
    ],
)
def test_wrong_tables(tmp_path, text, message):
    file = tmp_path / "marks.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(FileFormatError, match=message) as refusal:
        load_landmarks(file)
    assert "marks.csv" in str(refusal.value)


def test_strays_do_not_count_for_the_size_of_a_scan(surface):
    """Which tells its unit, and how far away a point may be."""
    rng = np.random.default_rng(0)
    strays = rng.uniform(-9.0, 9.0, (8, 3))  # of 1,202 points
    points = np.concatenate([surface[0], strays])
    assert as_scan(100.0 * points).unit == "centimetres"
