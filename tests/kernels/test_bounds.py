"""Compiled loops of kernels stay inside their arrays."""

import numpy as np
import pytest
from block_patterns import couplings
from cases import open_template, surfaces
from interpreted import check_bounds
from scipy.sparse import bsr_array

from riemhuman.kernels import elimination, rotations, triangles
from riemhuman.kernels.elimination import elimination_of
from riemhuman.surfaces import _poisson

TEMPLATE = open_template()
FACES, FRAMES, AREAS = TEMPLATE.faces, TEMPLATE.frame_coefficients, TEMPLATE.face_areas
FORMS = np.random.default_rng(0).standard_normal((len(FACES), 6, 6))
FORMS += np.swapaxes(FORMS, 1, 2)


def test_loops_over_single_surfaces(monkeypatch):
    start, end = surfaces(TEMPLATE, 2, rng=4, size=0.8)
    times = np.array([0.0, 0.3, 1.0])
    vectors = TEMPLATE.interpolator.rotations(start, end)

    def blocks():
        added = np.zeros((len(FACES), 9, 9))
        triangles.add_blocks(added, start, FACES, FORMS)
        return [added]

    calls = [
        lambda: _poisson.turned_sources(start, end, vectors, times, FACES, FRAMES, AREAS),
        blocks,
    ]
    check_bounds(monkeypatch, [triangles, _poisson], calls)


def test_trees_of_turns(monkeypatch):
    rng = np.random.default_rng(5)
    quaternions = rng.standard_normal((6, 4))
    quaternions /= np.linalg.norm(quaternions, axis=1, keepdims=True)
    vectors = rng.standard_normal((6, 3))
    # A ring of five, and one alone.
    ends = np.array([0, 2, 4, 6, 8, 10, 10])
    neighbours = np.array([1, 4, 0, 2, 1, 3, 2, 4, 3, 0])

    def unwrapped():
        found = 3.0 * vectors
        _poisson.unwrap_turns(found, quaternions, np.arange(6), ends, neighbours)
        return [found]

    check_bounds(monkeypatch, [_poisson], [unwrapped])


def test_nearest_rotations(monkeypatch):
    matrices = np.eye(3) + 0.1 * np.random.default_rng(6).standard_normal((4, 3, 3))
    calls = [lambda: [rotations.nearest_rotations(matrices)]]
    check_bounds(monkeypatch, [rotations], calls)


@pytest.mark.parametrize("lanes", [(0,), None])
def test_elimination(monkeypatch, lanes):
    coupled = couplings("chain")
    n, n_sides = len(coupled), 1 if lanes else 4
    dense = np.kron(coupled + 3.0 * np.eye(n), np.ones((3, 3))) + 9.0 * np.eye(3 * n)
    blocks = bsr_array(dense, blocksize=(3, 3))
    found = elimination_of(blocks)
    sides = np.random.default_rng(9).standard_normal((n, 3 * n_sides))

    def solved():
        lower, pivots, x = np.zeros((len(found.rows), 9)), np.empty((n, 3)), sides.copy()
        lower[found.targets] = blocks.data.reshape(-1, 9)[found.sources]
        where = (found.ends, found.rows)
        elimination.eliminate(*where, found.columns, found.row_ends, found.by_row, lower, pivots)
        elimination.solve_lower(*where, lower, x, lanes)
        elimination.solve_upper(*where, lower, x, lanes)
        return [lower, pivots, x]

    check_bounds(monkeypatch, [elimination], [solved])
