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


def test_sizes_in_any_order_of_memory():
    """Whatever is found fastest: sums of squares, or the largest and smallest numbers."""
    surfaces = np.random.default_rng(0).normal(size=(4, 5, 3))
    for number, message in (
        (np.nan, "the first at index .2, 3, 1."),
        (-np.inf, "the first at index .2, 3, 1."),
        (-1e61, "choose another unit"),
    ):
        wrong = surfaces.copy()
        wrong[2, 3, 1] = number
        for array in (wrong, np.asfortranarray(wrong), np.repeat(wrong, 2, axis=1)[:, ::2]):
            with pytest.raises(ArgumentError, match=message):
                checks.real_array(array, "points", ("n", 3), lengths=True)
    small = surfaces.copy()
    small[1] *= 1e-70
    for array in (small, small[1], np.asfortranarray(small[1])):
        with pytest.raises(ArgumentError, match="choose another unit"):
            checks.real_array(array, "points", ("n", 3), lengths=True)
    zeros = np.zeros((5, 3))
    np.testing.assert_array_equal(checks.real_array(zeros, "points", ("n", 3), lengths=True), zeros)
    # The sum of the squares is above that of the bound, and no number is.
    ones = np.full(100, 2.0)
    assert checks.real_array(ones, "shares", maximum=2.0) is ones
    with pytest.raises(ArgumentError, match="entries of at most 2 in absolute value"):
        checks.real_array(ones * 1.01, "shares", maximum=2.0)


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
def test_masked_entries_and_ragged_lists_are_refused_by_name(check):
    shape = () if check is checks.real_array else (("n", 2),)
    masked = np.ma.masked_array([[1, 2], [3, 4]], mask=[[0, 1], [0, 0]])
    for array in (masked, [masked[0], masked[1]], (masked[0], [1, 2])):
        with pytest.raises(ArgumentTypeError, match="points has 1 masked entries"):
            check(array, "points", *shape)
    plain = np.ma.masked_array([[1, 2], [3, 4]], mask=False)
    np.testing.assert_array_equal(check(plain, "points", *shape), [[1, 2], [3, 4]])
    for ragged in ([[1, 2], [3]], [np.ones((2, 3)), np.ones((3, 3))]):
        with pytest.raises(ArgumentTypeError, match="points .* items have different shapes"):
            check(ragged, "points", *shape)


def test_whole_numbers_at_the_edges_of_their_type():
    for number in (2**63 - 1, 2**63 - 600, -(2**63)):
        assert checks.integer_array([number], "faces", ("n",)).tolist() == [number]
    for number in (2**63, 2**64 - 1):
        with pytest.raises(ArgumentError, match="at most 64 bits"):
            checks.integer_array(np.array([number], np.uint64), "faces", ("n",))


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


# Numbers.


def test_real_numbers():
    for value in (2, 2.0, np.float32(2), np.int64(2), np.array(2.0)):
        number = checks.real_number(value, "lam", minimum=0.0)
        assert type(number) is float
        assert number == 2.0
    assert checks.real_number(0, "lam", minimum=0.0) == 0.0
    for value, options, message in (
        (-1, {"minimum": 0.0}, "lam must be a finite number of at least 0; found -1"),
        (0, {"minimum": 0.0, "strict": True}, "lam must be a finite number above 0; found 0"),
        (np.nan, {}, "lam must be a finite number; found nan"),
        (-np.inf, {}, "lam must be a finite number; found -inf"),
    ):
        with pytest.raises(ArgumentError, match=message):
            checks.real_number(value, "lam", **options)
    others = [
        "2",
        "1_0",
        b"2",
        np.array("2"),
        np.str_("2"),
        np.array(60, "M8[s]"),
        np.array(2 + 0j),
    ]
    for value in (None, "small", 1j, [1.0, 2.0], np.array([2.0]), object(), *others):
        with pytest.raises(ArgumentTypeError, match="lam must be a real number; found"):
            checks.real_number(value, "lam")


def test_whole_numbers():
    for value in (3, np.int32(3), np.uint8(3)):
        assert checks.whole_number(value, "n", minimum=3) == 3
    assert checks.whole_number(-5, "n") == -5
    with pytest.raises(ArgumentError, match="n must be a whole number of at least 3; found 2"):
        checks.whole_number(2, "n", minimum=3)
    for value in (3.0, "3", None, [3]):
        with pytest.raises(ArgumentTypeError, match="n must be a whole number; found"):
            checks.whole_number(value, "n")


def test_one_of():
    assert checks.one_of("b", "mode", ("a", "b")) == "b"
    with pytest.raises(ArgumentError, match="mode must be one of 'a', 'b'; found 'c'"):
        checks.one_of("c", "mode", ("a", "b"))


def test_generators():
    rng = np.random.default_rng(1)
    assert checks.generator(rng) is rng
    assert checks.generator(5).random() == np.random.default_rng(5).random()
    assert checks.generator(None).random() != checks.generator(None).random()
    with pytest.raises(ArgumentError, match="rng must be a whole number of at least 0; found -1"):
        checks.generator(-1)
    for wrong in (0.5, "seed", np.random.RandomState(0)):
        with pytest.raises(ArgumentTypeError, match="rng must be a whole number; found"):
            checks.generator(wrong)


@pytest.mark.parametrize("value", [10**400, -(10**400)])
def test_whole_numbers_beyond_all_floats_are_no_real_numbers(value):
    with pytest.raises(ArgumentError, match="step must be a finite number"):
        checks.real_number(value, "step")


@pytest.mark.parametrize("value", [np.zeros((2, 2)), np.array(["a"]), np.zeros(2, [("x", "f8")])])
def test_no_array_is_one_of_some_choices(value):
    with pytest.raises(ArgumentError, match="name must be one of 'a', 'b'"):
        checks.one_of(value, "name", ("a", "b"))


def test_items():
    assert checks.items_of(iter([1, 2]), "parts", "a list") == (1, 2)
    for value in (None, 3, "ab", b"ab", {"a": 1}, np.array(1.0)):
        with pytest.raises(ArgumentTypeError, match="parts must be a list; found"):
            checks.items_of(value, "parts", "a list")


def test_flags():
    for value, answer in ((True, True), (np.bool_(False), False), (1, True), (np.int64(0), False)):
        assert checks.flag(value, "scale") is answer
    for value in (None, "yes", 2, -1, 0.5, [True], np.array([True, False]), object()):
        with pytest.raises(ArgumentTypeError, match="scale must be True or False; found"):
            checks.flag(value, "scale")


def test_masks():
    assert checks.mask([True, False], "trusted", ((3, 2), (2,))).tolist() == [True, False]
    for value in ([1, 0], [True], [[True], [True, False]], None, "x", np.nan):
        with pytest.raises((ArgumentError, ArgumentTypeError), match="trusted"):
            checks.mask(value, "trusted", ((3, 2), (2,)))


@pytest.mark.parametrize("value", [np.array(1.0), list, 3, None, "ab"])
def test_no_number_and_no_class_has_a_length(value):
    with pytest.raises(ArgumentTypeError, match="points must be an array"):
        checks.length_of(value, "points")
