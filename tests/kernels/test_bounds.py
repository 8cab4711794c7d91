"""Compiled loops of kernels stay inside their arrays."""

import numpy as np
import pytest
from block_patterns import couplings
from interpreted import check_bounds
from scipy.sparse import bsr_array

from riemhuman.kernels import elimination, rotations
from riemhuman.kernels.elimination import elimination_of


def test_nearest_rotations(monkeypatch):
    matrices = np.eye(3) + 0.1 * np.random.default_rng(6).standard_normal((4, 3, 3))
    calls = [lambda: [rotations.nearest_rotations(matrices)]]
    check_bounds(monkeypatch, [rotations], calls)


@pytest.mark.parametrize("n_sides", [elimination.WIDTH, 4])
def test_elimination(monkeypatch, n_sides):
    coupled = couplings("chain")
    n, lanes = len(coupled), None if n_sides == 4 else (0,) * n_sides
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
