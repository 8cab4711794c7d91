"""Patterns of sparse matrices of blocks."""

import numpy as np

KINDS = [
    "one block",
    "diagonal",
    "dense",
    "chain",
    "arrow at the first",
    "arrow at the last",
    "random",
]


def couplings(kind):
    """Return which blocks of a matrix are not 0."""
    rng = np.random.default_rng(3)
    if kind == "one block":
        return np.eye(1, dtype=bool)
    if kind == "diagonal":
        return np.eye(5, dtype=bool)
    if kind == "dense":
        return np.ones((6, 6), dtype=bool)
    if kind == "chain":
        return np.abs(np.subtract.outer(range(9), range(9))) <= 1
    if kind.startswith("arrow"):
        coupled = np.eye(7, dtype=bool)
        tip = 0 if kind == "arrow at the first" else 6
        coupled[tip] = coupled[:, tip] = True
        return coupled
    coupled = rng.random((40, 40)) < 0.04
    return coupled | coupled.T | np.eye(40, dtype=bool)
