"""Damage done to files: seeded mutations of bytes, of archives, of pickles and of the file system.

Every mutation takes a generator and the content of a valid file, and returns another content, or
puts something that is no regular file in its place.
"""

from __future__ import annotations

import io
import os
import re
import struct
import warnings
import zipfile
from collections.abc import Callable

import h5py
import numpy as np

CANARY = "canary"
"""Name of a file, in the working directory, that hostile content writes if it is run."""

_COMMAND = f"echo run > {CANARY}"
_NUMBERS = [
    *("0", "-1", "1", "2", "3", "7", "255", "65536", "2147483647", "2147483648", "4294967295"),
    *("9223372036854775807", "-9223372036854775809", "100000000000000000000", "1" * 5000),
    *("nan", "inf", "-inf", "1e308", "1e999", "-0.0", "0x10", "1_0", "٣", "²", "1.5", ""),
]

Mutation = Callable[[np.random.Generator, bytes], bytes]


class Exploit:
    """Runs a command when it is unpickled."""

    def __reduce__(self):
        return os.system, (_COMMAND,)


def _span(rng, content, longest=64):
    start = int(rng.integers(len(content) + 1))
    return start, min(len(content), start + int(rng.integers(1, longest + 1)))


def truncate(rng, content):
    return content[: int(rng.integers(len(content) + 1))]


def flip_bits(rng, content):
    changed = bytearray(content)
    for position in rng.integers(len(content), size=int(rng.integers(1, 9))) if content else ():
        changed[position] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def flip_bits_of_the_head(rng, content):
    size = min(len(content), 128)
    return flip_bits(rng, content[:size]) + content[size:]


def delete_bytes(rng, content):
    start, stop = _span(rng, content)
    return content[:start] + content[stop:]


def swap_chunks(rng, content):
    first, second, third = sorted(int(i) for i in rng.integers(len(content) + 1, size=3))
    return content[:first] + content[second:third] + content[first:second] + content[third:]


def change_numbers(rng, content):
    """Replace one to three numbers written out, those of a header rather than others."""
    for _ in range(int(rng.integers(1, 4))):
        found = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?", content))
        if not found:
            return change_integers(rng, content)
        among = min(len(found), int(rng.choice([4, 12, len(found)])))
        match = found[int(rng.integers(among))]
        number = _NUMBERS[int(rng.integers(len(_NUMBERS)))].encode()
        content = content[: match.start()] + number + content[match.end() :]
    return content


