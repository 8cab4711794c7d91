"""Damage done to files: seeded mutations of bytes and of archives.

Every mutation takes a generator and the content of a valid file, and returns another content.
"""

import io
import re
import struct
from collections.abc import Callable

import numpy as np

_NUMBERS = [
    *("0", "-1", "1", "3", "255", "65536", "2147483647", "2147483648", "4294967295", "1_0", "٣"),
    *("9223372036854775807", "-9223372036854775809", "1" * 5000, "nan", "-inf", "1e308", "1.5", ""),
]

Mutation = Callable[[np.random.Generator, bytes], bytes]


def one_of(rng, choices):
    return choices[int(rng.integers(len(choices)))]


def truncate(rng, content):
    return content[: int(rng.integers(len(content) + 1))]


def flip_bits(rng, content):
    """Flip some bits, half of the time in the header."""
    changed = bytearray(content)
    size = min(len(content), int(rng.choice([128, len(content)])))
    for position in rng.integers(size, size=int(rng.integers(1, 9))) if size else ():
        changed[position] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def change_numbers(rng, content):
    """Replace numbers written out, those of a header rather than others."""
    for _ in range(int(rng.integers(1, 4))):
        numbers = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?", content))
        if not numbers:
            return change_integers(rng, content)
        match = numbers[
            int(rng.integers(min(len(numbers), int(rng.choice([4, 12, len(numbers)])))))
        ]
        content = content[: match.start()] + one_of(rng, _NUMBERS).encode() + content[match.end() :]
    return content


def change_integers(rng, content):
    """Write a number at the limits of its type over some bytes."""
    kind = str(rng.choice(["<i", ">i", "<q", ">q", "<d", ">d", "<H", "B"]))
    if kind[-1] == "d":
        choices = [float("nan"), float("inf"), 1e308, -1e-308]
    else:
        top = 2 ** (8 * struct.calcsize(kind) - (kind[-1] in "iq"))
        choices = [top - 1, top // 2, top // 4096, 0] + ([-1, -top] if kind[-1] in "iq" else [])
    data = struct.pack(kind, one_of(rng, choices))
    start = int(rng.integers(max(1, len(content) - len(data))))
    return content[:start] + data + content[start + len(data) :]


def nest(rng, content):
    """Open brackets, marks and quotes without end."""
    opening = one_of(rng, [b"(", b"](", b"[", b"{", b'"', b"(]", b"0 ", b"f ", b'{"a":'])
    start = int(rng.integers(min(len(content), 200) + 1))
    return content[:start] + opening * int(rng.integers(1_000, 30_000)) + content[start:]


BYTES: tuple[Mutation, ...] = (
    *(truncate, flip_bits, flip_bits, change_numbers, change_numbers, change_integers, nest),
)


def archive(arrays, compressed=False):
    """Return arrays as the content of an .npz file."""
    stream = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(stream, **arrays)
    return stream.getvalue()


def change_array(rng, array):
    """Return an array that is not what was there: of other numbers, shape or type."""
    if rng.integers(3) == 0 and array.dtype.kind in "fiu" and array.size:
        changed = array.astype(np.float64)
        changed.flat[int(rng.integers(changed.size))] = rng.choice([np.nan, np.inf, -1, 2.0**62])
        return changed
    rows = np.atleast_1d(array)
    changes = [rows[:-1], rows[..., :0], rows[:0], rows.T, rows[None], rows[::-1], np.array("text")]
    changes += [np.concatenate([rows, rows]), np.zeros((1,) * 32), rows.astype("U3"), rows != rows]
    return one_of(rng, changes)


def change_fields(rng, content):
    """Change or remove an array of an archive; checksums are right afterwards."""
    with np.load(io.BytesIO(content)) as found:
        arrays = dict(found)
    name = one_of(rng, list(arrays))
    arrays[name] = change_array(rng, arrays[name])
    if rng.integers(8) == 0:
        del arrays[one_of(rng, list(arrays))]
    return archive(arrays)


ARCHIVES: tuple[Mutation, ...] = (*BYTES, *[change_fields] * 8)
