"""How pairs are divided into tiles."""

import numpy as np
import pytest

from riemhuman.kernels.threads import LARGEST, SMALLEST, UNDERFLOW, in_tiles, of_one_kind


@pytest.mark.parametrize("within", [True, False])
def test_several_threads_share_the_pairs_evenly(within):
    points = np.arange(100.0)[:, None]
    others = points if within else points + 0.5
    sizes = []

    def run(pair):
        (rows,), (columns,) = pair
        sizes.append(len(rows) * len(columns))
        return np.abs(rows - columns.T)

    np.testing.assert_array_equal(in_tiles(run, (points,), (others,), 1), np.abs(points - others.T))
    alone = len(sizes)
    found = in_tiles(run, (points,), (others,), 3)
    np.testing.assert_array_equal(found, np.abs(points - others.T))
    shared = sizes[alone:]
    assert len(shared) > alone
    assert max(shared) <= sum(shared) / 3 / 2


def test_squares_too_small_for_single_precision_stay_below_the_bound():
    smallest = float(np.finfo(np.float32).tiny)
    assert smallest <= UNDERFLOW < 1e6 * smallest


def test_a_number_fits_single_precision_where_its_reciprocal_does():
    assert abs(LARGEST * SMALLEST - 1.0) < 1e-12


def test_arrays_of_one_kind():
    array = np.arange(6.0).reshape(2, 3)
    for given in (array, array[:, ::-1], np.asfortranarray(array), array.T):
        kept = of_one_kind(given)
        np.testing.assert_array_equal(kept, given)
        assert kept.flags.c_contiguous
        assert not kept.flags.writeable
        assert given.flags.writeable
