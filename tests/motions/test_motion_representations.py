"""Hankel matrices of currents, and random re-timings of the open motions."""

import numpy as np
import pytest

from riemhuman.motions.motion_representations import GramHankel, random_places, retime_at_random


def test_currents_are_area_vectors_times_fourier_features(space, motions):
    hankel = GramHankel(space, width=0.01, n_features=5)  # such narrow kernels turn many times
    frames = motions[0][:3]
    waves = np.random.default_rng(0).normal(0.0, np.sqrt(2.0) / 0.01, (3, 5))
    centres = frames[:, space.template.faces].mean(axis=2) - frames.mean(axis=1)[:, None]
    phases = centres @ waves
    parts = [
        np.einsum("nfx,nfk->nxk", space.normals(frames), feature(phases))
        for feature in (np.cos, np.sin)
    ]
    expected = np.stack(parts, axis=1).reshape(3, -1) / np.sqrt(5.0)
    np.testing.assert_allclose(hankel.currents(frames), expected, rtol=0.0, atol=1e-11)


def test_matrix_is_the_product_of_a_hankel_matrix(space, motions):
    hankel = GramHankel(space, n_rows=3, n_features=8)
    rows = hankel.currents(motions[0])
    blocks = np.stack([np.concatenate(rows[i : i + 8]) for i in range(3)])
    product = blocks @ blocks.T
    np.testing.assert_allclose(
        hankel.describe(motions[0], "m"), product / np.linalg.norm(product), rtol=1e-9
    )
    distances = hankel.dist_pairwise(motions[:3])
    assert distances[0, 2] == distances[2, 0] > 0.0
    moved = hankel.dist_pairwise([motions[0], motions[0] + [1.0, 0.0, 2.0]])
    assert moved[0, 1] == pytest.approx(0.0, abs=1e-9)


def test_random_re_timings(open_motions):
    places = random_places(100, 40, 3)
    assert len(places) == 40
    np.testing.assert_allclose(places[[0, -1]], [0.0, 99.0])
    steps = np.diff(places)
    assert steps.min() > 0
    assert 1.3 < steps.max() / steps.min() < 4.0 + 1e-9
    frames = retime_at_random(open_motions[0], np.random.default_rng(1))
    assert 24 <= len(frames) <= 60
    np.testing.assert_allclose(frames[[0, -1]], open_motions[0][:: len(open_motions[0]) - 1])
