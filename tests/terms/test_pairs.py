"""The compiled sums over pairs, against NumPy."""

import numpy as np
import pytest
from packed_fields import field_features

from riemhuman.kernels import threads
from riemhuman.terms import EbinTerm, FlatTerm, NormalTerm, RotationTerm

each_precision = pytest.mark.parametrize("precision", ["single", "double"])

F = 1290  # two chunks and a piece
WEIGHTS = threads.of_one_kind(np.random.default_rng(3).uniform(0.0, 1e-3, F))


class Numbers(FlatTerm):
    """Fields of one number."""

    def field(self, first):
        return first.e[..., None]


def metric_fields(n):
    rng = np.random.default_rng(n)
    x, s = rng.uniform(-1, 1, (n, F)), rng.uniform(0, 1.5, (n, F))
    s[:, 7] = 0.0
    return x, np.exp(rng.uniform(-1, 1, (n, F))), s


def unit_normals(n):
    normals = np.random.default_rng(n).standard_normal((n, F, 3))
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True),)


def quaternions(n):
    found = np.random.default_rng(n).standard_normal((n, F, 4))
    return (found / np.linalg.norm(found, axis=2, keepdims=True),)


def numbers(n):
    return (metric_fields(n)[0][..., None],)


KERNELS = {
    "ebin": (EbinTerm(lam=0.3), metric_fields),
    "ebin, small lam": (EbinTerm(lam=3e-3), metric_fields),
    "normal": (NormalTerm(), unit_normals),
    "rotation": (RotationTerm(), quaternions),
    "flat": (Numbers(), numbers),
}
each_kernel = pytest.mark.parametrize(("term", "fields"), KERNELS.values(), ids=KERNELS)


def features(term, fields, precision):
    return field_features(term, fields, WEIGHTS, precision)[0]


def distances(term, a, b, n_threads=1):
    def run(pair):
        return term.squared_distances(*pair[0], *pair[1], WEIGHTS)

    return threads.in_tiles(run, (a,), (b,), n_threads)


@each_kernel
@each_precision
def test_sums_agree_with_numpy(term, fields, precision):
    rows, columns = fields(23), fields(11)
    found = distances(term, *(features(term, one, precision) for one in (rows, columns)))
    every_pair = [v[:, None] for v in rows], [v[None] for v in columns]
    exact = np.sum(WEIGHTS * term.squared_dist(*every_pair), axis=-1)
    np.testing.assert_allclose(found, exact, rtol={"single": 1e-6, "double": 1e-14}[precision])


@each_kernel
@each_precision
def test_bits_do_not_depend_on_company(term, fields, precision):
    """Threads, tiles, neighbours and the order of a pair leave its distance alone."""
    a, b = (features(term, fields(n), precision) for n in (23, 11))
    whole = distances(term, a, b)
    np.testing.assert_array_equal(distances(term, a, b, n_threads=2), whole)
    np.testing.assert_array_equal(distances(term, b, a).T, whole)
    np.testing.assert_array_equal(distances(term, a[5:9], b[3:4]), whole[5:9, 3:4])
    np.testing.assert_array_equal(distances(term, np.asfortranarray(a), b[:]), whole)
    within = distances(term, a, a)
    np.testing.assert_array_equal(within, distances(term, a, a.copy()))
    np.testing.assert_array_equal(within, within.T)
    np.testing.assert_array_equal(np.diag(within), 0.0)
    # Tiles of eight points, as of the largest surfaces, which more threads have too.
    np.testing.assert_array_equal(distances(term, a, b, n_threads=9), whole)
    np.testing.assert_array_equal(distances(term, a, a, n_threads=9), within)


@pytest.mark.parametrize("lam", [1e-8, 1e-4, 1.0, 1e4])
def test_rounding_bounds_the_distance_to_what_is_kept(lam):
    term, fields = EbinTerm(lam=lam), metric_fields(3)
    double = features(term, fields, "double")
    single, rounding = field_features(term, fields, WEIGHTS, "single")
    pair = (threads.of_one_kind(double), threads.of_one_kind(single.astype(float)))
    gaps = np.sqrt(np.diag(term.squared_distances(*pair, WEIGHTS)))
    assert np.all(gaps <= rounding * (1 + 1e-6))
    # The bound is no waste either.
    assert np.all(rounding < 1.5 * gaps)
