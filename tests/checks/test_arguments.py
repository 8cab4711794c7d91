"""Arguments are checked where they are declared, whichever way they are passed."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from riemhuman import checks
from riemhuman.checks import OfOwner, checked, choice, each, instance, positive, real, share, whole
from riemhuman.errors import ArgumentError, ArgumentTypeError

# The decorator.


@checked(n=whole(minimum=2), size=positive, mode=choice("a", "b"))
def called(n, size=-1.0, mode=None, *rest, **options):
    """Return what it is called with."""
    return n, size, mode, rest, options


def test_the_function_gets_the_values_that_checks_return():
    n, size, *_ = called(np.int64(3), np.float32(2.0))
    assert (type(n), n, type(size), size) == (int, 3, float, 2.0)
    n, size, mode, *_ = called(mode="a", size=4, n=np.int64(2))
    assert (type(n), type(size), size, mode) == (int, float, 4.0, "a")


def test_positions_and_names_are_checked_alike():
    for refused in (
        lambda: called(1),
        lambda: called(n=1),
        lambda: called(3, 0.0),
        lambda: called(3, size=0.0),
        lambda: called(3, 1.0, "c"),
        lambda: called(3, mode="c"),
    ):
        with pytest.raises(ArgumentError, match="n must be|size must be|mode must be"):
            refused()


def test_defaults_are_not_checked_and_none_passes_where_it_is_the_default():
    assert called(3) == (3, -1.0, None, (), {})
    assert called(3, 1.0, None) == (3, 1.0, None, (), {})
    assert called(3, mode=None)[2] is None
    with pytest.raises(ArgumentTypeError, match="size must be a real number; found None"):
        called(3, None)
    with pytest.raises(ArgumentTypeError, match="n must be a whole number; found None"):
        called(None)


def test_what_is_not_declared_passes_unchanged():
    rest, options = object(), object()
    assert called(3, 1.0, "b", rest, other=options)[3:] == ((rest,), {"other": options})
    with pytest.raises(TypeError, match="missing 1 required positional argument: 'n'"):
        called()
    assert (called.__name__, called.__doc__) == ("called", "Return what it is called with.")


@checked(n_nodes=whole(minimum=2), labels=each(choice("x", "y"), "a list of labels"))
@dataclass(frozen=True)
class Search:
    n_nodes: int = 11
    labels: tuple = ()
    kept: list = field(default_factory=list)


@checked(weight=share)
@dataclass(frozen=True)
class WeightedSearch(Search):
    weight: float = 0.5


@checked()
@dataclass(frozen=True)
class ShortSearch(Search):
    n_nodes: int = 3


@checked(n_nodes=whole(minimum=5))
@dataclass(frozen=True)
class LongSearch(WeightedSearch):
    n_nodes: int = 50


def test_data_classes_check_their_fields_and_those_of_their_bases():
    assert Search(np.int64(4), ["x", "y"]) == Search(n_nodes=4, labels=("x", "y"))
    assert (Search().n_nodes, ShortSearch().n_nodes, WeightedSearch().weight) == (11, 3, 0.5)
    for refused in (
        lambda: Search(1),
        lambda: Search(n_nodes=1),
        lambda: WeightedSearch(1),
        lambda: ShortSearch(n_nodes=1),
        lambda: LongSearch(4),
    ):
        with pytest.raises(ArgumentError, match="n_nodes must be a whole number of at least"):
            refused()
    for refused in (lambda: WeightedSearch(weight=2.0), lambda: LongSearch(5, (), [], 2.0)):
        with pytest.raises(ArgumentError, match="weight must be at most 1; found 2"):
            refused()
    with pytest.raises(ArgumentError, match=r"labels\[1\] must be one of 'x', 'y'; found 'z'"):
        Search(labels=("x", "z"))
    assert WeightedSearch(4).n_nodes == 4  # a subclass with a stricter check leaves its base alone


class Interval:
    def __init__(self, end):
        self.end = end

    def check_point(self, value, name):
        return checks.real_number(value, name, minimum=0.0, maximum=self.end)

    @checked(point=OfOwner(lambda interval: interval.check_point), times=whole(minimum=1))
    def scaled(self, point, times=1):
        return times * point


def test_an_object_checks_the_arguments_of_its_methods():
    assert type(Interval(2.0).scaled(np.int64(2))) is float
    assert Interval(2.0).scaled(point=1, times=3) == 3.0
    for refused in (lambda: Interval(2.0).scaled(3.0), lambda: Interval(2.0).scaled(point=3.0)):
        with pytest.raises(ArgumentError, match="point must be at most 2; found 3"):
            refused()
    assert Interval(4.0).scaled(3.0) == 3.0


# Checks.


def test_real_numbers():
    for value in (2, 2.0, np.float32(2), np.int64(2), np.array(2.0)):
        number = real(minimum=0.0)(value, "lam")
        assert (type(number), number) == (float, 2.0)
    assert (real(minimum=0.0)(0, "lam"), share(1, "lam"), real(maximum=2.0)(2, "lam")) == (0, 1, 2)
    assert real(minimum=-1.0, above=-2.0)(-1.0, "lam") == -1.0
    for value, check, message in (
        (-1, real(minimum=0.0), "lam must be a finite number of at least 0; found -1"),
        (0, positive, "lam must be a finite number above 0; found 0"),
        (0.5, real(minimum=0.0, above=0.5), "lam must be a finite number above 0.5; found 0.5"),
        (np.nan, real(), "lam must be a finite number; found nan"),
        (-np.inf, real(), "lam must be a finite number; found -inf"),
        (1.5, share, "lam must be at most 1; found 1.5"),
    ):
        with pytest.raises(ArgumentError, match=message):
            check(value, "lam")
    for value in (None, "2", b"2", 1j, [1.0, 2.0], np.array([2.0]), np.array(60, "M8[s]")):
        with pytest.raises(ArgumentTypeError, match="lam must be a real number; found"):
            real()(value, "lam")


def test_whole_numbers():
    for value in (3, np.int32(3), np.uint8(3)):
        assert whole(minimum=3, maximum=3)(value, "n") == 3
    assert whole()(-5, "n") == -5
    with pytest.raises(ArgumentError, match="n must be a whole number of at least 3; found 2"):
        whole(minimum=3)(2, "n")
    with pytest.raises(ArgumentError, match="n must be a whole number of at most 3; found 4"):
        whole(maximum=3)(4, "n")
    for value in (3.0, "3", None, [3], True):
        with pytest.raises(ArgumentTypeError, match="n must be a whole number; found"):
            whole()(value, "n")


def test_choices():
    assert choice("a", "b")("b", "mode") == "b"
    for value in ("c", np.zeros((2, 2)), ["a"]):
        with pytest.raises(ArgumentError, match="mode must be one of 'a', 'b'; found"):
            choice("a", "b")(value, "mode")


def test_answers():
    for value, answer in ((True, True), (np.bool_(False), False), (1, True), (np.int64(0), False)):
        assert checks.flag(value, "scale") is answer
    for value in (None, "yes", 2, -1, 0.5, np.array([True, False])):
        with pytest.raises(ArgumentTypeError, match="scale must be True or False; found"):
            checks.flag(value, "scale")


def test_instances():
    assert instance((int, str))("a", "start") == "a"
    for check, value, message in (
        (instance(list), (1, 2), "start must be a list; found tuple"),
        (instance(list), list, "start must be a list; found the class list"),
        (instance((int, str)), 0.5, "start must be a int or a str; found float"),
        (instance(list, "some numbers"), 3, "start must be some numbers; found int"),
    ):
        with pytest.raises(ArgumentTypeError, match=message):
            check(value, "start")


def test_methods():
    interval = Interval(1.0)
    check = checks.having("an interval", "scaled", "check_point")
    assert check(interval, "range") is interval
    for value in (Interval, 3.0):
        with pytest.raises(ArgumentTypeError, match="range must be an interval; found"):
            check(value, "range")
    assert checks.a_function(len, "step") is len
    for check, value in ((checks.a_function, 3), (checks.a_solver, len), (checks.a_basis, "b")):
        with pytest.raises(ArgumentTypeError, match="step must be"):
            check(value, "step")


def test_items():
    assert checks.items_of(iter([1, 2]), "parts", "a list") == (1, 2)
    for value in (None, 3, "ab", b"ab", {"a": 1}, np.array(1.0)):
        with pytest.raises(ArgumentTypeError, match="parts must be a list; found"):
            checks.items_of(value, "parts", "a list")


def test_generators():
    rng = np.random.default_rng(1)
    assert checks.generator(rng) is rng
    assert checks.generator(5).random() == np.random.default_rng(5).random()
    assert checks.generator(None).random() != checks.generator(None).random()
    with pytest.raises(ArgumentError, match="rng must be a whole number of at least 0; found -1"):
        checks.generator(-1)
    with pytest.raises(ArgumentTypeError, match="rng must be a whole number; found 0.5"):
        checks.generator(0.5)
