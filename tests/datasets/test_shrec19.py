"""SHREC'19 is read with its matches; what is missing or damaged in it is named."""

import numpy as np
import pytest
from matched_people import write_stand_ins
from scipy.io import savemat

from riemhuman.datasets import load_shrec19
from riemhuman.errors import FileError, FileFormatError


@pytest.fixture
def folder(tmp_path, bodies):
    write_stand_ins(tmp_path / "data", bodies, (0, 14), (300, 400), np.random.default_rng(0))
    return tmp_path


def test_meshes_and_matches_are_read_from_any_folder_above(folder, bodies):
    meshes = load_shrec19(folder)
    assert meshes.names == ("1", "2")
    np.testing.assert_array_equal(meshes.pairs, [[0, 1], [1, 0]])
    first, second = meshes[0], meshes[1]
    for mesh in (first, second):
        assert mesh.faces.min() == 0
        assert mesh.faces.max() == len(mesh.vertices) - 1
        assert len(mesh.places) == bodies.template.n_vertices
    matches = meshes.matches(0, 1)
    assert len(matches) == len(first.vertices)
    # Both tables lead to the same places, but for the distance of neighbours.
    gaps = second.vertices[matches[first.places]] - second.vertices[second.places]
    assert np.median(np.linalg.norm(gaps, axis=1)) < 0.08


def test_numbers_of_files_count_as_numbers(folder, bodies):
    (folder / "data/mat/2.mat").rename(folder / "data/mat/10.mat")
    (folder / "data/PAIRS_list_SHREC19_connectivity.txt").write_text("10 1\n\n", encoding="utf-8")
    meshes = load_shrec19(folder)
    assert meshes.names == ("1", "10")
    np.testing.assert_array_equal(meshes.pairs, [[1, 0]])
    with pytest.raises(FileError, match="no matches between the meshes 1 and 10"):
        meshes.matches(0, 1)


def shape(**changes):
    corners = {"VERT": np.eye(3), "TRIV": [[1.0, 2.0, 3.0]], "smpl_matches": [1, 2, 3]}
    return {"Shape_df": corners | changes}


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("variables", "message"),
    [
        ({"other": 1}, "it holds no structure Shape_df"),
        ({"Shape_df": {"VERT": np.eye(3)}}, "must be one structure with .*; found VERT"),
        (shape(TRIV=[[0.0, 1.0, 2.0]]), r"TRIV must hold vertex numbers from 1 to 3; found 0 to 2"),
        (shape(TRIV=[[1.0, 2.5, 3.0]]), "TRIV must hold whole numbers"),
        (shape(smpl_matches=[1, 4]), "smpl_matches must hold vertex numbers from 1 to 3"),
        (shape(VERT=np.full((3, 3), np.nan)), "vertices"),
    ],
)
def test_wrong_structures_are_refused(folder, variables, message):
    savemat(folder / "data/mat/1.mat", variables)
    with pytest.raises(FileFormatError, match=message) as refusal:
        load_shrec19(folder)[0]
    assert "1.mat" in str(refusal.value)


def test_missing_and_wrong_lists_are_refused(folder):
    data = folder / "data"
    pairs, matches = data / "PAIRS_list_SHREC19_connectivity.txt", data / "matches/FARMgt_txt"
    for text, error, message in (
        ("1,2,3\n", FileFormatError, "line 1: two numbers expected; found '1,2,3'"),
        ("1,2\n1,9\n", FileError, r"line 2: there is no mesh 9\.mat"),
    ):
        pairs.write_text(text, encoding="utf-8")
        with pytest.raises(error, match=message):
            load_shrec19(folder)
    pairs.write_text("1,2\n", encoding="utf-8")
    (matches / "1_2.txt").write_text("1\n2\n", encoding="utf-8")
    with pytest.raises(FileFormatError, match="holds 2 matches; the mesh 1 has"):
        load_shrec19(folder).matches(0, 1)
    pairs.unlink()
    with pytest.raises(FileError, match="holds no list of pairs"):
        load_shrec19(folder)
    with pytest.raises(FileError, match="no file has a name such as 1.mat"):
        load_shrec19(matches)
