"""Streamed principal components against a full decomposition and against scikit-learn."""

import numpy as np
import pytest
from sklearn.decomposition import PCA

from riemhuman.surfaces import streaming_pca
from riemhuman.surfaces.streaming_pca import StreamingPCA


def rows_with_decay(n_rows, n_features, decay, seed=0, shift=0.0):
    """Return rows whose singular values fall off by the factor `decay` from one to the next."""
    rng = np.random.default_rng(seed)
    rank = min(n_rows, n_features)
    left = np.linalg.qr(rng.normal(size=(n_rows, rank)))[0]
    right = np.linalg.qr(rng.normal(size=(n_features, rank)))[0]
    return (left * decay ** np.arange(rank)) @ right.T + shift


def streamed(rows, n_components, **options):
    pca = StreamingPCA(n_components, rows.shape[1], **options)
    for row in rows:
        pca.add(row)
    return pca.components()


def assert_same_up_to_sign(found, expected, tolerance):
    cosines = np.abs(np.sum(found * expected, axis=1))
    np.testing.assert_allclose(cosines, 1.0, atol=tolerance)


def test_rows_in_the_buffer_give_the_full_decomposition():
    rows = rows_with_decay(60, 90, 0.8)
    found = streamed(rows, 20)
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    np.testing.assert_allclose(found.variance, values[:20] ** 2 / 60, rtol=1e-12)
    np.testing.assert_allclose(
        found.variance_ratio, values[:20] ** 2 / np.sum(values**2), rtol=1e-12
    )
    assert_same_up_to_sign(found.vectors, right[:20], 1e-12)
    # Falling by 0.8 each, the singular values stay above rounding up to the last one.
    assert (found.rank, found.n_samples, found.mean) == (60, 60, None)


def test_small_singular_values_survive():
    rows = rows_with_decay(12, 50, 0.1)  # down to 1e-11, whose square is beyond double precision
    found = streamed(rows, 12)
    np.testing.assert_allclose(np.sqrt(found.variance * 12), 0.1 ** np.arange(12.0), rtol=1e-4)


def test_rows_of_few_features_never_lose_anything():
    rows = rows_with_decay(1000, 9, 0.7)
    found = streamed(rows, 9)  # merged fifty times over
    _, values, right = np.linalg.svd(rows, full_matrices=False)
    np.testing.assert_allclose(found.variance, values**2 / 1000, rtol=1e-10)
    assert_same_up_to_sign(found.vectors, right, 1e-10)


@pytest.mark.parametrize("remove_mean", [False, True])
def test_low_rank_is_merged_without_loss(remove_mean):
    rng = np.random.default_rng(3)
    rows = rng.normal(size=(300, 6)) @ rng.normal(size=(6, 80)) + 2.0
    found = streamed(rows, 6, remove_mean=remove_mean, max_rows=18)
    reference = rows - rows.mean(axis=0) if remove_mean else rows
    _, values, right = np.linalg.svd(reference, full_matrices=False)
    divisor = 299 if remove_mean else 300
    np.testing.assert_allclose(found.variance, values[:6] ** 2 / divisor, rtol=1e-11)
    assert_same_up_to_sign(found.vectors, right[:6], 1e-11)
    assert found.rank == (6 if remove_mean else 7)


def test_merges_cost_no_more_than_what_they_drop():
    rows = rows_with_decay(400, 200, 0.97, seed=1)
    found = streamed(rows, 10, max_rows=30)
    exact = np.linalg.svd(rows, compute_uv=False)[:10] ** 2 / 400
    # Truncation only ever lowers variance, and hardly so for the strong components.
    assert (found.variance <= exact * (1 + 1e-12)).all()
    assert (found.variance > 0.8 * exact).all()
    finer = streamed(rows, 10, max_rows=120)
    assert np.abs(finer.variance - exact).max() < 0.1 * np.abs(found.variance - exact).max()


def test_total_variance_is_exact_despite_truncation():
    rows = rows_with_decay(400, 200, 0.97, seed=1)
    found = streamed(rows, 10, max_rows=30)
    np.testing.assert_allclose(
        found.variance / found.variance_ratio, np.sum(rows**2) / 400, rtol=1e-12
    )


@pytest.mark.parametrize("max_rows", [None, 40])
def test_mean_removal_agrees_with_scikit_learn(max_rows):
    rows = rows_with_decay(130, 70, 0.5, seed=2, shift=3.0)
    found = streamed(rows, 8, remove_mean=True, max_rows=max_rows)
    expected = PCA(8, svd_solver="full").fit(rows)
    np.testing.assert_allclose(found.mean, expected.mean_, rtol=1e-12)
    np.testing.assert_allclose(found.variance, expected.explained_variance_, rtol=1e-9)
    np.testing.assert_allclose(found.variance_ratio, expected.explained_variance_ratio_, rtol=1e-9)
    assert_same_up_to_sign(found.vectors, expected.components_, 1e-9)


def test_largest_entry_of_every_component_is_positive():
    found = streamed(-rows_with_decay(30, 40, 0.8), 10)
    peaks = np.abs(found.vectors).argmax(axis=1)
    assert (found.vectors[np.arange(10), peaks] > 0).all()


def test_components_may_be_asked_for_in_between():
    rows = rows_with_decay(40, 50, 0.8)
    pca = StreamingPCA(5, 50)
    for row in rows[:20]:
        pca.add(row)
    np.testing.assert_array_equal(pca.components().vectors, pca.components().vectors)
    for row in rows[20:]:
        pca.add(row)
    np.testing.assert_allclose(pca.components().variance, streamed(rows, 5).variance, rtol=1e-12)


def test_buffer_is_bounded(monkeypatch):
    monkeypatch.setattr(streaming_pca, "_BUFFER_BYTES", 8 * 1000 * 50)
    assert len(StreamingPCA(10, 1000)._rows) == 51
    assert len(StreamingPCA(40, 1000)._rows) == 121


def test_nothing_but_zeros_has_rank_zero():
    found = streamed(np.zeros((5, 9)), 2)
    assert found.rank == 0
    assert found.vectors.shape == (0, 9)


def test_rounding_does_not_count_as_rank():
    rng = np.random.default_rng(5)
    rows = rng.normal(size=(20, 2)) @ rng.normal(size=(2, 30)) * 1e-6
    noisy = rows + 1e-16 * rng.normal(size=rows.shape)
    pca = StreamingPCA(20, 30)
    for row in noisy:
        pca.add(row)
    assert pca.components().rank > 2
    assert pca.components(rounding=3e-16).rank == 2
