"""Scans are read from every kind of file, and their units noticed."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.registration import load_scan


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


def test_colours_are_not_taken_for_normals(tmp_path, surface):
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


def test_inches_are_taken_when_they_are_asked_for(tmp_path, surface):
    np.save(tmp_path / "scan.npy", 39.37 * surface[0])
    np.testing.assert_allclose(load_scan(tmp_path / "scan.npy", "inches").points, surface[0])


def test_a_size_of_no_body_is_refused(tmp_path, surface):
    np.save(tmp_path / "scan.npy", 10.0 * surface[0])
    with pytest.raises(rh.errors.ArgumentError, match=r"scan.npy is 1\d.* long.*unit="):
        load_scan(tmp_path / "scan.npy")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("scan.xyz", "1 2 3\n1 2\n", "line 2 must hold 3 numbers, as the first; found '1 2'"),
        ("scan.xyz", "1 2 3\n1 2 nan\n", "point 1 .* is not finite"),
        ("scan.ply", "ply\nformat ascii 1.0\nend_header\n", "must have vertices"),
        ("scan.txt", "", "the ending must be one of .ply"),
    ],
)
def test_damaged_files_are_refused_by_name(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(rh.errors.FileFormatError, match=rf"{name}: .*{message}"):
        load_scan(tmp_path / name)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(rh.errors.FileError, match=r"there is no file .*scan\.ply"):
        load_scan(tmp_path / "scan.ply")


def test_few_points_are_refused(tmp_path):
    np.save(tmp_path / "scan.npy", np.ones((10, 3)))
    with pytest.raises(rh.errors.ArgumentError, match="has 10 points; at least 200"):
        load_scan(tmp_path / "scan.npy")
