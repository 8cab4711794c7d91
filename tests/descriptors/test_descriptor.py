"""What all descriptors share: surfaces of any kind, and distances of vectors."""

import numpy as np
import pytest
from known_surfaces import folded_sheet
from scipy.spatial.distance import cdist

from riemhuman.descriptors import ShapeDNA
from riemhuman.errors import ArgumentError, DegenerateSurfaceError


def test_describe_all_takes_registered_bodies_and_lists_and_names_what_fails():
    meshes = [folded_sheet(angle) for angle in (0.0, 0.5)]
    dna = ShapeDNA(5)
    rows = dna.describe_all(iter(meshes))
    assert rows.shape == (2, 5)
    np.testing.assert_allclose(rows[0], dna.describe(*meshes[0]))
    flat = np.zeros_like(meshes[0][0])
    with pytest.raises(DegenerateSurfaceError, match=r"^body 1: .* has 480 of 480"):
        dna.describe_all([meshes[0], (flat, meshes[0][1])])
    with pytest.raises(ArgumentError, match="bodies must hold at least one surface"):
        dna.describe_all([])


def test_bad_vectors():
    with pytest.raises(ArgumentError, match=r"vectors must have shape \(n_vectors, n_numbers\)"):
        ShapeDNA().distances(np.ones(3))
    assert ShapeDNA().distances(np.ones((1, 4))).shape == (1, 1)
    rows = np.random.default_rng(0).normal(size=(5, 3))
    np.testing.assert_allclose(ShapeDNA().distances(rows), cdist(rows, rows), atol=1e-12)
