"""The compiled sums over pairs, against NumPy."""

from functools import partial

import numpy as np
import pytest
from packed_fields import field_features

from riemhuman.kernels import threads
from riemhuman.terms import EbinTerm, NormalTerm, flat

PRECISIONS = {"single": np.float32, "double": np.float64}
each_precision = pytest.mark.parametrize("precision", PRECISIONS)
ROUNDING = {name: float(np.finfo(real).eps) for name, real in PRECISIONS.items()}

F = 1290  # two chunks and a piece


def metric_fields(n, rng):
    rng = np.random.default_rng(rng)
    x, s = rng.uniform(-1, 1, (n, F)), rng.uniform(0, 1.5, (n, F))
    s[:, 7] = 0.0
    return x, np.exp(rng.uniform(-1, 1, (n, F))), s


def unit_normals(n, rng):
    normals = np.random.default_rng(rng).standard_normal((n, F, 3))
    return normals / np.linalg.norm(normals, axis=2, keepdims=True)


WEIGHTS = threads.of_one_kind(np.random.default_rng(3).uniform(0.0, 1e-3, F))


def in_threads(term, a, b, n_threads=1):
    """Return all squared distances between features, by a term or of vectors."""

    def run(pair):
        rows, columns = pair
        if term is None:
            return flat.flat_distances(*rows, *columns)
        return term.squared_distances(*rows, *columns, WEIGHTS)

    return threads.in_tiles(run, (a,), (b,), n_threads)


def ebin_pairs(precision, n_a=23, n_b=11, n_threads=1, lam=0.3):
    a, b = (
        field_features(EbinTerm(lam=lam), metric_fields(n, n), WEIGHTS, precision)[0]
        for n in (n_a, n_b)
    )
    return a, b, partial(in_threads, EbinTerm(lam=lam), n_threads=n_threads)


def normal_pairs(precision, n_a=23, n_b=11, n_threads=1):
    a, b = (
        field_features(NormalTerm(), (unit_normals(n, n),), WEIGHTS, precision)[0]
        for n in (n_a, n_b)
    )
    return a, b, partial(in_threads, NormalTerm(), n_threads=n_threads)


def flat_pairs(precision, n_a=23, n_b=11, n_threads=1):
    a, b = (
        flat.vector_features(metric_fields(n, n)[0][..., None], WEIGHTS, precision)[0]
        for n in (n_a, n_b)
    )
    return a, b, partial(in_threads, None, n_threads=n_threads)


def exact_ebin(n_a, n_b, lam=0.3):
    a, b = metric_fields(n_a, n_a), metric_fields(n_b, n_b)
    pairs = [v[:, None] for v in a], [v[None] for v in b]
    return np.sum(WEIGHTS * EbinTerm(lam=lam).squared_dist(*pairs), axis=-1)


def exact_normal(n_a, n_b):
    a, b = unit_normals(n_a, n_a), unit_normals(n_b, n_b)
    return np.sum(WEIGHTS * NormalTerm().squared_dist((a[:, None],), (b[None],)), axis=-1)


def exact_flat(n_a, n_b):
    a, b = metric_fields(n_a, n_a)[0], metric_fields(n_b, n_b)[0]
    return np.sum(WEIGHTS * (a[:, None] - b[None]) ** 2, axis=-1)


KERNELS = {
    "ebin": (ebin_pairs, exact_ebin),
    "ebin, small lam": (partial(ebin_pairs, lam=3e-3), partial(exact_ebin, lam=3e-3)),
    "normal": (normal_pairs, exact_normal),
    "flat": (flat_pairs, exact_flat),
}
each_kernel = pytest.mark.parametrize("name", KERNELS)


@each_kernel
@each_precision
def test_sums_agree_with_numpy(name, precision):
    build, exact = KERNELS[name]
    a, b, distances = build(precision)
    tolerance = {"single": 1e-6, "double": 1e-14}[precision]
    np.testing.assert_allclose(distances(a, b), exact(23, 11), rtol=tolerance)


@each_kernel
@each_precision
def test_bits_do_not_depend_on_company(name, precision, monkeypatch):
    """Threads, tiles, neighbours and the order of a pair leave its distance alone."""
    a, b, distances = KERNELS[name][0](precision)
    whole = distances(a, b)
    np.testing.assert_array_equal(distances(a, b, n_threads=2), whole)
    np.testing.assert_array_equal(distances(b, a).T, whole)
    np.testing.assert_array_equal(distances(a[5:9], b[3:4]), whole[5:9, 3:4])
    np.testing.assert_array_equal(distances(np.asfortranarray(a), b[:]), whole)
    within = distances(a, a)
    np.testing.assert_array_equal(within, distances(a, a.copy()))
    np.testing.assert_array_equal(within, within.T)
    np.testing.assert_array_equal(np.diag(within), 0.0)
    monkeypatch.setattr(threads, "_TILE_WORK", 1)
    np.testing.assert_array_equal(distances(a, b), whole)
    np.testing.assert_array_equal(distances(a, a, n_threads=2), within)


# What rounding of the features comes to.


@pytest.mark.parametrize("lam", [1e-8, 1e-4, 1.0, 1e4])
def test_rounding_bounds_the_distance_to_what_is_kept(lam):
    x, y, s = metric_fields(3, 0)
    double, _ = field_features(EbinTerm(lam=lam), (x, y, s), WEIGHTS, "double")
    single, rounding = field_features(EbinTerm(lam=lam), (x, y, s), WEIGHTS, "single")
    pair = (threads.of_one_kind(double), threads.of_one_kind(single.astype(float)))
    gaps = np.sqrt(np.diag(EbinTerm(lam=lam).squared_distances(*pair, WEIGHTS)))
    assert np.all(gaps <= rounding * (1 + 1e-6))
    # The bound is no waste either.
    assert np.all(rounding < 1.5 * gaps)
