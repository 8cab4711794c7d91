"""The verb basis, on open motions, HDF5 files and folders of meshes."""

import json

import h5py
import numpy as np
import pytest

from riemhuman.datasets import load_open_motions
from riemhuman.io import save_mesh
from riemhuman.surfaces import DeformationBasis


@pytest.fixture(scope="module")
def motion():
    (motion,) = load_open_motions("coarse", "lean runner", "knees", frames_per_second=10)
    return motion


def write_frames(folder, motion, ending="ply"):
    folder.mkdir(parents=True)
    for number, frame in enumerate(motion):
        save_mesh(folder / f"frame{number}.{ending}", frame, motion.faces)
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


def test_folders_of_meshes_are_motions(run, motion, tmp_path):
    expected = DeformationBasis.from_motions([motion[:]], 3, 2)
    one = write_frames(tmp_path / "knees", motion)
    for motions in ([one], [write_frames(tmp_path / "all" / "knees", motion, "off").parent]):
        finished = run("basis", *motions, "-o", tmp_path / "b.npz", "-n", 3, "--step", 2, "-f")
        assert finished.code == 0, finished.err
        found = DeformationBasis.load(tmp_path / "b.npz")
        np.testing.assert_array_equal(found.vectors, expected.vectors)
    assert "% of the variance of the motions" in finished.out


def test_dynamic_faust(run, motion, tmp_path):
    with h5py.File(tmp_path / "registrations_m.hdf5", "w") as file:
        file["50002_knees"] = np.moveaxis(motion[:], 0, -1)
        file["50002_hips"] = np.moveaxis(motion[::-1], 0, -1)
        file["faces"] = motion.faces
    options = ("-n", 3, "--step", 2, "--sequences", "knees")
    for source in (tmp_path / "registrations_m.hdf5", tmp_path):
        run("basis", source, "-o", tmp_path / "b.npz", *options, "--force")
        found = DeformationBasis.load(tmp_path / "b.npz").vectors
        expected = DeformationBasis.from_motions([motion[:]], 3, 2).vectors
        np.testing.assert_array_equal(found, expected)


def test_failures(refused, motion, tmp_path):
    output = ("-o", tmp_path / "basis.npz")
    assert "or --open" in refused("basis", *output)
    assert "or --open" in refused("basis", tmp_path, "--open", *output)
    assert "no file or folder" in refused("basis", tmp_path / "absent.hdf5", *output)
    assert "holds no motion" in refused("basis", tmp_path, *output)
    frames = write_frames(tmp_path / "knees", motion)
    assert "step=500" in refused("basis", frames, *output, "--step", 500)
    assert "exceeds the rank" in refused("basis", frames, *output)
    assert "choose from HDF5" in refused("basis", frames, *output, "--sequences", "knees")
    assert "lean runner" in refused("basis", "--open", *output, "--subjects", "nobody")
    other = tmp_path / "other"
    other.mkdir()
    for number in range(3):
        save_mesh(other / f"{number}.ply", motion[0], motion.faces[::-1])
    message = refused("basis", frames, other, *output)
    assert "other and knees do not" in message
    save_mesh(frames / "frame4.ply", motion[0], motion.faces[::-1])
    assert "frame4.ply is not registered" in refused("basis", frames, *output, "--step", 1)
    assert not (tmp_path / "basis.npz").exists()
