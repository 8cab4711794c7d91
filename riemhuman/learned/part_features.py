"""Scales of the features of parts, and parts in files."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.learned.parts import Parts
from riemhuman.learned.weight_files import Weights
from riemhuman.surfaces.template import Template

# Least scales of rotations, in radians, and of stretches.
_LEAST_TURN, _LEAST_STRETCH = 0.05, 0.03


def scales_of(features: ndarray) -> tuple[ndarray, ndarray]:
    """Return the means and the standard deviations of features, the latter bounded from below.

    Parameters
    ----------
    features : array, shape (n, 9 K)
        Rotations and stretches of K parts, see `Parts.split`.

    Returns
    -------
    center, scale : array, shape (9 K,)
    """
    n_parts = features.shape[1] // 9
    least = np.repeat([_LEAST_TURN, _LEAST_STRETCH], [3 * n_parts, 6 * n_parts])
    return features.mean(axis=0), np.maximum(features.std(axis=0), least)


def part_arrays(parts: Parts) -> dict[str, ndarray]:
    """Return parts as arrays for a file.

    Parameters
    ----------
    parts : Parts
        The parts.

    Returns
    -------
    dict of str to array
    """
    return {
        "part_of": parts.part_of.astype(np.uint16),
        "part_weights": parts.weights.astype(np.float16),
        "part_parents": parts.parents.astype(np.int16),
    }


def read_parts(weights: Weights, template: Template, n_parts: int) -> Parts:
    """Return the parts stored in a file.

    Parameters
    ----------
    weights : Weights
        The file.
    template : Template
        The network's template.
    n_parts : int
        Number of parts.

    Returns
    -------
    Parts

    Raises
    ------
    FileFormatError
        If the arrays do not describe parts of the template.
    """
    part_of = weights.indices("part_of", (template.n_faces,), 0, n_parts)
    if len(np.unique(part_of)) < n_parts:
        raise weights.refused("part_of must name every part")
    parents = weights.indices("part_parents", (n_parts,), -1, n_parts)
    blend = weights.numbers("part_weights", (template.n_faces, n_parts))
    parts = Parts(template, part_of, blend, parents)
    if np.count_nonzero(parents < 0) != 1 or sum(len(level) for level, _ in parts.levels) < n_parts:
        raise weights.refused("part_parents must be a tree: one root, and no circle")
    return parts
