"""Work in chunks gives what the plain products give, whatever runs it."""

import multiprocessing
import os
import threading

import numpy as np
import pytest
from scipy import sparse
from threadpoolctl import threadpool_info, threadpool_limits

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.kernels import threads
from riemhuman.kernels.threads import in_tiles, slices


@pytest.mark.parametrize("size", [0, 1, 3, 10, 1001])
@pytest.mark.parametrize("threaded", [False, True])
def test_chunks_are_in_order_and_cover_everything(size, threaded):
    parts = threads.in_chunks(lambda first, last: list(range(first, last)), size, threaded=threaded)
    assert len(parts) == threads.N_CHUNKS
    assert [number for part in parts for number in part] == list(range(size))


def test_one_thread_is_the_calling_one():
    for n_threads in (1, 2, 3):
        ran = set(threads.mapped(lambda _: threading.get_ident(), range(10), n_threads))
        assert (ran == {threading.get_ident()}) == (n_threads == 1)


@pytest.mark.parametrize("length", [1001, 100_003], ids=["alone", "threaded"])
def test_products_of_long_rows(length):
    """From half a million numbers on in threads, whose parts are multiplied part by part."""
    rng = np.random.default_rng(1)
    rows, coefficients = rng.standard_normal((7, length)), rng.standard_normal((5, 7))
    combined = threads.combine_rows(coefficients, rows)
    np.testing.assert_allclose(combined, coefficients @ rows, rtol=1e-13, atol=1e-13)
    paired = threads.pair_with_rows(combined, rows)
    np.testing.assert_allclose(paired, combined @ rows.T, rtol=1e-12, atol=1e-9)
    numbers = np.arange(length)
    matrix = sparse.csr_array((rng.standard_normal(length), (numbers, rng.permutation(numbers))))
    form = threads.quadratic_form(matrix, rows)
    np.testing.assert_allclose(form, rows @ matrix @ rows.T, rtol=1e-12, atol=1e-9)


def blas_threads():
    return [entry["num_threads"] for entry in threadpool_info() if entry["user_api"] == "blas"]


@pytest.fixture
def two_blas_threads():
    with threadpool_limits(limits=2, user_api="blas"):
        yield blas_threads()


def test_libraries_in_one_thread_for_overlapping_users(two_blas_threads):
    before = two_blas_threads
    first, second = threads.single_threaded_libraries(), threads.single_threaded_libraries()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert set(blas_threads()) == {1}
    second.__exit__(None, None, None)
    assert blas_threads() == before
    # And once more, after all have left.
    with threads.single_threaded_libraries():
        assert set(blas_threads()) == {1}
    assert blas_threads() == before


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system does not fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own():
    threads.in_chunks(lambda first, last: None, 10, threaded=True)
    queue = multiprocessing.get_context("fork").SimpleQueue()

    def work():
        parts = threads.in_chunks(lambda first, last: int(last - first), 10, threaded=True)
        queue.put(sum(parts))

    child = multiprocessing.get_context("fork").Process(target=work)
    child.start()
    child.join(timeout=300)
    finished = child.exitcode == 0
    child.kill()
    assert finished
    assert queue.get() == 10


def test_numbers_of_threads(monkeypatch):
    assert [threads.thread_count(n_jobs) for n_jobs in (None, 1, 3)] == [1, 1, 3]
    assert threads.thread_count(-1) == os.cpu_count()
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert threads.thread_count(-1) == 1
    for wrong in (0, -2):
        with pytest.raises(ArgumentError, match=f"-1, or at least 1; found {wrong}"):
            threads.thread_count(wrong)
    with pytest.raises(ArgumentTypeError, match="n_jobs must be a whole number"):
        threads.thread_count(1.5)


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


def test_slices_divide_a_range():
    assert list(slices(7, 3)) == [slice(0, 3), slice(3, 6), slice(6, 7)]
    assert list(slices(6, 3)) == [slice(0, 3), slice(3, 6)]
    assert list(slices(0, 3)) == []
