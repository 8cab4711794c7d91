"""Vectors computed by other programs, read from files and matched to bodies by id."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array
from riemhuman.checks import length_of, real_array, refuse_type
from riemhuman.descriptors.descriptor import Descriptor, Surfaces
from riemhuman.errors import ArgumentError, ArgumentTypeError, NotDefinedError, shown
from riemhuman.io.arrays import load_array, load_arrays
from riemhuman.io.files import file_path, format_errors, suffix_of
from riemhuman.io.text_tables import read_named_rows
from riemhuman.representation import Record, join_names


@dataclass(frozen=True, eq=False, repr=False)
class LatentVectors(Record, Descriptor):
    """Vectors of bodies computed by other programs, for example by a trained network.

    The distance is Euclidean.

    Parameters
    ----------
    ids : sequence of str or int
        Body of each vector.
    vectors : array_like, shape (n, d)
        Vectors, one per row.

    Examples
    --------
    >>> codes = rh.descriptors.LatentVectors(("a", "b"), np.array([[0.0, 0.0], [3.0, 4.0]]))
    >>> codes.select(["b"]).vectors
    array([[3., 4.]])
    """

    ids: tuple[str, ...]
    vectors: Array

    def __post_init__(self) -> None:
        ids = _as_ids(self.ids)
        vectors = real_array(self.vectors, "vectors", (len(ids), "n_numbers"), batched=False)
        if vectors.size == 0:
            raise ArgumentError(f"vectors holds no numbers; found shape {vectors.shape}")
        repeated = [name for name, count in Counter(ids).items() if count > 1]
        if repeated:
            raise ArgumentError(f"ids must differ; repeated ids: {join_names(repeated)}")
        object.__setattr__(self, "ids", ids)
        object.__setattr__(self, "vectors", vectors)

    @classmethod
    def from_file(cls, path: str | os.PathLike[str]) -> LatentVectors:
        """Read vectors with their ids from a file.

        Parameters
        ----------
        path : path_like
            One of

            - ``.npz`` with the fields ``ids`` (n,), text or whole numbers, and ``vectors`` (n, d);
            - ``.csv`` with one line per body: its id, then its numbers; a first line that begins
              with ``id`` is a header;
            - ``.npy``: an array (n, d); the ids are the numbers of its rows, from 0.
        """
        file = file_path(path)
        suffix = suffix_of(file, (".npz", ".csv", ".npy"))
        ids: Iterable[object]
        if suffix == ".npz":
            arrays = load_arrays(file, ["ids", "vectors"], optional=[])
            ids, vectors = arrays["ids"], arrays["vectors"]
        elif suffix == ".csv":
            rows = read_named_rows(file, "id")
            ids, vectors = list(rows), np.array(list(rows.values()))
        else:
            vectors = load_array(file)
            ids = range(len(vectors) if vectors.ndim else 0)
        with format_errors(file, "vectors of bodies"):
            return cls(_as_ids(ids), vectors)

    def select(self, ids: Iterable[object]) -> LatentVectors:
        """Return the vectors of a data set's bodies, in its order.

        Parameters
        ----------
        ids : iterable of str or int
            Ids of the data set; other vectors are left out.
        """
        wanted = _as_ids(ids)
        rows = {name: row for row, name in enumerate(self.ids)}
        missing = [name for name in wanted if name not in rows]
        if missing:
            unused = sorted(set(self.ids).difference(wanted))
            others = f"; vectors without a body: {join_names(unused)}" if unused else ""
            raise ArgumentError(
                f"{len(missing)} of {len(wanted)} bodies have no vector: "
                f"{', '.join(missing)}{others}"
            )
        return LatentVectors(wanted, self.vectors[[rows[name] for name in wanted]])

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        """Raise a NotDefinedError: these vectors belong to ids, not to meshes."""
        raise NotDefinedError(
            "LatentVectors cannot describe a new mesh, because other programs computed them; "
            "select(ids) returns the vectors of known bodies"
        )

    def describe_all(self, bodies: Surfaces, n_jobs: int | None = None) -> Array:
        """Return the vectors of the bodies of a data set, by its field ``ids``.

        If the ids of the vectors are the numbers from 0 on, they are the positions of the bodies.
        """
        numbers = [str(number) for number in range(length_of(bodies, "bodies"))]
        if set(self.ids) == set(numbers):
            return self.select(numbers).vectors
        return self.select(getattr(bodies, "ids", numbers)).vectors


def _as_ids(ids: Iterable[object]) -> tuple[str, ...]:
    if not isinstance(ids, Iterable):
        refuse_type(ids, "ids", "a sequence of texts or whole numbers")
    texts = []
    for number, value in enumerate(ids):
        if isinstance(value, bytes):
            value = value.decode("utf-8", errors="replace")
        if isinstance(value, bool | np.bool_) or not isinstance(value, str | int | np.integer):
            raise ArgumentTypeError(
                f"ids[{number}] must be text or a whole number; found {shown(value)}"
            )
        text = str(value).strip()
        if not text:
            raise ArgumentError(f"ids[{number}] is missing")
        texts.append(text)
    return tuple(texts)
