"""Hankel matrices of currents, against sums over all pairs of triangles."""

import numpy as np
import pytest

import riemhuman as rh


def test_products_of_frames_are_those_of_the_kernel(space, motions):
    """Random features are right to the root of their number."""
    hankel = rh.motions.GramHankel(space, width=0.5, n_rows=2, n_features=2000)
    frames = motions[0][[0, 5]]
    faces = space.template.faces
    centres = frames[:, faces].mean(axis=2) - frames.mean(axis=1)[:, None]
    areas = space.normals(frames)
    gaps = np.sum((centres[0][:, None] - centres[1]) ** 2, axis=-1)
    expected = np.sum(areas[0] @ areas[1].T * np.exp(-gaps / 0.5**2))
    rows = hankel._currents(frames)
    assert rows[0] @ rows[1] == pytest.approx(expected, rel=0.1)


def test_matrix_is_the_product_of_a_hankel_matrix(space, motions):
    hankel = rh.motions.GramHankel(space, n_rows=3, n_features=8)
    rows = hankel._currents(motions[0])
    blocks = np.stack([np.concatenate(rows[i : i + 8]) for i in range(3)])
    product = blocks @ blocks.T
    np.testing.assert_allclose(
        hankel.describe(motions[0]), product / np.linalg.norm(product), rtol=1e-9
    )


def test_distances(space, motions):
    hankel = rh.motions.GramHankel(space, n_rows=3, n_features=8)
    distances = hankel.dist_pairwise(motions[:3])
    assert distances[0, 2] == distances[2, 0] == pytest.approx(hankel.dist(motions[0], motions[2]))
    moved = motions[0] + [1.0, 0.0, 2.0]
    assert hankel.dist(motions[0], moved) == pytest.approx(0.0, abs=1e-9)


def test_too_few_frames(space, motions):
    with pytest.raises(rh.RiemhumanError, match="at least n_rows=8 frames; found 5"):
        rh.motions.GramHankel(space).describe(motions[0][:5])
