"""Compiled loops stay inside their arrays: Python, which checks every index, runs them as well.

Compiled code reads and writes beyond the ends of arrays without a word.
"""

import numpy as np
import pytest
from cases import deformations, open_template, surfaces

from riemhuman.kernels import moving_frames, surface, triangles, turns
from riemhuman.kernels.moving_frames import by_vertex
from riemhuman.terms import (
    EbinTerm,
    NormalTerm,
    RootNormalTerm,
    ebin,
    first_order,
    flat,
    normal_projection,
    normals,
    root_normals,
    second_order,
    zeroth_order,
)
from riemhuman.terms.sum import SumOfTerms

TEMPLATE = open_template()
FACES, FRAMES, AREAS = TEMPLATE.faces, TEMPLATE.frame_coefficients, TEMPLATE.face_areas
TERMS = [EbinTerm(1.0, 0.3), NormalTerm(0.2), RootNormalTerm(0.7)]
FIRST_ORDER = first_order.FirstOrderTerm(
    TEMPLATE, first_order.FirstOrderWeights(1.0, 0.7, 0.4, 0.2, 0.3)
)
QUADRATIC = [FIRST_ORDER, normal_projection.NormalPartTerm(TEMPLATE, FIRST_ORDER)]
QUADRATIC += [zeroth_order.ZerothOrderTerm(TEMPLATE, 0.4)]
QUADRATIC += [second_order.SecondOrderTerm(TEMPLATE, 0.1)]
MODULES = (triangles, ebin, flat, normals, root_normals)


@pytest.fixture
def by_python(monkeypatch):
    """Return a function that has Python run the loops of modules from then on."""

    def interpret(modules):
        # Functions of numbers alone, which come from elsewhere, have no ends to cross.
        own = {module.__name__ for module in modules}
        for module in modules:
            for name, function in list(vars(module).items()):
                if hasattr(function, "py_func") and function.py_func.__module__ in own:
                    monkeypatch.setattr(module, name, function.py_func)

    return interpret


def check(modules, by_python, calls):
    expected = [call() for call in calls]
    by_python(modules)
    for call, arrays in zip(calls, expected, strict=True):
        for found, array in zip(call(), arrays, strict=True):
            scale = np.abs(array).max()
            np.testing.assert_allclose(found, array, rtol=1e-6, atol=1e-11 * scale)


def collapsed(points):
    """Return surfaces, a triangle of one of them without area."""
    points = points.copy()
    points[1, FACES[5]] = points[1, FACES[5, 0]]
    return points


def test_path_energy(by_python):
    path = surfaces(TEMPLATE, 3, rng=1)
    path[2] = path[1] + 1e-3 * path[0]
    calls = [
        lambda: SumOfTerms(TERMS, TEMPLATE).path_energy(path),
        lambda: SumOfTerms(TERMS[::2], TEMPLATE).path_energy(collapsed(path)),
    ]
    check(MODULES, by_python, calls)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_features(by_python, precision):
    points = surfaces(TEMPLATE, 2, rng=2)
    calls = [
        lambda: SumOfTerms(TERMS, TEMPLATE).features(points, precision),
        lambda: SumOfTerms(TERMS[::2], TEMPLATE).features(collapsed(points), precision),
    ]
    check(MODULES, by_python, calls)


@pytest.mark.parametrize("quadratic", QUADRATIC, ids=lambda term: type(term).__name__)
def test_squared_norms(by_python, quadratic):
    h, f = (by_vertex(make(TEMPLATE, 2, rng=6)) for make in (deformations, surfaces))
    modules = (first_order, moving_frames, normal_projection, second_order, zeroth_order)
    calls = [
        lambda: quadratic.squared_norms_and_slopes(h, f),
        lambda: [quadratic.squared_norms(h, f)],
    ]
    check(modules, by_python, calls)


def test_loops_over_single_surfaces(by_python):
    start, end = surfaces(TEMPLATE, 2, rng=4, size=0.8)
    times = np.array([0.0, 0.3, 1.0])
    vectors = turns.triangle_turns(start, end, FACES)

    def blocks():
        added = np.zeros((len(FACES), 9, 9))
        first = surface.derivatives(start, TEMPLATE.differential_operator)
        forms = sum(term.form(first) for term in TERMS) * np.ones((len(FACES), 1, 1))
        triangles.add_blocks(added, start, FACES, forms)
        return [added]

    calls = [
        lambda: turns.triangle_turns(start, end, FACES),
        lambda: turns.turned_sources(start, end, vectors, times, FACES, FRAMES, AREAS),
        blocks,
    ]
    check((moving_frames, triangles, turns), by_python, calls)


def test_trees_of_turns(by_python):
    rng = np.random.default_rng(5)
    quaternions = rng.standard_normal((6, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    vectors = rng.standard_normal((6, 3))
    # A ring of five, and one alone.
    ends = np.array([0, 2, 4, 6, 8, 10, 10])
    neighbours = np.array([1, 4, 0, 2, 1, 3, 2, 4, 3, 0])

    def unwrapped():
        found = 3.0 * vectors
        turns.unwrap_turns(found, quaternions, np.arange(6), ends, neighbours)
        return [found]

    check((turns,), by_python, [unwrapped])
