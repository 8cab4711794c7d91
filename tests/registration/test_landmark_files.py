"""Landmarks of a scan are read from a table, and what is no landmark is refused by line."""

import numpy as np
import pytest

from riemhuman.errors import FileFormatError
from riemhuman.registration import load_landmarks


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
