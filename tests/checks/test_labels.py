"""Labels and names are texts, or can be one; those that pages cannot show are refused."""

import re
from pathlib import Path

import numpy as np
import pytest

from riemhuman.checks.labels import (
    class_indices,
    class_numbers,
    names_of,
    text,
    text_or_number,
    texts_of,
    texts_or_numbers,
)
from riemhuman.errors import ArgumentError, ArgumentTypeError


def test_classes_are_ascending_where_labels_have_an_order():
    numbers, classes = class_numbers(["b", "a", "b"], "subjects", 3)
    assert (numbers.tolist(), classes) == ([1, 0, 1], ["a", "b"])
    numbers, classes = class_numbers(np.array([3, 1, 3]), "subjects", 3)
    assert (numbers.tolist(), classes) == ([1, 0, 1], [1, 3])
    numbers, classes = class_numbers(["b", 1, "b"], "subjects", 3)
    assert (numbers.tolist(), classes) == ([0, 1, 0], ["b", 1])
    with pytest.raises(ArgumentError, match="subjects must hold a label for each of 2 points"):
        class_numbers(["a"], "subjects", 2)


def test_indices_of_classes_are_whole_numbers():
    assert class_indices((2, np.int8(0)), "subject", 2).tolist() == [2, 0]
    for labels in (["a", "b"], [0.5, 1.0], [None, 1]):
        with pytest.raises((ArgumentError, ArgumentTypeError), match="subject"):
            class_indices(labels, "subject", 2)


def test_texts():
    assert texts_of(np.array(["a", "b"]), "names") == ("a", "b")
    for value in ([1], [None], "ab", None, np.zeros(2)):
        with pytest.raises(ArgumentTypeError, match="names must be a list of texts; found"):
            texts_of(value, "names")


def test_names_are_texts_numbers_or_paths_that_pages_can_show():
    named = names_of(["Anna", np.str_("Ben"), 3, np.int64(4)], "names", 4, "bodies")
    assert named == ("Anna", "Ben", "3", "4")
    times = np.linspace(0.0, 1.0, 3)
    assert names_of(times, "labels", 3, "surfaces") == ("0.0", "0.5", "1.0")
    assert texts_or_numbers([Path("a.ply"), 0.25], "ids") == ("a.ply", "0.25")
    assert text_or_number(7, "subject") == "7"
    with pytest.raises(ArgumentTypeError, match="subject must be a text; found None"):
        text_or_number(None, "subject")
    for names, message in (
        (["a"], "names must name each of the 2 bodies; found 1"),
        ("ab", "names must be a sequence of texts, one for each of the 2 bodies; found str"),
        ({"a", "b"}, "found set"),
        ({"a": 1, "b": 2}, "found dict"),
        (["a", None], "names must be a text; found None"),
        (["a", np.nan], "found nan"),
        (["a", True], "found True"),
        (["a", "b\0"], "names must be a text without control characters"),
        (["a", "\ud800"], "without control characters"),
    ):
        with pytest.raises((ArgumentError, ArgumentTypeError), match=re.escape(message)):
            names_of(names, "names", 2, "bodies")
    assert text("two\nlines", "title") == "two\nlines"
    with pytest.raises(ArgumentTypeError, match="title must be a text; found NoneType"):
        text(None, "title")
