"""Rotations of triangles between two surfaces, against polar decompositions."""

import numpy as np
import pytest
from cases import open_template, sphere_template, surfaces
from scipy.linalg import polar
from scipy.sparse import coo_array, csgraph
from scipy.spatial.transform import Rotation

from riemhuman.surfaces import _triangle_rotations as kernel

TEMPLATES = {"sphere": sphere_template(), "open": open_template()}
each_template = pytest.mark.parametrize("template", TEMPLATES.values(), ids=TEMPLATES)


@pytest.fixture(params=[False, True], ids=["alone", "threaded"])
def threaded(request, monkeypatch):
    monkeypatch.setattr(kernel, "_WORTH_THREADS", 0 if request.param else np.inf)


def with_normals(template, points):
    """Return the matrices (f_u, f_v, n), shape (F, 3, 3)."""
    derivatives = (template.differential_operator @ points).reshape(2, -1, 3)
    normals = np.cross(*derivatives)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.stack([*derivatives, normals], axis=2)


@each_template
@pytest.mark.parametrize(("size", "turned"), [(0.6, 1.0), (1e-3, 1e-3)], ids=["far", "near"])
def test_sources_by_polar_decomposition(template, size, turned, threaded):
    start, end = surfaces(template, 2, rng=4, size=size)
    turn = Rotation.from_rotvec(turned * np.array([0.5, 2.2, -0.4])).as_matrix()
    end = end @ turn.T
    times = np.array([0.0, 0.2, 0.5, 1.0])
    faces, frames = template.faces, template.frame_coefficients
    turns = template.interpolator.rotations(start, end)
    found = kernel.turned_sources(start, end, turns, times, faces, frames, template.face_areas)
    first, last = with_normals(template, start), with_normals(template, end)
    wanted = np.zeros((len(times), 2, template.n_faces, 3))
    for t, (one, other) in enumerate(zip(first, last, strict=True)):
        rotation, _ = polar(other @ np.linalg.inv(one))
        vector = Rotation.from_matrix(rotation).as_rotvec()
        np.testing.assert_allclose(turns[t], vector, atol=1e-12)
        for i, share in enumerate(times):
            partway = Rotation.from_rotvec(share * vector).as_matrix()
            blend = (1 - share) * one + share * rotation.T @ other
            wanted[i, :, t] = (partway @ blend)[:, :2].T
    weights = np.tile(template.face_areas, 2)[:, None]
    for i, derivatives in enumerate(wanted):
        expected = template.differential_operator.T @ (weights * derivatives.reshape(-1, 3))
        np.testing.assert_allclose(found[:, i], expected, atol=1e-12)


def unwrapped_along_the_tree(turns, differences, roots):
    """Return rotation vectors, each the closest of its rotation to that of its parent."""
    tree = csgraph.minimum_spanning_tree(differences)
    found, done = turns.copy(), set()
    for root in roots:
        if root in done:
            continue
        order, parents = csgraph.breadth_first_order(tree, root, directed=False)
        for t in order[1:]:
            angle = np.linalg.norm(turns[t])
            if angle > 0:
                lengths = angle + 2 * np.pi * np.arange(-9, 10)
                candidates = lengths[:, None] * turns[t] / angle
                gaps = np.linalg.norm(candidates - found[parents[t]], axis=1)
                found[t] = candidates[np.argmin(gaps)]
        done |= set(order.tolist())
    return found


@pytest.mark.parametrize("seed", range(2))
def test_unwrapping_follows_the_tree_of_least_differences(seed):
    rng = np.random.default_rng(seed)
    n, n_first = 60, 40
    # Two parts without an edge between them, and a triangle alone; one does not turn at all.
    pairs = np.concatenate([rng.integers(0, n_first, (90, 2)), rng.integers(n_first, n, (50, 2))])
    pairs = np.unique(np.sort(pairs[(pairs[:, 0] != pairs[:, 1]) & (pairs < n - 1).all(1)]), axis=0)
    rotations = Rotation.random(n, rng=seed)
    turns = rotations.as_rotvec()
    turns[7] = 0.0
    quaternions = rng.choice([-1.0, 1.0], (n, 1)) * Rotation.from_rotvec(turns).as_quat()
    one, other = quaternions[pairs.T]
    gaps = np.minimum(np.sum((one - other) ** 2, axis=1), np.sum((one + other) ** 2, axis=1))
    # SciPy's trees want 32-bit indices in older releases.
    differences = coo_array((gaps, pairs.T.astype(np.int32)), shape=(n, n)).tocsr()
    both_ways = (differences + differences.T).tocsr()
    roots = rng.permutation(n)
    found = turns.copy()
    ends, neighbours = (both_ways.indptr.astype(np.int64), both_ways.indices.astype(np.int64))
    kernel.unwrap_turns(found, quaternions, roots, ends, neighbours)
    expected = unwrapped_along_the_tree(turns, differences, roots)
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert np.linalg.norm(found, axis=1).max() > np.pi


@pytest.mark.parametrize("seed", range(2))
def test_a_ring_that_turns_once_around_is_cut_at_its_largest_step(seed):
    """However quaternions of either sign meet there: the steps differ by less than a degree."""
    rng = np.random.default_rng(seed)
    n, axis = 100, np.array([0.36, -0.48, 0.8])
    steps = rng.uniform(0.9, 1.1, n)
    steps *= 2 * np.pi / steps.sum()
    angles = 0.03 + np.concatenate([[0.0], np.cumsum(steps[:-1])])
    rotations = Rotation.from_rotvec(angles[:, None] * axis)
    quaternions = rng.choice([-1.0, 1.0], (n, 1)) * rotations.as_quat()
    ends, around = np.arange(0, 2 * n + 1, 2), np.arange(n)[:, None] + [-1, 1]
    found = rotations.as_rotvec()
    kernel.unwrap_turns(found, quaternions, rng.permutation(n), ends, around.ravel() % n)
    jumps = np.linalg.norm(np.roll(found, -1, axis=0) - found, axis=1) > 1.0
    np.testing.assert_array_equal(np.flatnonzero(jumps), [np.argmax(steps)])
