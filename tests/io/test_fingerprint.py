"""Descriptions of metrics: the same for the same metric, another for any other."""

import functools
import itertools
import json
import os
import re
import subprocess
import sys
import threading
import types
from pathlib import Path

import numpy as np
import pytest
from cases import CASES, HalfPlane, bent_half_plane, name_of

from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry import PullbackMetric
from riemhuman.io.fingerprint import describe, digest
from riemhuman.solvers import PathStraightening

DESCRIPTIONS = {name: json.dumps(describe(case.metric)) for name, case in CASES.items()}


def test_every_metric_has_a_description_of_its_own():
    assert len(set(DESCRIPTIONS.values())) == len(DESCRIPTIONS)


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_descriptions_outlive_json(case):
    description = describe(case.metric)
    assert json.loads(json.dumps(description)) == description


def test_same_metric_made_twice():
    assert describe(bent_half_plane(HalfPlane())) == describe(bent_half_plane(HalfPlane()))


def test_maps_are_told_apart_by_what_they_do():
    def scaled(factor):
        return lambda x: factor * x

    maps = [scaled(1.0), scaled(2.0), lambda x: 3.0 * x, lambda x: 4.0 * x, np.negative]
    target = CASES["half-plane, distance"].metric
    found = [describe(PullbackMetric(HalfPlane(), target, map)) for map in maps]
    assert all(a != b for i, a in enumerate(found) for b in found[:i])
    again = PullbackMetric(HalfPlane(), target, scaled(2.0))
    assert describe(again) == found[1]


def test_a_solver_is_no_part_of_a_metric():
    metric = CASES["pose sphere"].metric
    with_solver = type(metric)(metric.space, 0.0, 0.0, 1.0, geodesic_solver=object())
    assert describe(with_solver) == describe(metric)


def test_a_solver_that_distances_come_from_is_part_of_a_metric():
    kind = type(CASES["half-plane, inner product"].metric)
    solvers = [None, PathStraightening(n_nodes=5), PathStraightening(n_nodes=6)]
    found = [describe(kind(HalfPlane(), geodesic_solver=solver)) for solver in solvers]
    assert found[0] != found[1] != found[2]
    assert describe(kind(HalfPlane(), geodesic_solver=PathStraightening(n_nodes=5))) == found[1]


class Forgetful:
    """An object that does not keep its parameter."""

    def __init__(self, scale):
        self.size = scale


def test_parameters_must_be_kept():
    with pytest.raises(ArgumentTypeError, match="Forgetful must keep its parameter scale"):
        describe(Forgetful(2.0))


def test_digest_is_of_values_not_of_their_order_in_memory():
    array = np.arange(6.0).reshape(2, 3)
    assert digest(array) == digest(np.asfortranarray(array))
    assert digest(array) != digest(array + 1e-15)
    assert len(digest(array)) == 32


# The code of a user's metric, in a file of its own.

HELPER = """
OFFSET = 0.5

def shifted(x):
    return x + OFFSET
"""

METRIC = """
import autograd.numpy as np
import scipy.special
from autograd.extend import primitive
from numba import njit
from riemhuman.geometry import RiemannianMetric
import users_helper

SCALE = 2.0
KINDS = {"sine", "cosine", "tangent", "secant"}
TABLE = {"power": 2, "shift": np.array([1.0, 2.0])}

class Settings:
    factor = 3.0

class Base(RiemannianMetric):
    weight = 1.0

    def measure(self, x):
        return self.weight * x

@njit
def compiled(x):
    return x + 0.25

@primitive
def known(x):
    return 1.5 * x

def outer(x):
    def inner(y):
        return y + 10.0
    return inner(x)

def with_default(x, by=4.0, *, times=5.0):
    return by * times * x

def local(x):
    from users_helper import shifted
    return shifted(x)

def made(factor):
    return lambda x: factor * x

scaled = made(6.0)

class Metric(Base):
    def __init__(self, space, exponent=1.0):
        self.exponent = exponent
        super().__init__(space)

    def squared_dist(self, point_a, point_b):
        gap = np.sin(point_a - point_b) * SCALE + Settings.factor * TABLE["power"]
        gap = gap * ("sine" in KINDS) * (gap.dtype.kind in {"f", "g", "h"})
        gap = outer(gap) + with_default(gap) + local(gap) + scaled(gap) + known(gap)
        gap = gap + users_helper.shifted(gap) + scipy.special.expit(gap) + compiled(gap)
        return np.sum(self.measure(gap) ** 2, axis=-1)
"""


def users_description(folder, metric=METRIC, helper=HELPER, options=""):
    """Return how a fresh process describes a metric from files, before and after its use."""
    for name, source in (("users_helper", helper), ("users_metric", metric)):
        file = folder / f"{name}.py"
        file.write_text(source)
        # Not imported: Python would take compiled code of the same size and second for the same.
        sys.modules[name] = module = types.ModuleType(name)
        module.__file__ = str(file)
        exec(compile(source, file, "exec"), vars(module))
    metric = eval(f"sys.modules['users_metric'].Metric(HalfPlane(), {options})")
    return json.dumps(describe(metric))


