"""Body models made up in SMPL's layout, and pickles of them as Python 2 wrote them.

No class of chumpy or of an old SciPy is needed: the opcodes are put together by hand.
"""

import struct
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

SMPL_PARENTS = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]


def smpl_fields(n_joints=24, n_vertices=60, n_betas=10, rng=0):
    """Return the fields of a model in SMPL's tree, as its files have them."""
    rng = np.random.default_rng(rng)
    parents = SMPL_PARENTS[:22] + [0] * (n_joints - 22)
    if n_joints == 24:
        parents = SMPL_PARENTS
    weights = rng.uniform(size=(n_vertices, n_joints)) ** 8
    regressor = rng.uniform(size=(n_joints, n_vertices)) * (
        rng.uniform(size=(n_joints, n_vertices)) < 0.3
    )
    regressor[:, 0] += 0.1
    numbers = np.arange(n_vertices - 2)
    return {
        "v_template": 0.5 * rng.normal(size=(n_vertices, 3)),
        "f": np.stack([numbers, numbers + 1, numbers + 2], axis=1).astype(np.uint32),
        "shapedirs": 0.05 * rng.normal(size=(n_vertices, 3, n_betas)),
        "J_regressor": regressor / regressor.sum(axis=1, keepdims=True),
        "weights": weights / weights.sum(axis=1, keepdims=True),
        "kintree_table": np.array([[2**32 - 1, *parents[1:]], range(n_joints)], dtype=np.uint32),
        "posedirs": 0.01 * rng.normal(size=(n_vertices, 3, 9 * (n_joints - 1))),
    }


@dataclass
class Ch:
    """A chumpy array."""

    x: object
    name: str = "Ch"
    module: str = "chumpy.ch"

    def state(self):
        return {"x": self.x, "_itr": None, "_dirty_vars": Call("__builtin__ set", ([],))}


@dataclass
class Select:
    """A part of a chumpy array."""

    a: object
    idxs: object
    preferred_shape: object
    name: str = "Select"
    module: str = "chumpy.reordering"

    def state(self):
        return {"a": self.a, "idxs": self.idxs, "preferred_shape": self.preferred_shape}


@dataclass
class Sparse:
    """A SciPy matrix, its class under whatever name."""

    matrix: object
    module: str = "scipy.sparse.csc"
    name: str = "csc_matrix"
    changes: dict = field(default_factory=dict)

    def state(self):
        matrix = self.matrix
        names = ("indices", "indptr")
        state = {"_shape": matrix.shape, "format": matrix.format, "data": matrix.data}
        return state | {name: getattr(matrix, name) for name in names} | self.changes


@dataclass
class Call:
    """A call of something by its name."""

    function: str
    arguments: tuple


@dataclass
class Raw:
    """Opcodes as they are."""

    opcodes: bytes


def pickled(value, protocol=2):
    """Return the pickle that Python 2 would write of a value."""
    write = _binary if protocol == 2 else _text
    return (b"\x80\x02" if protocol == 2 else b"") + write(value) + b"."


def smpl_pickle(fields, protocol=2):
    """Return SMPL's own mixture: chumpy arrays, a sparse regressor of old, notes beside."""
    n_entries = fields["shapedirs"].size
    rng = np.random.default_rng(3)
    order = rng.permutation(2 * n_entries)[:n_entries]
    larger = np.zeros(2 * n_entries)
    larger[order] = fields["shapedirs"].ravel()
    changed = fields | {
        "v_template": Ch(fields["v_template"]),
        "shapedirs": Select(Ch(larger), order, fields["shapedirs"].shape),
        "J_regressor": Sparse(sparse.csc_matrix(fields["J_regressor"])),
        "posedirs": np.asfortranarray(fields["posedirs"]),
        "bs_style": "lbs",
        "bs_type": "lrotmin",
        "vert_sym_idxs": np.arange(len(fields["v_template"])),
    }
    return pickled(changed, protocol)


