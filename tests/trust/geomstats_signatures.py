"""Names, order of arguments and defaults beside those of geomstats: `python .ci/jobs.py oracles`.

Every difference is listed by hand, with its reason, in `tutorials/differences_from_geomstats.md`;
the tables there are read here, and must be what is found.
"""

import importlib
import inspect
import os
import re
from pathlib import Path

os.environ.setdefault("GEOMSTATS_BACKEND", "autograd")

import pytest

import riemhuman

PAGE = Path(__file__).parents[2] / "tutorials" / "differences_from_geomstats.md"
PAIRS = {
    "geometry.manifold.Manifold": "Manifold",
    "geometry.base.VectorSpace": "VectorSpace",
    "geometry.product_manifold.ProductManifold": "ProductManifold",
    "geometry.discrete_surfaces.DiscreteSurfaces": "AlignedSurfaces",
    "geometry.riemannian_metric.RiemannianMetric": "RiemannianMetric",
    "geometry.euclidean.EuclideanMetric": "FlatMetric",
    "geometry.product_manifold.ProductRiemannianMetric": "ProductMetric",
    "geometry.pullback_metric.PullbackDiffeoMetric": "PullbackMetric",
    "geometry.discrete_surfaces.ElasticMetric": "ElasticMetric",
    "learning.frechet_mean.FrechetMean": "FrechetMean",
    "learning.geometric_median.GeometricMedian": "GeometricMedian",
    "learning.pca.TangentPCA": "TangentPCA",
    "learning.geodesic_regression.GeodesicRegression": "GeodesicRegression",
    "learning.kmedoids.RiemannianKMedoids": "statistics.KMedoids",
    "numerics.geodesic.PathStraightening": "solvers.PathStraightening",
    "numerics.geodesic.ExpSolver": "geometry.strategies.ExpSolver",
    "numerics.geodesic.LogSolver": "geometry.strategies.LogSolver",
    "numerics.path.UniformlySampledPathEnergy": "solvers.FiniteDifferenceEnergy",
}
"""Their classes, and ours for the same idea."""

# What scikit-learn generates, and what geomstats inherits from it.
_GENERATED = re.compile(r"set_\w+_request|get_metadata_routing|set_output|(g|s)et_params")


def their_class(dotted):
    module, name = dotted.rsplit(".", 1)
    return getattr(importlib.import_module(f"geomstats.{module}"), name)


def our_class(dotted):
    found = riemhuman
    for name in dotted.split("."):
        found = getattr(found, name)
    return found


def public_methods(cls):
    """Return the public methods of a class by name, without those of scikit-learn."""
    names = [
        name
        for base in cls.__mro__
        if base.__module__.startswith(("geomstats", "riemhuman"))
        for name in vars(base)
        if not name.startswith("_") and not _GENERATED.fullmatch(name)
    ]
    return {
        name: inspect.getattr_static(cls, name)
        for name in dict.fromkeys(names)
        if callable(getattr(cls, name, None))
    }


def parameters_of(function):
    """Return the parameters of a class or method, without self."""
    function = getattr(function, "__func__", function)
    parameters = list(inspect.signature(function).parameters.values())
    return [parameter for parameter in parameters if parameter.name not in ("self", "cls")]


def call_of(name, parameters):
    """Return how something is called, as text."""
    texts = []
    for parameter in parameters:
        prefix = {parameter.VAR_POSITIONAL: "*", parameter.VAR_KEYWORD: "**"}.get(
            parameter.kind, ""
        )
        default = "" if parameter.default is parameter.empty else f"={parameter.default!r}"
        texts.append(f"{prefix}{parameter.name}{default}")
    return f"{name}({', '.join(texts)})"


def is_met(theirs, ours):
    """Return whether every call that theirs takes is taken by ours, and means the same."""
    wanted = [parameter for parameter in theirs if parameter.kind is not parameter.VAR_KEYWORD]
    if len(ours) < len(wanted):
        return False
    for their, our in zip(wanted, ours, strict=False):
        if their.name != our.name or our.kind is not our.POSITIONAL_OR_KEYWORD:
            return False
        if their.default is not their.empty and their.default != our.default:
            return False
    return all(
        parameter.default is not parameter.empty
        for parameter in ours[len(wanted) :]
        if parameter.kind < 2
    )


def differences_of(their_dotted, our_dotted):
    """Return differing calls as (theirs, ours), and the names that are missing.

    What a base class, earlier in the list, has in the same way is not repeated.
    """
    calls, missing = all_differences_of(their_dotted, our_dotted)
    theirs, ours = their_class(their_dotted), our_class(our_dotted)
    for base, our_base in PAIRS.items():
        if base == their_dotted:
            break
        if issubclass(theirs, their_class(base)) and our_class(our_base) in ours.__mro__:
            known_calls, known_missing = all_differences_of(base, our_base)
            calls = [call for call in calls if call not in known_calls]
            missing = [name for name in missing if name not in known_missing]
    return calls, missing


def all_differences_of(their_dotted, our_dotted):
    """Return differing calls as (theirs, ours), and the names that are missing."""
    theirs, ours = their_class(their_dotted), our_class(our_dotted)
    calls = []
    if not getattr(ours, "_is_protocol", False):
        pair = parameters_of(theirs), parameters_of(ours)
        if not is_met(*pair):
            calls.append((call_of(theirs.__name__, pair[0]), call_of(ours.__name__, pair[1])))
    found, missing = public_methods(ours), []
    for name, method in public_methods(theirs).items():
        if name not in found:
            missing.append(name)
            continue
        pair = parameters_of(method), parameters_of(found[name])
        if not is_met(*pair):
            calls.append((call_of(name, pair[0]), call_of(name, pair[1])))
    return calls, missing


def rows_of(title):
    """Return the rows of the table below a heading of the page, as lists of cells."""
    text = PAGE.read_text(encoding="utf-8")
    section = re.search(rf"^## {re.escape(title)}\n(.*?)(?=^## |\Z)", text, re.M | re.S)[1]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def names_in(cell):
    return re.findall(r"`([^`]+)`", cell)


@pytest.mark.parametrize("pair", PAIRS.items(), ids=PAIRS.values())
def test_other_calls_are_those_of_the_page(pair):
    calls, _ = differences_of(*pair)
    listed = [row for row in rows_of("Other arguments") if names_in(row[0]) == [pair[1]]]
    found = sorted((*names_in(row[1]), *names_in(row[2])) for row in listed)
    assert found == sorted(calls)
    assert all(row[3] for row in listed)


@pytest.mark.parametrize("pair", PAIRS.items(), ids=PAIRS.values())
def test_missing_names_are_those_of_the_page(pair):
    _, missing = differences_of(*pair)
    listed = [row for row in rows_of("Not in riemhuman") if names_in(row[0]) == [pair[1]]]
    assert sorted(name for row in listed for name in names_in(row[1])) == sorted(missing)
    assert all(row[2] for row in listed)


def test_the_page_speaks_of_no_other_classes():
    for title in ("Other arguments", "Not in riemhuman"):
        assert {names_in(row[0])[0] for row in rows_of(title)} <= set(PAIRS.values())
