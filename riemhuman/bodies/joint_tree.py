"""The tree of a body model's joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from riemhuman.checks import integer_array
from riemhuman.errors import ArgumentError

# The root's parent, -1, as an unsigned number.
_UNSIGNED_ROOT = 2**32 - 1


def joint_parents(kintree_table: Any, n_joints: int) -> np.ndarray:
    """Return the index of each joint's parent, -1 for the root.

    Parameters
    ----------
    kintree_table : array_like of int, shape (2, J)
        Row 1 holds the number of each joint, row 0 that of its parent; the root's parent is -1 or
        2**32 - 1.
    n_joints : int
        Number of joints J.

    Returns
    -------
    parents : array of int, shape (J,)

    Raises
    ------
    ArgumentTypeError
        If the table does not hold whole numbers.
    ArgumentError
        If its shape is wrong, a number is missing or repeated, or there is not exactly one root.
    """
    table = integer_array(kintree_table, "kintree_table", (2, n_joints))
    index = {int(number): j for j, number in enumerate(table[1])}
    if len(index) != n_joints:
        raise ArgumentError("kintree_table numbers a joint twice in its second row")
    parents = np.empty(n_joints, dtype=np.int64)
    for joint, number in enumerate(table[0].tolist()):
        if number in (-1, _UNSIGNED_ROOT):
            parents[joint] = -1
        elif number in index:
            parents[joint] = index[number]
        else:
            raise ArgumentError(
                f"kintree_table names {number} as the parent of joint {joint}; no joint has "
                "that number"
            )
    roots = np.flatnonzero(parents < 0).tolist()
    if len(roots) != 1:
        raise ArgumentError(f"kintree_table must have one root; found roots {roots}")
    return parents


def root_first(parents: np.ndarray) -> tuple[int, ...]:
    """Return the joints ordered so that parents precede children.

    Parameters
    ----------
    parents : array of int, shape (J,)
        Index of each joint's parent, -1 for the root.

    Raises
    ------
    ArgumentError
        If the joints have a cycle.
    """
    order = np.flatnonzero(parents < 0).tolist()
    for joint in order:
        order.extend(np.flatnonzero(parents == joint).tolist())
    if len(order) != len(parents):
        cycle = sorted(set(range(len(parents))) - set(order))
        raise ArgumentError(f"kintree_table has a cycle: joints {cycle} never reach the root")
    return tuple(order)


def joints_between(parents: np.ndarray, first: int, last: int) -> list[int]:
    """Return the joints on the path from one joint to another, both included.

    Parameters
    ----------
    parents : array of int, shape (J,)
        Index of each joint's parent, -1 for the root.
    first, last : int
        The ends of the path.
    """
    ways = []
    for joint in (first, last):
        way = [joint]
        while parents[way[-1]] >= 0:
            way.append(int(parents[way[-1]]))
        ways.append(way)
    up, down = ways
    shared = next(joint for joint in up if joint in down)
    return up[: up.index(shared) + 1] + down[: down.index(shared)][::-1]
