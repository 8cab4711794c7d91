"""The term of rotations: its loops over pairs, and how it does in sums of terms."""

import numpy as np
import pytest
from packed_fields import field_features

from riemhuman.kernels.threads import of_one_kind
from riemhuman.terms import RotationTerm

AREAS = of_one_kind(np.random.default_rng(0).uniform(0.1, 2.0, 1290))  # two chunks and a piece


def quaternions_at_angles():
    """Return fields whose rotations differ by angles of all sizes, up to sign."""
    rng = np.random.default_rng(1)
    first, across = rng.standard_normal((2, len(AREAS), 4))
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    across -= np.sum(first * across, axis=1, keepdims=True) * first
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    small = np.logspace(-6, -1, 215)
    angles = np.concatenate([small, np.pi - small, rng.uniform(0, np.pi, 860)])[:, None]
    second = np.cos(0.5 * angles) * first + np.sin(0.5 * angles) * across
    second *= rng.choice([-1.0, 1.0], (len(AREAS), 1))
    return np.stack([first, second, -first, np.roll(first, 1, axis=0)]), angles[:, 0]


@pytest.mark.parametrize("precision", ["single", "double"])
def test_compiled_pairs_are_those_of_the_definition(precision):
    term, (fields, angles) = RotationTerm(), quaternions_at_angles()
    features, rounding = field_features(term, (fields,), AREAS, precision)
    features = of_one_kind(features)
    found = term.squared_distances(features, of_one_kind(features.copy()), AREAS)
    exact = term.squared_dist((fields[:, None],), (fields[None],)) @ AREAS
    assert exact[0, 1] == pytest.approx(np.sum(AREAS * angles**2), rel=1e-12)
    assert exact[0, 2] == 0
    tolerance = {"single": 1e-6, "double": 1e-14}[precision]
    np.testing.assert_allclose(found, exact, rtol=tolerance, atol=tolerance)
    above = np.triu_indices(len(found), 1)
    within = term.squared_distances(features, features, AREAS)
    np.testing.assert_array_equal(found[above], within[above])
    assert rounding.any() == (precision == "single")


def test_rounding_bounds_what_single_precision_loses():
    term, (fields, _) = RotationTerm(), quaternions_at_angles()
    single, rounding = field_features(term, (fields,), AREAS, "single")
    kept = np.moveaxis(single[:, :, : len(AREAS)].astype(np.float64), 1, -1)
    kept /= np.linalg.norm(kept, axis=-1, keepdims=True)
    lost = np.sqrt(term.squared_dist((fields,), (kept,)) @ AREAS)
    # What is kept differs from these in its length, too: by √2 at most of what is lost in the mean.
    assert np.all(lost <= rounding)
    chords = np.linalg.norm(single[:, :, : len(AREAS)] - np.moveaxis(fields, -1, 1), axis=1)
    np.testing.assert_allclose(rounding**2, 8.0 * chords**2 @ AREAS, rtol=1e-9)
    assert np.all(rounding < 1e-5)
