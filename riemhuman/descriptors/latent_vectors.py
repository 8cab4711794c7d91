"""Vectors computed elsewhere, read from files and matched to bodies by their ids."""

from __future__ import annotations

import csv
import io
import os
from array import array
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.descriptors.descriptor import Descriptor
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    FileFormatError,
    NotDefinedError,
    RiemhumanError,
)
from riemhuman.representation import Record
from riemhuman.storage.array_files import load_array, load_arrays
from riemhuman.storage.file_content import file_path
from riemhuman.storage.number_text import real_field, text_content


@dataclass(frozen=True, repr=False)
class IdMatch(Record):
    """Which ids of a data set have a vector.

    Attributes
    ----------
    found : tuple of str
        Ids of the data set that have one, in its order.
    missing : tuple of str
        Ids of the data set that have none.
    unused : tuple of str
        Ids with a vector that the data set does not have.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> codes = rh.descriptors.LatentVectors(("a", "b"), np.eye(2))
    >>> codes.match(["b", "c"])
    IdMatch(found=('b',), missing=('c',), unused=('a',))
    """

    found: tuple[str, ...]
    missing: tuple[str, ...]
    unused: tuple[str, ...]


@dataclass(frozen=True, eq=False, repr=False)
class LatentVectors(Record, Descriptor):
    """Vectors of bodies computed elsewhere, for example by a trained network.

    Compared by the Euclidean distance.

    Parameters
    ----------
    ids : sequence of str or int
        Which body each vector belongs to.
    vectors : array_like, shape (n, d)
        One vector a row.

    Raises
    ------
    ArgumentTypeError
        If an id is neither text nor a whole number, or the vectors are not real numbers.
    ArgumentError
        If an id is empty or there twice, the lengths differ, or a number is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> codes = rh.descriptors.LatentVectors(("a", "b"), np.array([[0.0, 0.0], [3.0, 4.0]]))
    >>> codes.vectors.shape
    (2, 2)
    """

    ids: tuple[str, ...]
    vectors: np.ndarray

    def __post_init__(self) -> None:
        ids = _as_ids(self.ids, "ids")
        vectors = real_array(self.vectors, "vectors", ("n_vectors", "n_numbers"), batched=False)
        if len(ids) != len(vectors):
            raise ArgumentError(f"{len(ids)} ids found for {len(vectors)} vectors")
        if vectors.size == 0:
            raise ArgumentError(f"vectors holds no numbers; found shape {vectors.shape}")
        twice = [name for name, count in Counter(ids).items() if count > 1]
        if twice:
            raise ArgumentError(f"ids must differ; there more than once: {_listed(twice)}")
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
            - ``.csv``: a line a body, its id first and then its numbers; a first line that begins
              with ``id`` names the columns;
            - ``.npy``: an array (n, d), whose ids are the numbers of its rows, from 0.

        Returns
        -------
        LatentVectors

        Raises
        ------
        ArgumentTypeError
            If `path` is not a path.
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If the ending is another, a field is missing, an id is missing or there twice, a row
            has another length than the first, or something is not a finite number.
        """
        file = file_path(path)
        readers = {".npz": _read_npz, ".csv": _read_csv, ".npy": _read_npy}
        read = readers.get(file.suffix.lower())
        if read is None:
            raise FileFormatError(
                f"{file}: the ending must be one of {', '.join(readers)}; found "
                f"{repr(file.suffix) if file.suffix else 'none'}"
            )
        ids, vectors = read(file)
        try:
            return cls(ids, vectors)
        except RiemhumanError as error:
            raise FileFormatError(f"{file}: {error}") from error

    def match(self, ids: Iterable[Any]) -> IdMatch:
        """Report which ids of a data set have a vector.

        Parameters
        ----------
        ids : iterable of str or int
            Ids of the data set.

        Returns
        -------
        IdMatch
        """
        wanted = _as_ids(ids, "ids")
        known, asked = set(self.ids), set(wanted)
        return IdMatch(
            found=tuple(name for name in wanted if name in known),
            missing=tuple(name for name in wanted if name not in known),
            unused=tuple(name for name in self.ids if name not in asked),
        )

    def select(self, ids: Iterable[Any]) -> LatentVectors:
        """Return the vectors of a data set's bodies, in its order.

        Parameters
        ----------
        ids : iterable of str or int
            Ids of the data set; vectors of others are left out.

        Returns
        -------
        LatentVectors

        Raises
        ------
        ArgumentError
            If a body has no vector; the message names every such body.
        """
        found = self.match(ids)
        if found.missing:
            count = len(found.missing) + len(found.found)
            unused = f"; vectors of no body: {_listed(found.unused)}" if found.unused else ""
            raise ArgumentError(
                f"{len(found.missing)} of {count} bodies have no vector: "
                f"{', '.join(found.missing)}{unused}"
            )
        rows = {name: row for row, name in enumerate(self.ids)}
        return LatentVectors(found.found, self.vectors[[rows[name] for name in found.found]])

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> np.ndarray:
        """Refuse: the vector of a mesh is found by its id.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions.
        faces : array_like, shape (F, 3)
            Triangles.

        Raises
        ------
        NotDefinedError
            Always.
        """
        raise NotDefinedError(
            "LatentVectors were computed elsewhere and cannot describe a mesh; select(ids) gives "
            "the vectors of known bodies"
        )

    def describe_all(self, bodies: Any, n_jobs: int | None = None) -> np.ndarray:
        """Return the vectors of a data set's bodies.

        Parameters
        ----------
        bodies : object
            A data set; its field ``ids`` names the bodies. Vectors whose ids are the numbers of
            the bodies, from 0, go by these.
        n_jobs : int, optional
            Not used.

        Returns
        -------
        array, shape (n, d)

        Raises
        ------
        ArgumentError
            If a body has no vector; the message names every such body.
        """
        numbers = [str(number) for number in range(len(bodies))]
        by_number = set(self.ids) == set(numbers)
        return self.select(numbers if by_number else getattr(bodies, "ids", numbers)).vectors


def _as_ids(ids: Any, name: str) -> tuple[str, ...]:
    found = []
    for number, value in enumerate(np.asarray(ids).ravel() if _is_array(ids) else ids):
        if isinstance(value, bytes):
            value = value.decode("utf-8", errors="replace")
        if isinstance(value, bool | np.bool_) or not isinstance(value, str | int | np.integer):
            raise ArgumentTypeError(
                f"{name}[{number}] must be text or a whole number; found {value!r}"
            )
        text = str(value).strip()
        if not text:
            raise ArgumentError(f"{name}[{number}] is missing")
        found.append(text)
    return tuple(found)


def _is_array(ids: Any) -> bool:
    return isinstance(ids, np.ndarray)


def _listed(names: Sequence[str], limit: int = 20) -> str:
    more = f" and {len(names) - limit} more" if len(names) > limit else ""
    return ", ".join(name[:60] for name in names[:limit]) + more


def _read_npz(file: Path) -> tuple[Any, Any]:
    arrays = load_arrays(file, ["ids", "vectors"], optional=[])
    if arrays["ids"].ndim != 1:
        raise FileFormatError(
            f"{file}: ids must have shape (n_vectors); found {arrays['ids'].shape}"
        )
    if arrays["ids"].dtype.kind not in "iuSU":
        raise FileFormatError(
            f"{file}: ids must be text or whole numbers; found {arrays['ids'].dtype}"
        )
    # Before any of them becomes a text of its own: equal ones take no room in an archive.
    ids, counts = np.unique(arrays["ids"], return_counts=True)
    if counts.max(initial=1) > 1:
        raise FileFormatError(
            f"{file}: ids must differ; there more than once: "
            f"{_listed([str(name) for name in ids[counts > 1][:20]])}"
        )
    return arrays["ids"], arrays["vectors"]


def _read_npy(file: Path) -> tuple[Any, Any]:
    vectors = load_array(file)
    if vectors.ndim != 2 or vectors.size == 0:
        raise FileFormatError(
            f"{file}: the array must have shape (n_vectors, n_numbers); found {vectors.shape}"
        )
    return range(len(vectors)), vectors


def _read_csv(file: Path) -> tuple[Any, Any]:
    vectors: dict[str, array[float]] = {}
    length = 0
    rows = csv.reader(io.StringIO(text_content(file), newline=""), strict=True)
    try:
        for row in rows:
            name, *fields = [field.strip() for field in row] or [""]
            where = f"{file}, line {rows.line_num}"
            if not any([name, *fields]) or (not vectors and name.lower() == "id"):
                continue
            if not name:
                raise FileFormatError(f"{where}: the id is missing")
            if name in vectors:
                raise FileFormatError(f"{where}: the id {name[:60]!r} is there already")
            if not fields or (vectors and len(fields) != length):
                expected = f"{length} expected" if vectors else "at least one expected"
                raise FileFormatError(f"{where}: {len(fields)} numbers found, {expected}")
            length = len(fields)
            vectors[name] = array("d", [_number(field, where) for field in fields])
    except csv.Error as error:
        raise FileFormatError(f"{file}, line {rows.line_num}: {error}") from error
    if not vectors:
        raise FileFormatError(f"{file} holds no vectors")
    return list(vectors), np.array(list(vectors.values()))


def _number(field: str, where: str) -> float:
    try:
        return real_field(field.encode())
    except ValueError as error:
        raise FileFormatError(f"{where}: {field[:60]!r} is not a number") from error
