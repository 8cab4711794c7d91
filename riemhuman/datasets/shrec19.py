"""SHREC'19, "different connectivity": meshes of people and the matches between them."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Integers, Triangles
from riemhuman.datasets.registered_meshes import existing_folder
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.io.files import check_file, format_errors, natural_key, read_text, visible_files
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.representation import Record

_STRUCTURE = "Shape_df"
_FIELDS = ("VERT", "TRIV", "smpl_matches")


@dataclass(frozen=True, eq=False)
class MatchedMesh:
    """A mesh, and the positions of a template's vertices on it.

    Attributes
    ----------
    vertices : array, shape (V, 3)
    faces : array of int, shape (F, 3)
    places : array of int, shape (6890,)
        For each vertex of SMPL's template, the matching vertex of the mesh.

    Examples
    --------
    >>> mesh = rh.datasets.load_shrec19("SHREC19")[0]  # doctest: +SKIP
    >>> mesh.places.shape  # doctest: +SKIP
    (6890,)
    """

    vertices: Array
    faces: Triangles
    places: Array


@dataclass(frozen=True, eq=False, repr=False)
class MatchedMeshes(Record):
    """Meshes and matches between them, read from their files on access.

    ``meshes[i]`` is a `MatchedMesh`.

    Attributes
    ----------
    files : tuple of Path
        In the order of their numbers.
    names : tuple of str
        Numbers of the meshes, as in the names of their files.
    pairs : array of int, shape (P, 2)
        The pairs of the benchmark: two indices into `files`.
    match_files : dict of (str, str) to Path
        Files of matches between two meshes, by the names of the meshes.

    Examples
    --------
    >>> meshes = rh.datasets.load_shrec19("SHREC19")  # doctest: +SKIP
    >>> len(meshes), meshes.pairs.shape  # doctest: +SKIP
    (44, (430, 2))
    """

    files: tuple[Path, ...]
    names: tuple[str, ...]
    pairs: Integers
    match_files: dict[tuple[str, str], Path]

    def __len__(self) -> int:
        """Return the number of meshes."""
        return len(self.files)

    def __getitem__(self, index: int) -> MatchedMesh:
        return _read_mesh(self.files[index])

    def matches(self, first: int, second: int) -> Array:
        """Return the matching vertex of another mesh for every vertex of one mesh, shape (V,).

        Parameters
        ----------
        first, second : int
            Indices of the meshes.

        Raises
        ------
        FileError
            If there is no file of these matches.
        """
        names = self.names[first], self.names[second]
        file = self.match_files.get(names)
        if file is None:
            raise FileError(f"there are no matches between the meshes {names[0]} and {names[1]}")
        with format_errors(file, "a table of matches"):
            numbers = _whole_numbers(read_text(file).split(), "matches")
            expected = len(self[first].vertices)
            if len(numbers) != expected:
                raise FileFormatError(
                    f"it holds {len(numbers)} matches; the mesh {names[0]} has {expected} vertices"
                )
            return _from_zero(numbers, len(self[second].vertices), "matches")


def load_shrec19(folder: str | os.PathLike[str]) -> MatchedMeshes:
    """Find the meshes and matches of SHREC'19, humans with different connectivity.

    The data set is not part of this library [1]_. It has files ``mat/N.mat`` with a structure
    ``Shape_df`` of VERT, TRIV and smpl_matches, a list of pairs
    ``PAIRS_list_SHREC19_connectivity.txt``, and files ``i_j.txt`` of matches; numbers in them count
    from 1, those of this library from 0.

    Parameters
    ----------
    folder : path_like
        The folder of the data set, or one above it.

    Raises
    ------
    FileError
        If there are no meshes, or if the list of pairs names one that does not exist.
    FileFormatError
        If a file does not have the expected contents.

    References
    ----------
    .. [1] Melzi, Marin, Rodola, Castellani, Ren, Poulenard, Wonka, Ovsjanikov, "SHREC 2019:
       Matching Humans with Different Connectivity", 3DOR 2019.

    Examples
    --------
    >>> meshes = rh.datasets.load_shrec19("SHREC19")  # doctest: +SKIP
    >>> mesh, other = meshes[0], meshes[1]  # doctest: +SKIP
    """
    root = existing_folder(folder)
    matlab_files = visible_files(root, ".mat", deep=True)
    meshes = [file for file in matlab_files if re.fullmatch(r"[0-9]+", file.stem)]
    files = sorted(meshes, key=lambda file: natural_key(file.name))
    if not files:
        raise FileError(f"{root} holds no meshes of SHREC'19: no file has a name such as 1.mat")
    names = tuple(file.stem for file in files)
    match_files: dict[tuple[str, str], Path] = {}
    for file in visible_files(root, ".txt", deep=True):
        pair = re.fullmatch(r"([0-9]+)_([0-9]+)", file.stem)
        if pair:
            match_files[pair[1], pair[2]] = file
    return MatchedMeshes(tuple(files), names, _read_pairs(root, names), match_files)


def _read_pairs(root: Path, names: Sequence[str]) -> Integers:
    """Return the pairs of the list in a folder as indices of meshes."""
    texts = visible_files(root, ".txt", deep=True)
    lists = [file for file in texts if file.name.startswith("PAIRS_list")]
    if len(lists) != 1:
        what = "no list of pairs" if not lists else f"{len(lists)} lists of pairs"
        raise FileError(
            f"{root} holds {what}; expected one file PAIRS_list_SHREC19_connectivity.txt"
        )
    file = lists[0]
    pairs = []
    for number, line in enumerate(read_text(file).splitlines(), 1):
        words = re.findall(r"[^\s,;_]+", line)
        if not words:
            continue
        if len(words) != 2 or not all(re.fullmatch(r"[0-9]+", word) for word in words):
            raise FileFormatError(
                f"{file}, line {number}: two numbers expected; found {line[:60]!r}"
            )
        missing = [word for word in words if word not in names]
        if missing:
            raise FileError(f"{file}, line {number}: there is no mesh {missing[0]}.mat")
        pairs.append([names.index(word) for word in words])
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def _read_mesh(file: Path) -> MatchedMesh:
    """Read one mesh; other variables in the file, such as graphs, are ignored."""
    from scipy.io import loadmat

    check_file(file)
    with format_errors(file, "a MATLAB file of version 7 or older"):
        variables = loadmat(file, variable_names=[_STRUCTURE], squeeze_me=True)
        if _STRUCTURE not in variables:
            raise FileFormatError(f"it holds no structure {_STRUCTURE}")
        structure = np.asarray(variables[_STRUCTURE])
        fields = getattr(structure.dtype, "names", None) or ()
        missing = [name for name in _FIELDS if name not in fields]
        if missing or structure.shape:
            raise FileFormatError(
                f"{_STRUCTURE} must be one structure with {', '.join(_FIELDS)}; found "
                f"{', '.join(fields) or structure.dtype}"
            )
        vertices, corners, places = (structure[name].item() for name in _FIELDS)
        triangles = np.atleast_2d(_whole_numbers(corners, "TRIV"))
        corners = _from_zero(triangles, len(vertices), "TRIV")
        points, faces = check_mesh(vertices, corners)
        places = np.ravel(_whole_numbers(places, "smpl_matches"))
        return MatchedMesh(points, faces, _from_zero(places, len(points), "smpl_matches"))


def _whole_numbers(values: ArrayLike, name: str) -> Array:
    """Return whole numbers, which MATLAB stores as floating point."""
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ArgumentError(f"{name} must hold numbers: {error}") from error
    if not np.all(np.isfinite(numbers) & (numbers == np.round(numbers))):
        raise ArgumentError(f"{name} must hold whole numbers")
    return numbers.astype(np.int64)


def _from_zero(numbers: Array, count: int, name: str) -> Array:
    """Return vertex numbers that count from 1 as ones that count from 0."""
    if numbers.size and not (numbers.min() >= 1 and numbers.max() <= count):
        raise ArgumentError(
            f"{name} must hold vertex numbers from 1 to {count}; found {numbers.min()} to "
            f"{numbers.max()}"
        )
    return numbers - 1