EDITS = {
    "another function of a library": ("np.sin(", "np.cos("),
    "another function of another library": ("special.expit", "special.erf"),
    "another global": ("SCALE = 2.0", "SCALE = 2.5"),
    "another entry of a global": ('"power": 2', '"power": 3'),
    "another array": ("[1.0, 2.0]", "[1.0, 2.5]"),
    "another attribute of a class": ("factor = 3.0", "factor = 3.5"),
    "another attribute of a base class": ("weight = 1.0", "weight = 1.5"),
    "another method of a base class": ("self.weight * x", "self.weight + x"),
    "another constant of a nested function": ("y + 10.0", "y + 11.0"),
    "another default": ("by=4.0", "by=4.5"),
    "another keyword default": ("times=5.0", "times=5.5"),
    "another closure": ("made(6.0)", "made(6.5)"),
    "other code behind a decorator": ("1.5 * x", "1.6 * x"),
    "other compiled code": ("x + 0.25", "x + 0.35"),
    "other options of compiled code": ("@njit", "@njit(fastmath=True)"),
    "another squared_dist": ("** 2, axis", "** 4, axis"),
    "another default of a parameter": ("exponent=1.0", "exponent=1.5"),
    "another base class": ("class Metric(Base)", "class Metric(RiemannianMetric)"),
    "another order": ("np.sum(self.measure(gap) ** 2", "self.measure(np.sum(gap) ** 2"),
}


@pytest.mark.parametrize("edit", EDITS, ids=str)
def test_edits_of_a_users_code_show(edit, tmp_path):
    old, new = EDITS[edit]
    assert METRIC.count(old) == 1
    edited = users_description(tmp_path, METRIC.replace(old, new))
    assert edited != users_description(tmp_path)


@pytest.mark.parametrize("edit", [("0.5", "0.6"), ("x + OFFSET", "x - OFFSET")], ids=str)
def test_edits_of_a_module_that_is_imported_show(edit, tmp_path):
    edited = users_description(tmp_path, helper=HELPER.replace(*edit))
    assert edited != users_description(tmp_path)


def test_what_has_no_effect_is_left_out(tmp_path):
    commented = METRIC.replace("SCALE = 2.0", "\n# a comment\nSCALE = 2.0\nUNUSED = 7.0")
    assert users_description(tmp_path, commented) == users_description(tmp_path)


def test_a_parameter_and_an_attribute_that_is_set_later_show(tmp_path):
    before = users_description(tmp_path)
    assert users_description(tmp_path, options="exponent=1.5") != before
    metric = sys.modules["users_metric"].Metric(HalfPlane())
    other = sys.modules["users_metric"].Metric(HalfPlane())
    assert describe(metric) == describe(other)
    other.weight = 7.0
    assert describe(metric) != describe(other)


FRESH = """
import json, sys
sys.path[:0] = sys.argv[1:]
import numpy as np
from cases import CASES, HalfPlane
from riemhuman.io.fingerprint import describe
from users_metric import Metric

names = json.loads(sys.stdin.read())
metrics = [Metric(HalfPlane()), *(CASES[name].metric for name in names)]
print(json.dumps([json.dumps(describe(metric)) for metric in metrics]))
"""


def test_fresh_processes_give_the_same_description_as_used_metrics(tmp_path):
    expected = [users_description(tmp_path), *DESCRIPTIONS.values()]
    metric = sys.modules["users_metric"].Metric(HalfPlane())
    points = HalfPlane().random_point(4)
    metric.dist_pairwise(points)
    assert json.dumps(describe(metric)) == expected[0]
    for case in CASES.values():
        if "dist" in case.can:
            case.metric.dist_pairwise(case.points)
        case.metric.energy(case.points[:2])
        assert json.dumps(describe(case.metric)) == DESCRIPTIONS[case.name]
    root = Path(__file__).parents[2]
    for seed in ("1", "2"):
        done = subprocess.run(
            [sys.executable, "-c", FRESH, str(tmp_path), str(root / "tests"), str(root)],
            env=os.environ | {"PYTHONHASHSEED": seed},
            input=json.dumps(list(DESCRIPTIONS)),
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert json.loads(done.stdout) == expected


# Values of many kinds.


class Marked:
    """An object with a public attribute that may be anything."""

    def __init__(self, mark):
        self.mark = mark


def test_values_are_told_apart():
    values = [
        *(None, True, 1, 1.0, "1", b"1", 1j, float("nan"), float("inf"), np.float32(1), (1, 2)),
        *({"a": 1}, {"a": 2}, {1, 2}, {1, 3}, slice(1), range(3), Path("a"), Path("b"), ...),
        *(re.compile("a"), re.compile("a", re.IGNORECASE), np.dtype("f4"), np.add, np.sin),
        *(len, "x".join, "y".join, functools.partial(max, 1), functools.partial(max, 2)),
        *(np.array([1, "a"], dtype=object), np.array([2, "a"], dtype=object), np.zeros(2)),
        *(np.float64, np.float32, np.zeros((2, 1)), np.zeros(2, np.float32), sys, os),
    ]
    found = [json.dumps(describe(Marked(value))) for value in values]
    for (i, one), (j, other) in itertools.combinations(enumerate(found), 2):
        assert one != other, (values[i], values[j])
    again = [json.dumps(describe(Marked(value))) for value in values]
    assert found == again


def test_what_refers_to_itself_is_described():
    value = Marked([])
    value.mark.append(value)
    assert json.dumps(describe(value)) == json.dumps(describe(value))


def reads_hidden_code(x):
    return eval("x")


@pytest.mark.parametrize(
    "make",
    [
        threading.Lock,
        lambda: (number for number in range(3)),
        lambda: sys.stdout,
        lambda: memoryview(b"bytes"),
        lambda: sys.modules[__name__],
        lambda: reads_hidden_code,
    ],
    ids=["lock", "generator", "stream", "memory", "module", "eval"],
)
def test_what_cannot_be_told_from_others_is_refused(make):
    with pytest.raises(ArgumentTypeError, match="give the job a key"):
        describe(Marked(make()))
