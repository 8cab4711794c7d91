"""The registrations of Dynamic FAUST, read from HDF5 frame by frame."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.arrays import Array, Triangles
from riemhuman.checks import integer_array
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.io.files import check_file, file_path, format_errors
from riemhuman.io.kinds_of_files import BY_MAP, YES, FileKind, reads
from riemhuman.io.mesh_arrays import face_difference, read_only
from riemhuman.mocap.motions import Motion, Motions, choose_names
from riemhuman.mocap.skeleton_motion import nearest_frames
from riemhuman.optional import import_optional
from riemhuman.representation import join_names

if TYPE_CHECKING:
    import h5py

_FILES = ("registrations_m.hdf5", "registrations_f.hdf5")
_FACES = "faces"
_FRAMES_PER_SECOND = 60.0
# Largest number of neighbouring frames that are read together.
_SPAN = 64


class DynamicFaustMotion(Motion):
    """One sequence of Dynamic FAUST, whose frames are read on access."""

    def __init__(
        self,
        path: Path,
        subject: str,
        sequence: str,
        faces: Triangles,
        shape: tuple[int, ...],
        rate: float,
    ) -> None:
        self.path, self._key = path, f"{subject}_{sequence}"
        self._n_vertices = int(faces.max()) + 1
        if len(shape) != 3 or shape[:2] != (self._n_vertices, 3) or shape[2] == 0:
            raise FileFormatError(
                f"{self._key} of {path} must have shape ({self._n_vertices}, 3, n_frames) to "
                f"match its triangles; found {shape}"
            )
        self._numbers = nearest_frames(shape[2], _FRAMES_PER_SECOND, rate)
        super().__init__(subject, sequence, float(rate), len(self._numbers), faces)

    def _frames(self, numbers: range) -> Array:
        file_frames = self._numbers[np.asarray(numbers, dtype=np.int64)]
        stride = abs(numbers.step) * _FRAMES_PER_SECOND / self.frames_per_second
        run = max(1, int(_SPAN / stride))
        with _open(self.path) as file:
            frames = np.empty((len(file_frames), self._n_vertices, 3))
            for start in range(0, len(file_frames), run):
                some = file_frames[start : start + run]
                first, end = int(some.min()), int(some.max()) + 1
                block = file[self._key][:, :, first:end]
                frames[start : start + run] = np.moveaxis(block[:, :, some - first], -1, 0)
        finite = np.isfinite(frames).all(axis=(1, 2))
        if not finite.all():
            bad = [str(number) for number in file_frames[~finite]]
            raise FileFormatError(
                f"{self.path}: NaN or infinite coordinates in frames {join_names(bad)} of "
                f"{self._key}"
            )
        return frames


@reads(
    FileKind(
        "Dynamic FAUST",
        "datasets.load_dfaust",
        (".hdf5", ".h5"),
        registered=YES,
        measured=BY_MAP,
        is_motion=True,
        written=(".glb",),
    )
)
def load_dfaust(
    path: str | os.PathLike[str],
    subjects: Sequence[str | int] | str | int | None = None,
    sequences: Sequence[str] | str | None = None,
    frames_per_second: float = _FRAMES_PER_SECOND,
) -> Motions[DynamicFaustMotion]:
    """Load registered sequences of Dynamic FAUST [1]_; frames are read on access.

    All sequences of the first person come first, then those of the second, and so on. The data set
    is available from its authors. The reader needs the extra ``data``.

    Parameters
    ----------
    path : path_like
        A file, or the folder that contains ``registrations_m.hdf5``, ``registrations_f.hdf5`` or
        both.
    subjects : sequence of str or int, or one of them, optional
        People to load, such as 50002; by default all.
    sequences : sequence of str or str, optional
        Motions to load; by default all. Unless `subjects` are given, people who lack one of these
        motions are skipped for it.
    frames_per_second : float
        Frame rate, at most 60, that of the files: the frames nearest in time are used.

    References
    ----------
    .. [1] Bogo, Romero, Pons-Moll, Black, "Dynamic FAUST: Registering Human Bodies in Motion",
       CVPR 2017.

    Examples
    --------
    >>> import h5py
    >>> template = rh.datasets.load_open_model("coarse").template
    >>> with h5py.File("registrations_f.hdf5", "w") as file:
    ...     file["faces"] = template.faces
    ...     file["50004_knees"] = np.repeat(template.vertices[:, :, None], 4, axis=2)
    >>> rh.datasets.load_dfaust("registrations_f.hdf5")[0].n_frames
    4
    """
    root = file_path(path, kind="file or folder")
    files = [root]
    if root.is_dir():
        files = [root / name for name in _FILES if (root / name).is_file()]
    if not files:
        raise FileError(f"{root} holds neither {_FILES[0]} nor {_FILES[1]}")
    places = " and ".join(str(file) for file in files)
    recorded: dict[str, dict[str, Path]] = {}
    faces: Triangles | None = None
    for file in files:
        with _open(file) as contents:
            # h5py returns names that are not UTF-8 as bytes; no sequence has such a name.
            names = [name for name in contents if isinstance(name, str)]
            file_faces = _read_faces(contents, names, file)
        difference = None if faces is None else face_difference(file_faces, faces)
        if difference:
            raise FileFormatError(f"{file}: triangles must be those of {_FILES[0]}: {difference}")
        faces = file_faces
        for name in names:
            match = re.fullmatch(r"(\d+)_(\w+)", name)  # such as 50002_hips
            if match:
                subject, sequence = match.groups()
                recorded.setdefault(subject, {})[sequence] = file
    if faces is None or not recorded:
        raise FileFormatError(f"{places} holds no sequence, such as 50002_hips")
    performed = sorted(set().union(*recorded.values()))
    names = list(choose_names(sequences, "sequences", performed, f" in {places}"))
    people = choose_names(subjects, "subjects", tuple(recorded), f" in {places}")
    if sequences is not None and subjects is not None:
        missing = [
            f"{subject}_{sequence}"
            for subject in people
            for sequence in names
            if sequence not in recorded[subject]
        ]
        if missing:
            raise ArgumentError(
                f"sequences must exist for all requested subjects in {places}; missing: "
                f"{join_names(missing)}"
            )
    ranks = {name: rank for rank, name in enumerate(names)}
    performances = []
    for subject in people:
        # A file may hold as many people as sequences, each of one person.
        performed_names = sorted(ranks.keys() & recorded[subject].keys(), key=ranks.__getitem__)
        performances += [(recorded[subject][name], subject, name) for name in performed_names]
    return _motions(performances, faces, frames_per_second)


def _motions(
    performances: list[tuple[Path, str, str]], faces: Triangles, rate: float
) -> Motions[DynamicFaustMotion]:
    """Return motions in files, each of a subject and a sequence; open every file once."""
    keys: dict[Path, list[str]] = {}
    for file, subject, sequence in performances:
        keys.setdefault(file, []).append(f"{subject}_{sequence}")
    shapes = {file: _shapes(file, file_keys) for file, file_keys in keys.items()}
    return Motions(
        [
            DynamicFaustMotion(
                file, subject, sequence, faces, shapes[file][f"{subject}_{sequence}"], rate
            )
            for file, subject, sequence in performances
        ]
    )


def _shapes(file: Path, keys: Sequence[str]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of arrays of numbers in a file."""
    shapes = {}
    with _open(file) as contents:
        for key in keys:
            data = contents[key]
            if getattr(data, "dtype", np.dtype(object)).kind not in "fiu":
                raise FileFormatError(f"{key} of {file} does not hold numbers")
            shapes[key] = tuple(data.shape or ())
    return shapes


@contextmanager
def _open(path: Path) -> Iterator[h5py.File]:
    h5py = import_optional("h5py", "data")
    check_file(path)
    with format_errors(path, "an HDF5 file"), h5py.File(path, "r") as file:
        yield file


def _read_faces(contents: h5py.Group, names: Sequence[str], file: Path) -> Triangles:
    if _FACES not in names:
        raise FileFormatError(
            f"{file} holds no dataset {_FACES!r} of triangles; found "
            f"{join_names(sorted(names)) or 'nothing'}"
        )
    faces = integer_array(contents[_FACES], f"{_FACES} of {file}", ("n_faces", 3))
    if faces.min(initial=0) < 0 or not faces.size:
        raise FileFormatError(f"{_FACES} of {file} must be vertex indices, counted from 0")
    return read_only(faces)
