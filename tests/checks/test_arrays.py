"""Checks say which argument was wrong, what was found and what was expected."""

import re

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad

from riemhuman import checks
from riemhuman.errors import ArgumentError, ArgumentTypeError

# Arrays.


@pytest.mark.parametrize(
    "array",
    [
        [[1, 2], [3, 4]],
        ((1.0, 2.0), (3.0, 4.0)),
        np.eye(2, dtype=np.float32),
        np.eye(2, dtype=bool),
    ],
)
def test_real_arrays_become_float64(array):
    found = checks.real_array(array, "points", (2, 2))
    assert found.dtype == np.float64
    np.testing.assert_array_equal(found, np.asarray(array, dtype=float))


def test_float64_is_not_copied():
    array = np.eye(2)
    assert checks.real_array(array, "points") is array


@pytest.mark.parametrize(
    ("shape", "batched", "found", "expected"),
    [
        ((3, 3), True, (2, 3), "..., 3, 3"),
        ((3, 3), True, (3,), "..., 3, 3"),
        (("n_points", 3), True, (4, 2), "..., n_points, 3"),
        (("n_points", 3), False, (2, 4, 3), "n_points, 3"),
        ((3,), True, (), "..., 3"),
        ((3, 3), True, (3, 3), None),
        ((3, 3), True, (5, 2, 3, 3), None),
        (("n", 3), False, (7, 3), None),
        (("n", 3), True, (0, 3), None),
        (None, True, (4, 2), None),
        ((), True, (2,), None),
    ],
)
def test_shapes(shape, batched, found, expected):
    if expected is None:
        assert checks.real_array(np.zeros(found), "f", shape, batched=batched).shape == found
    else:
        message = re.escape(f"f must have shape ({expected}); found {found}")
        with pytest.raises(ArgumentError, match=message):
            checks.real_array(np.zeros(found), "f", shape, batched=batched)


@pytest.mark.parametrize(
    ("array", "found"),
    [
        ("abc", "str 'abc'"),
        (None, "NoneType None"),
        (np.zeros(2, dtype=complex), "ndarray of dtype complex128"),
        ([1.0, None], "list of dtype object"),
        (["1", "2"], "list of dtype <U1"),
        ({"a": 1}, "dict {'a': 1}"),
        (np.array(["2020-01-01"], dtype="datetime64[D]"), "dtype datetime64"),
    ],
)
def test_other_types(array, found):
    with pytest.raises(
        ArgumentTypeError, match="f must be an array of real numbers; found"
    ) as error:
        checks.real_array(array, "f")
    assert found in str(error.value)


def test_what_is_not_finite():
    array = np.zeros((2, 3))
    array[1, 0], array[1, 2] = np.nan, -np.inf
    message = r"f holds 2 NaN or infinite entries, the first at index \(1, 0\); every entry must"
    with pytest.raises(ArgumentError, match=message):
        checks.real_array(array, "f")
    assert checks.real_array(array, "f", finite=False) is array


def test_entries_have_a_largest_size():
    ones = np.full(100, 2.0)
    assert checks.real_array(ones, "shares", maximum=2.0) is ones
    with pytest.raises(ArgumentError, match="entries of at most 2 in absolute value"):
        checks.real_array(-ones * 1.01, "shares", maximum=2.0)


def test_traced_arrays_keep_their_tape():
    seen = []

    def function(x):
        seen.append(checks.values_of(x))
        return anp.sum(checks.real_array(x, "x", (3,)) ** 2)

    np.testing.assert_array_equal(grad(function)(np.arange(3.0)), [0, 2, 4])
    second = grad(lambda x: anp.sum(grad(function)(x)))(np.arange(3.0))
    np.testing.assert_array_equal(second, [2, 2, 2])
    assert all(type(values) is np.ndarray for values in seen)
    with pytest.raises(ArgumentError, match="x must have shape"):
        grad(function)(np.arange(4.0))
    with pytest.raises(ArgumentError, match="x holds 1 NaN"):
        grad(function)(np.array([0.0, np.nan, 1.0]))


@pytest.mark.parametrize("check", [checks.real_array, checks.integer_array])
def test_ragged_lists_are_refused_by_name(check):
    for ragged in ([[1, 2], [3]], [np.ones((2, 3)), np.ones((3, 3))]):
        with pytest.raises(ArgumentTypeError, match="points .* items have different shapes"):
            check(ragged, "points", ("n", 2))


def test_integer_arrays():
    for array in ([[0, 1, 2]], np.array([[0, 1, 2]], dtype=np.uint8), [[0.0, 1.0, 2.0]]):
        found = checks.integer_array(array, "faces", ("n_faces", 3))
        assert found.dtype == np.int64
        np.testing.assert_array_equal(found, [[0, 1, 2]])
    for wrong, message in (
        ([[0.5, 1, 2]], "faces must be an array of whole numbers; found list of dtype float64"),
        ([[np.nan, 1, 2]], "faces must be an array of whole numbers"),
        ([["a", "b", "c"]], "faces must be an array of whole numbers"),
        (
            [[True, False, True]],
            "faces must be an array of whole numbers; found list of dtype bool",
        ),
    ):
        with pytest.raises(ArgumentTypeError, match=message):
            checks.integer_array(wrong, "faces", ("n_faces", 3))
    for wrong in ([0, 1, 2], [[0, 1]], [[[0, 1, 2]]]):
        with pytest.raises(ArgumentError, match=r"faces must have shape \(n_faces, 3\); found"):
            checks.integer_array(wrong, "faces", ("n_faces", 3))
    faces = np.array([[0, 1, 2]])
    assert checks.integer_array(faces, "faces", ("n_faces", 3)) is not faces


def test_masks():
    assert checks.mask([True, False], "trusted", ((3, 2), (2,))).tolist() == [True, False]
    for value in ([1, 0], [True], [[True], [True, False]], None, "x", np.nan):
        with pytest.raises((ArgumentError, ArgumentTypeError), match="trusted"):
            checks.mask(value, "trusted", ((3, 2), (2,)))


@pytest.mark.parametrize("value", [np.array(1.0), list, 3, None, "ab"])
def test_no_number_and_no_class_has_a_length(value):
    with pytest.raises(ArgumentTypeError, match="points must be an array"):
        checks.length_of(value, "points")
