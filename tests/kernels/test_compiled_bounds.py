"""Compiled loops stay inside their arrays: Python, which checks every index, runs them as well.

Compiled code reads and writes beyond the ends of arrays without a word.
"""

import numpy as np
import pytest
from cases import open_template, surfaces

from riemhuman.kernels import compiled, compiled_features, compiled_surfaces
from riemhuman.kernels.strain import elastic_blocks

TEMPLATE = open_template()
FACES, FRAMES, AREAS = TEMPLATE.faces, TEMPLATE.frame_coefficients, TEMPLATE.face_areas
ALL = {"a": 1.0, "lam": 0.3, "c": 0.2, "b": 0.7}


@pytest.fixture
def by_python(monkeypatch):
    """Return a function that has Python run the loops of a module from then on."""

    def interpret(module):
        for name, function in list(vars(module).items()):
            if hasattr(function, "py_func"):
                monkeypatch.setattr(module, name, function.py_func)

    return interpret


def check(module, by_python, calls):
    expected = [call() for call in calls]
    by_python(module)
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
        lambda: compiled.path_energy(path, FACES, FRAMES, AREAS, **ALL),
        lambda: compiled.path_energy(collapsed(path), FACES, FRAMES, AREAS, **ALL | {"c": 0.0}),
    ]
    check(compiled, by_python, calls)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_features(by_python, precision):
    points = collapsed(surfaces(TEMPLATE, 2, rng=2))
    on_surface = (points, FACES, FRAMES, AREAS)
    x, y, s = np.random.default_rng(3).uniform(0.5, 2.0, (3, 2, len(FACES)))
    normals = np.stack([x, y, s], axis=-1)
    vectors = normals.reshape(2, -1)
    calls = [
        lambda: compiled_features.surface_metric_field_features(*on_surface, 0.3, precision),
        lambda: compiled_features.surface_normal_features(*on_surface, precision),
        lambda: compiled_features.surface_root_normal_features(*on_surface, precision),
        lambda: compiled_features.metric_field_features(x, y, s, AREAS, 0.3, precision),
        lambda: compiled_features.normal_features(normals, AREAS, precision),
        lambda: compiled_features.vector_features(vectors, np.repeat(AREAS, 3), precision),
    ]
    check(compiled_features, by_python, calls)


def test_loops_over_single_surfaces(by_python):
    start, end = surfaces(TEMPLATE, 2, rng=4, size=0.8)
    times = np.array([0.0, 0.3, 1.0])
    turns = compiled_surfaces.triangle_turns(start, end, FACES, FRAMES)

    def blocks():
        added = np.zeros((len(FACES), 9, 9))
        compiled_surfaces.add_elastic_blocks(added, start, FACES, AREAS, **ALL)
        return [added]

    calls = [
        lambda: compiled_surfaces.triangle_turns(start, end, FACES, FRAMES),
        lambda: compiled_surfaces.turned_sources(start, end, turns, times, FACES, FRAMES, AREAS),
        blocks,
    ]
    check(compiled_surfaces, by_python, calls)
    np.testing.assert_allclose(blocks()[0], elastic_blocks(start, FACES, AREAS, **ALL), atol=1e-12)


def test_trees_of_turns(by_python):
    rng = np.random.default_rng(5)
    quaternions = rng.standard_normal((6, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    turns = rng.standard_normal((6, 3))
    # A ring of five, and one alone.
    ends = np.array([0, 2, 4, 6, 8, 10, 10])
    neighbours = np.array([1, 4, 0, 2, 1, 3, 2, 4, 3, 0])

    def unwrapped():
        found = 3.0 * turns
        compiled_surfaces.unwrap_turns(found, quaternions, np.arange(6), ends, neighbours)
        return [found]

    check(compiled_surfaces, by_python, [unwrapped])