def change_integers(rng, content):
    """Write a number at the limits of its type over some bytes."""
    kind = str(rng.choice(["<i", ">i", "<q", ">q", "<d", ">d", "<H", "B"]))
    if kind[-1] == "d":
        choices = [float("nan"), float("inf"), 1e308, -1e-308]
    else:
        top = 2 ** (8 * struct.calcsize(kind) - (kind[-1] in "iq"))
        choices = [top - 1, top // 2, top // 4096, 0] + ([-1, -top] if kind[-1] in "iq" else [])
    data = struct.pack(kind, choices[int(rng.integers(len(choices)))])
    start = int(rng.integers(max(1, len(content) - len(data))))
    return content[:start] + data + content[start + len(data) :]


def empty(rng, content):
    return b""


def nest(rng, content):
    """Open brackets, marks and quotes without end."""
    opening = [b"(", b"](", b"((", b"[", b"{", b'"', b"\x28\x5d", b"0 ", b"f ", b'{"a":'][
        int(rng.integers(10))
    ]
    start = int(rng.integers(min(len(content), 200) + 1))
    return content[:start] + opening * int(rng.integers(1_000, 30_000)) + content[start:]


BYTES: tuple[Mutation, ...] = (
    *(truncate, flip_bits, flip_bits_of_the_head, delete_bytes, swap_chunks),
    *(change_numbers, change_numbers, change_integers, nest, empty),
)


def archive(arrays, compressed=False):
    """Return arrays as the content of an .npz file."""
    stream = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(stream, **arrays)
    return stream.getvalue()


def array_file(array):
    """Return an array as the content of an .npy file, pickled if it must be."""
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    return stream.getvalue()


def array_header(shape, descr="<f8"):
    """Return the header alone of an .npy file."""
    stream = io.BytesIO()
    header = {"descr": descr, "fortran_order": False, "shape": tuple(shape)}
    np.lib.format.write_array_header_2_0(stream, header)
    return stream.getvalue()


def change_array(rng, array):
    """Return an array that is not what was there: of other numbers, shape, type or order."""
    kind = int(rng.integers(22))
    changed = np.array(array)
    if kind < 5:
        value = [np.nan, np.inf, -1, 2.0**62, 1e300][kind]
        if changed.dtype.kind in "fiu" and changed.size:
            changed = changed.astype(np.float64)
            changed.flat[int(rng.integers(changed.size))] = value
        return changed
    if kind < 7:
        dtypes = ["f4", "f2", "i1", "u8", ">f8", ">i4", "U3", "S2", "c16", "?", "M8[s]", "m8[D]"]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                return changed.astype(dtypes[int(rng.integers(len(dtypes)))])
            except (TypeError, ValueError):
                return np.array(["text"])
    return [
        lambda: changed[:-1] if changed.ndim else changed.reshape(1),
        lambda: changed[..., :0] if changed.ndim else np.empty(0),
        lambda: changed[:0] if changed.ndim else np.empty((0, 3)),
        lambda: changed.T,
        lambda: changed[np.newaxis],
        lambda: changed.ravel(),
        lambda: np.asfortranarray(changed),
        lambda: changed[::-1] if changed.ndim else changed,
        lambda: np.float64(3.0),
        lambda: np.array("text"),
        lambda: np.array([Exploit()], dtype=object),
        lambda: np.zeros(3, dtype=[("a", "f8"), ("b", "i4")]),
        lambda: np.zeros((1,) * 33)[..., 0] if changed.ndim else changed,
        lambda: np.zeros_like(changed) if changed.dtype.kind in "fiu" else changed,
        lambda: np.concatenate([changed, changed]) if changed.ndim else changed,
    ][kind - 7]()


def change_fields(rng, content):
    """Change arrays of an archive; checksums are right afterwards."""
    with np.load(io.BytesIO(content)) as found:
        arrays = dict(found)
    names = list(arrays)
    for _ in range(int(rng.integers(1, 3))):
        name = names[int(rng.integers(len(names)))]
        arrays[name] = change_array(rng, arrays[name])
    if rng.integers(8) == 0:
        arrays.pop(names[int(rng.integers(len(names)))])
    return archive(arrays)


def change_members(rng, content):
    """Attack through the archive itself: bombs, lies about sizes, hostile names, doubles."""
    with zipfile.ZipFile(io.BytesIO(content)) as found:
        members = [(info.filename, found.read(info)) for info in found.infolist()]
    number = int(rng.integers(len(members)))
    name, data = members[number]
    method = zipfile.ZIP_DEFLATED if rng.integers(2) else zipfile.ZIP_STORED
    kind = int(rng.integers(11))
    if kind == 0:
        data = array_header([int(10.0 ** rng.integers(3, 19))]) + bytes(64)
    elif kind == 1:
        shape = [int(10.0 ** rng.integers(1, 7)) for _ in range(int(rng.integers(1, 5)))]
        data = array_header(shape, str(rng.choice(["<f8", "<U90000", "|b1", "|V100"])))
    elif kind == 2:
        data, method = _bomb(), zipfile.ZIP_DEFLATED
    elif kind == 3:
        name = str(rng.choice(["../../escaped.npy", "/tmp/escaped.npy", "a/../../b.npy", "C:\\x"]))
    elif kind == 4:
        members.append((name, data))
    elif kind == 5:
        data = content
    elif kind == 6:
        data = array_file(np.array([Exploit()], dtype=object))
    elif kind == 7:
        data = array_header([0] * int(rng.integers(30, 70)))
    elif kind == 8:
        data = array_header([3])[:10] + b"(" * 4000 + array_header([3])[10:]
    elif kind == 9:
        data = BYTES[int(rng.integers(len(BYTES)))](rng, data)
    else:
        data = data + rng.bytes(int(rng.integers(1, 50)))
    members[number] = (name, data)
    stream = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with zipfile.ZipFile(stream, "w", method) as changed:
            for name, data in members:
                changed.writestr(name, data)
    changed_content = stream.getvalue()
    if rng.integers(6) == 0:
        changed_content = _lie_about_sizes(rng, changed_content)
    return changed_content


def _bomb():
    """Return the header of an array of 1.3 GB, and some of the zeros it is of."""
    return array_header([160_000_000]) + bytes(10_000_000)


def _lie_about_sizes(rng, content):
    start = content.rfind(b"PK\1\2")
    field = start + int(rng.choice([8, 10, 16, 20, 24, 28, 30, 42]))
    return content[:field] + struct.pack("<I", int(rng.integers(2**32))) + content[field + 4 :]


ARCHIVES: tuple[Mutation, ...] = (*BYTES[:5], *[change_fields] * 8, *[change_members] * 6)

_HOSTILE_OPCODES = [
    *(bytes([code]) for code in b"Q021bR\x81osaeu."),
    b"cos\nsystem\n(S'" + _COMMAND.encode() + b"'\ntR",
    b"(S'" + _COMMAND.encode() + b"'\nios\nsystem\n",
    b"\x8c\x02os\x8c\x06system\x93\x8c" + bytes([len(_COMMAND)]) + _COMMAND.encode() + b"\x85R",
    b'c__builtin__\neval\n(S\'open("canary","w")\'\ntR',
    b"cnumpy\nload\n(S'x'\ntR",
    b"cbuiltins\nbytearray\n(J\xff\xff\xff\x7ftR",
    b"]q\x01h\x01a",
    b"}q\x01(h\x01h\x01u",
    b"\x8b\xff\xff\xff\x7f",
    b"\x8e\xff\xff\xff\xff\xff\xff\xff\x7f",
    b"\x96\x00\x00\x00\x00\x01\x00\x00\x00",
    b"T\xff\xff\xff\x7f",
    b"I" + b"9" * 5000 + b"\n",
    b"L" + b"9" * 5000 + b"L\n",
    b"r\xff\xff\xff\xff",
    b"p99999999999999999999\n",
    b"h\xff",
    b"Pperson\n",
    b"\x82\x01",
    b"(" * 3000,
    b"]" * 3000,
    b"\x85" * 3000,
    b"".join(b"\x86q%cj%c\0\0\0" % (i, i) for i in range(60)),
]


def insert_opcodes(rng, content):
    """Put opcodes where one begins, or anywhere."""
    starts = [match.start() for match in re.finditer(rb"[(\]})NRUX]", content)]
    start = starts[int(rng.integers(len(starts)))] if rng.integers(4) else _span(rng, content)[0]
    opcodes = _HOSTILE_OPCODES[int(rng.integers(len(_HOSTILE_OPCODES)))]
    replaced = int(rng.integers(0, 4)) if rng.integers(2) else 0
    return content[:start] + opcodes + content[start + replaced :]


PICKLES: tuple[Mutation, ...] = (*BYTES, *[insert_opcodes] * 15)


def change_hdf5(rng, content):
    """Change what an HDF5 file holds, by means of its own library."""
    stream = io.BytesIO(content)
    with h5py.File(stream, "r+") as file:
        names = list(file)
        name = names[int(rng.integers(len(names)))]
        kind = int(rng.integers(12))
        if kind < 4:
            array = change_array(rng, file[name][()])
            del file[name]
            if array.dtype.kind in "fiub" and array.ndim < 30:
                file[name] = array
            else:
                file[name] = "text"
        else:
            n_frames = int(10.0 ** rng.integers(3, 13))
            shape = (file[name].shape[0], 3, n_frames)
            del file[name]
            if kind == 4:
                file[name] = h5py.SoftLink("/nowhere")
            elif kind == 5:
                file[name] = h5py.SoftLink(f"/{name}")
            elif kind == 6:
                file[name] = h5py.ExternalLink("/etc/passwd", "/x")
            elif kind == 7:
                file.create_dataset(name, shape, "f8", chunks=(1, 3, 1000))
            elif kind == 8:
                file.create_dataset(name, (n_frames, 3), "i8", chunks=(1000, 3))
            elif kind == 9:
                file.create_group(name)
            elif kind == 10:
                external = [("/etc/passwd", 0, h5py.h5f.UNLIMITED)]
                file.create_dataset(name, (*shape[:2], 4), "u1", external=external)
            else:
                file[name] = np.dtype("f8")
    return stream.getvalue()


HDF5: tuple[Mutation, ...] = (*BYTES, *[change_hdf5] * 8)


def damage(rng, content, mutations):
    """Return the content after one or two mutations, and their names."""
    done = []
    for _ in range(1 + int(rng.integers(4) == 0)):
        mutation = mutations[int(rng.integers(len(mutations)))]
        try:
            content = mutation(rng, content)
        except Exception:
            # A second mutation may need what the first one broke.
            if not done:
                raise
            continue
        done.append(mutation.__name__)
    return content, " and ".join(done)
