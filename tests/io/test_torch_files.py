"""Files of PyTorch are data: tensors are read, malformed and hostile ones are refused."""

import numpy as np
import pytest
from torch_files import Tensor, torch_file

from riemhuman.errors import FileFormatError
from riemhuman.io.torch_files import load_torch_tree

ROWS = np.random.default_rng(0).normal(size=(6, 72))


@pytest.mark.parametrize("order", ["little", "big"])
def test_tensors_of_any_strides(tmp_path, order):
    stored = ROWS.astype("<f8" if order == "little" else ">f8")
    content = {
        "rows": Tensor(stored),
        "turned": Tensor(stored, strides=(1, 72), shape=(72, 6)),
        "repeated": Tensor(stored, offset=72, shape=(3, 72), strides=(0, 1)),
        "name": "ann",
    }
    tree = load_torch_tree(torch_file(tmp_path / "a.pt", content, byteorder=order))
    assert tree["name"] == "ann"
    np.testing.assert_array_equal(tree["rows"], ROWS)
    np.testing.assert_array_equal(tree["turned"], ROWS.T)
    np.testing.assert_array_equal(tree["repeated"], [ROWS[1]] * 3)


@pytest.mark.parametrize(
    ("tensor", "message"),
    [
        (Tensor(ROWS, "QInt8Storage"), r"asks for torch\.QInt8Storage"),
        (Tensor(ROWS, shape=(7, 72)), "larger than its data"),
        (Tensor(ROWS, offset=1), "larger than its data"),
        (Tensor(ROWS, strides=(-72, 1)), "malformed tensor"),
        (Tensor(ROWS, shape=(2**30, 72), strides=(0, 1)), "more often than its size allows"),
    ],
)
def test_hostile_tensors(tmp_path, tensor, message):
    file = torch_file(tmp_path / "a.pt", {"poses": tensor})
    with pytest.raises(FileFormatError, match=message):
        load_torch_tree(file)
