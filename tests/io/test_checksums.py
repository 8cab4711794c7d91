"""Checksums notice every single bit."""

import zlib

import numpy as np
import pytest

from riemhuman.io.job_folder import are_marks, checksums, mark


@pytest.mark.parametrize("shape", [(5,), (5, 3), (5, 2, 4), (5, 0)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_a_checksum_a_row(shape, dtype):
    rows = np.random.default_rng(0).normal(size=shape).astype(dtype)
    found = checksums(rows)
    assert (found.dtype, found.shape) == (np.uint32, (5,))
    assert found.tolist() == [zlib.crc32(row.tobytes()) for row in rows]
    np.testing.assert_array_equal(checksums(np.asfortranarray(rows)), found)


def test_every_bit_counts():
    rows = np.random.default_rng(1).normal(size=(2, 3))
    before, whole = checksums(rows), mark(rows)
    for bit in range(8 * rows.nbytes):
        flipped = rows.copy()
        flipped.view(np.uint8).reshape(-1)[bit // 8] ^= 1 << bit % 8
        changed = checksums(flipped) != before
        assert changed.tolist() == [bit < 192, bit >= 192]
        assert mark(flipped) != whole
    assert mark(rows.T) == mark(np.ascontiguousarray(rows.T)) != whole


@pytest.mark.parametrize("place", [0, 4095, 4096, 65535, 65536, 99_999])
def test_every_byte_of_long_rows_counts(place):
    rows = np.zeros((2, 100_000), dtype=np.uint8)
    before, whole = checksums(rows), mark(rows)
    rows[1, place] = 1
    assert (checksums(rows) != before).tolist() == [False, True]
    assert mark(rows) != whole


def test_marks_are_told_from_anything_else():
    block = np.ones((2, 2))
    assert are_marks(np.array([0, mark(block), 0], dtype=np.uint64))
    for bit in range(32, 64):
        assert not are_marks(np.array([mark(block) ^ 1 << bit], dtype=np.uint64))
        assert not are_marks(np.array([1 << bit], dtype=np.uint64))
    assert not are_marks(np.array([1], dtype=np.uint64))