def _reference(name):
    return b"c" + name.replace(" ", "\n").encode() + b"\n"


def _array_parts(array):
    order = "F" if array.flags.f_contiguous and array.ndim > 1 else "C"
    little = array.astype(array.dtype.newbyteorder("<"))
    dtype = Call("numpy dtype", (little.dtype.str[1:], 0, 1))
    dtype_state = (3, "|" if array.dtype.itemsize == 1 else "<", None, None, None, -1, -1, 0)
    empty = Call(
        "numpy.core.multiarray _reconstruct", (Raw(_reference("numpy ndarray")), (0,), "b")
    )
    return empty, array.shape, dtype, dtype_state, order == "F", little.tobytes(order)


def _binary(value):
    if isinstance(value, Raw):
        return value.opcodes
    if value is None:
        return b"N"
    if isinstance(value, bool):
        return b"\x88" if value else b"\x89"
    if isinstance(value, int):
        if -(2**31) <= value < 2**31:
            return b"J" + struct.pack("<i", value)
        size = value.bit_length() // 8 + 1
        return b"\x8a" + bytes([size]) + value.to_bytes(size, "little", signed=True)
    if isinstance(value, float):
        return b"G" + struct.pack(">d", value)
    if isinstance(value, (str, bytes)):
        data = value.encode("latin-1") if isinstance(value, str) else value
        short = len(data) < 256
        return (b"U" + bytes([len(data)]) if short else b"T" + struct.pack("<i", len(data))) + data
    if isinstance(value, tuple):
        return b"(" + b"".join(map(_binary, value)) + b"t"
    if isinstance(value, list):
        return b"](" + b"".join(map(_binary, value)) + b"e"
    if isinstance(value, dict):
        items = b"".join(_binary(key) + _binary(item) for key, item in value.items())
        return b"}(" + items + b"u"
    if isinstance(value, Call):
        return _reference(value.function) + _binary(value.arguments) + b"R"
    if isinstance(value, np.ndarray):
        empty, shape, dtype, dtype_state, in_columns, data = _array_parts(value)
        dtype = Raw(_binary(dtype) + _binary(dtype_state) + b"b")
        return _binary(empty) + _binary((1, shape, dtype, in_columns, data)) + b"b"
    made = _reference(f"{value.module} {value.name}") + b")\x81"
    return made + _binary(value.state()) + b"b"


def _text(value):
    if isinstance(value, Raw):
        return value.opcodes
    if value is None:
        return b"N"
    if isinstance(value, bool):
        return b"I01\n" if value else b"I00\n"
    if isinstance(value, int):
        return b"I%d\n" % value if value < 2**31 else b"L%dL\n" % value
    if isinstance(value, float):
        return b"F%r\n" % value
    if isinstance(value, (str, bytes)):
        data = value.encode("latin-1") if isinstance(value, str) else value
        return b"S" + repr(data)[1:].encode() + b"\n"
    if isinstance(value, tuple):
        return b"(" + b"".join(map(_text, value)) + b"t"
    if isinstance(value, list):
        return b"(l" + b"".join(_text(item) + b"a" for item in value)
    if isinstance(value, dict):
        items = b"".join(_text(key) + _text(item) + b"s" for key, item in value.items())
        return b"(d" + items
    if isinstance(value, Call):
        return _reference(value.function) + _text(value.arguments) + b"R"
    if isinstance(value, np.ndarray):
        empty, shape, dtype, dtype_state, in_columns, data = _array_parts(value)
        dtype = Raw(_text(dtype) + _text(dtype_state) + b"b")
        return _text(empty) + _text((1, shape, dtype, in_columns, data)) + b"b"
    cls, base = (
        Raw(_reference(name)) for name in (f"{value.module} {value.name}", "__builtin__ object")
    )
    made = _text(Call("copy_reg _reconstructor", (cls, base, None)))
    return made + _text(value.state()) + b"b"
