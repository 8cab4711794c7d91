"""Body models made up in SMPL's layout, and pickles of them as Python 2 wrote them.

No class of chumpy or of an old SciPy is needed: classes and functions are written by their names.
"""

import io
import pickle
import struct
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from riemhuman.bodies import BodyModel

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


def smpl_model(n_joints, n_betas=16, rng=0, **changes):
    """Return a small model in SMPL's tree."""
    fields = smpl_fields(n_joints, n_vertices=30, n_betas=n_betas, rng=rng) | changes
    fields["faces"], fields["joint_regressor"] = fields.pop("f"), fields.pop("J_regressor")
    return BodyModel(**fields)


@dataclass
class Raw:
    """Opcodes as they are."""

    opcodes: bytes


def name_of(what):
    """Return the opcode that looks up "module name"."""
    return Raw(b"c" + what.replace(" ", "\n").encode() + b"\n")


@dataclass
class Call:
    """A call of something by its name."""

    function: str
    arguments: tuple


@dataclass
class Instance:
    """An object of a class by its name."""

    cls: str
    state: dict


@dataclass
class Built:
    """What a call returns, with a state."""

    call: Call
    state: tuple


def ch(x, cls="chumpy.ch Ch"):
    """Return a chumpy array."""
    return Instance(cls, {"x": x, "_itr": None, "_dirty_vars": Call("__builtin__ set", ([],))})


def select(a, idxs, preferred_shape):
    """Return a part of a chumpy array."""
    state = {"a": a, "idxs": idxs, "preferred_shape": preferred_shape}
    return Instance("chumpy.reordering Select", state)


def old_sparse(matrix, cls="scipy.sparse.csc csc_matrix", **changes):
    """Return a SciPy matrix, its class under whatever name."""
    state = {"_shape": matrix.shape, "format": matrix.format, "data": matrix.data}
    state |= {"indices": matrix.indices, "indptr": matrix.indptr}
    return Instance(cls, state | changes)


class _Python2(pickle._Pickler):
    """Writes texts as Python 2 did, and arrays as its NumPy did."""

    dispatch = pickle._Pickler.dispatch.copy()

    def save_text(self, value):
        data = value.encode("latin-1") if isinstance(value, str) else value
        if self.proto == 0:
            self.write(b"S" + repr(data)[1:].encode() + b"\n")
        elif len(data) < 256:
            self.write(b"U" + bytes([len(data)]) + data)
        else:
            self.write(b"T" + struct.pack("<i", len(data)) + data)

    def save_raw(self, value):
        self.write(value.opcodes)

    def save_call(self, value):
        self.save(name_of(value.function))
        self.save(value.arguments)
        self.write(b"R")

    def save_instance(self, value):
        if self.proto == 0:
            arguments = (name_of(value.cls), name_of("__builtin__ object"), None)
            self.save(Call("copy_reg _reconstructor", arguments))
        else:
            self.save(name_of(value.cls))
            self.write(b")\x81")
        self.save(value.state)
        self.write(b"b")

    def save_built(self, value):
        self.save(value.call)
        self.save(value.state)
        self.write(b"b")

    def save_array(self, array):
        order = "F" if array.flags.f_contiguous and array.ndim > 1 else "C"
        little = array.astype(array.dtype.newbyteorder("<"))
        sign = "|" if array.dtype.itemsize == 1 else "<"
        dtype = Call("numpy dtype", (little.dtype.str[1:], 0, 1))
        dtype = Built(dtype, (3, sign, None, None, None, -1, -1, 0))
        empty = (name_of("numpy ndarray"), (0,), "b")
        state = (1, array.shape, dtype, order == "F", little.tobytes(order))
        self.save(Built(Call("numpy.core.multiarray _reconstruct", empty), state))

    dispatch |= {str: save_text, bytes: save_text, np.ndarray: save_array, Raw: save_raw}
    dispatch |= {Call: save_call, Instance: save_instance, Built: save_built}


def pickled(value, protocol=2):
    """Return the pickle that Python 2 would write of a value, without memory."""
    stream = io.BytesIO()
    pickler = _Python2(stream, protocol)
    pickler.fast = True
    pickler.dump(value)
    return stream.getvalue()


def smpl_pickle(fields, protocol=2):
    """Return SMPL's own mixture: chumpy arrays, a sparse regressor of old, notes beside."""
    n_entries = fields["shapedirs"].size
    rng = np.random.default_rng(3)
    order = rng.permutation(2 * n_entries)[:n_entries]
    larger = np.zeros(2 * n_entries)
    larger[order] = fields["shapedirs"].ravel()
    changed = fields | {
        "v_template": ch(fields["v_template"]),
        "shapedirs": select(ch(larger), order, fields["shapedirs"].shape),
        "J_regressor": old_sparse(sparse.csc_matrix(fields["J_regressor"])),
        "posedirs": np.asfortranarray(fields["posedirs"]),
        "bs_style": "lbs",
        "bs_type": "lrotmin",
        "vert_sym_idxs": np.arange(len(fields["v_template"])),
    }
    return pickled(changed, protocol)
