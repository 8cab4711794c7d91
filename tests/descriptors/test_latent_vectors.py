"""Vectors from files: three formats, ids, and every way in which they can be wrong."""

import numpy as np
import pytest

from riemhuman.descriptors import LatentVectors
from riemhuman.errors import ArgumentError, FileFormatError, NotDefinedError

VECTORS = np.array([[1.0, 2.5], [-3.0, 1e-3], [0.0, 7.0]])
IDS = ("tr_reg_000", "tr_reg_001", "tr_reg_010")


def write(folder, name, text):
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_formats(tmp_path):
    np.savez(tmp_path / "a.npz", ids=np.array(IDS), vectors=VECTORS)
    np.save(tmp_path / "b.npy", VECTORS)
    rows = [
        ",".join([name, *map(repr, row)]) for name, row in zip(IDS, VECTORS.tolist(), strict=True)
    ]
    headed = write(tmp_path, "c.csv", "\ufeffID,x,y\n" + "\n".join(rows) + "\n\n")
    bare = write(tmp_path, "d.CSV", "\r\n".join(rows))
    for path in (tmp_path / "a.npz", headed, bare, str(bare)):
        found = LatentVectors.from_file(path)
        assert found.ids == IDS
        np.testing.assert_array_equal(found.vectors, VECTORS)
    numbered = LatentVectors.from_file(tmp_path / "b.npy")
    assert numbered.ids == ("0", "1", "2")
    np.savez(tmp_path / "e.npz", ids=np.array([7, 3, 5]), vectors=VECTORS)
    assert LatentVectors.from_file(tmp_path / "e.npz").ids == ("7", "3", "5")
    np.savez(tmp_path / "f.npz", ids=np.array([b"x", b"y", b"z"]), vectors=VECTORS)
    assert LatentVectors.from_file(tmp_path / "f.npz").ids == ("x", "y", "z")


class Named(list):
    """Bodies of which the names are known."""

    def __init__(self, ids):
        super().__init__([None] * len(ids))
        self.ids = ids


def test_selection_follows_the_data_set():
    latent = LatentVectors(IDS, VECTORS)
    chosen = latent.select(["tr_reg_010", "tr_reg_000"])
    np.testing.assert_array_equal(chosen.vectors, VECTORS[[2, 0]])
    bodies = Named(["tr_reg_001", "tr_reg_010"])
    np.testing.assert_array_equal(latent.describe_all(bodies), VECTORS[[1, 2]])
    by_number = LatentVectors(range(3), VECTORS)
    np.testing.assert_array_equal(by_number.describe_all([None, None]), VECTORS[:2])
    # One row for each body, in order: what they are called does not matter.
    np.testing.assert_array_equal(by_number.describe_all(Named(IDS)), VECTORS)
    np.testing.assert_allclose(latent.distances(VECTORS)[0, 2], np.hypot(1.0, 4.5))


def test_a_part_that_does_not_match_is_told_item_by_item():
    latent = LatentVectors(IDS, VECTORS)
    with pytest.raises(
        ArgumentError,
        match=r"2 of 3 bodies have no vector: a, b; .* without a body: tr_reg_000, tr_reg_001",
    ):
        latent.select(["a", "tr_reg_010", "b"])
    with pytest.raises(ArgumentError, match="3 of 3 bodies have no vector: 0, 1, 2"):
        latent.describe_all([None] * 3)
    with pytest.raises(NotDefinedError, match="cannot describe a new mesh"):
        latent.describe(np.zeros((3, 3)), [[0, 1, 2]])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a,1\nb,2\na,3\n", r"line 3: the id 'a' is repeated"),
        ("a,1\nb,nan\n", r"holds 1 NaN or infinite entries"),
        ("a," + "1" * 200_000 + "\n", r"line 1: field larger than|NaN or infinite"),
    ],
)
def test_wrong_csv(tmp_path, text, message):
    with pytest.raises(FileFormatError, match=message) as refusal:
        LatentVectors.from_file(write(tmp_path, "codes.csv", text))
    assert "codes.csv" in str(refusal.value)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"ids": np.array(IDS)}, "lacks the fields vectors"),
        ({"ids": np.array(["a", "b", "a"]), "vectors": VECTORS}, "repeated ids: a"),
        ({"ids": np.array(["a", "", "c"]), "vectors": VECTORS}, r"ids\[1\] is missing"),
        ({"ids": np.array([0.5, 1, 2]), "vectors": VECTORS}, r"ids\[0\] must be text or a whole"),
    ],
)
def test_wrong_npz(tmp_path, fields, message):
    np.savez(tmp_path / "codes.npz", **fields)
    with pytest.raises(FileFormatError, match=message) as refusal:
        LatentVectors.from_file(tmp_path / "codes.npz")
    assert "codes.npz" in str(refusal.value)
