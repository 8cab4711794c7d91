"""Labelled meshes that are not registered, such as SHREC'14: a folder with a class file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from riemhuman.checks import real_number
from riemhuman.datasets.registered_meshes import (
    MESH_ENDINGS,
    existing_folder,
    is_visible,
    natural_key,
    preferred_formats,
)
from riemhuman.errors import FileError, FileFormatError, RiemhumanError
from riemhuman.io.files import file_path, read_text
from riemhuman.io.meshes import load_mesh
from riemhuman.representation import Record, join_names


@dataclass(frozen=True, eq=False, repr=False)
class LabelledMeshes(Record):
    r"""Labelled meshes, read from their files on access.

    ``meshes[i]`` is a pair: vertices, shape (V, 3), and faces, shape (F, 3).

    Attributes
    ----------
    files : tuple of Path
        Mesh files.
    ids : tuple of str
        Name of each mesh in the class file.
    subject : array of int, shape (n,)
        Class of each mesh, an index into `subject_names`.
    subject_names : tuple of str
        Names of the classes.
    scale : float
        Factor from the files' unit to metres.
    missing : tuple of str
        Ids of the class file that have no mesh file.
    unlisted : tuple of str
        Names of mesh files that the class file does not list.

    Examples
    --------
    >>> import os
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> os.mkdir("scans")
    >>> for number in (0, 1):
    ...     rh.save_mesh(f"scans/{number}.off", bodies[number], bodies.template.faces)
    >>> with open("scans/test.cla", "w") as file:
    ...     print("PSB 1\n1 2\n\nanna 0 2\n0\n1", file=file)
    >>> rh.datasets.load_shrec14("scans").ids
    ('0', '1')
    """

    files: tuple[Path, ...]
    ids: tuple[str, ...]
    subject: np.ndarray
    subject_names: tuple[str, ...]
    scale: float
    missing: tuple[str, ...]
    unlisted: tuple[str, ...]

    def __len__(self) -> int:
        """Return the number of meshes."""
        return len(self.files)

    def __getitem__(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        vertices, faces = load_mesh(self.files[index])
        return self.scale * vertices, faces

    def __iter__(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        return (self[index] for index in range(len(self)))

    def problems(self) -> dict[str, str]:
        """Read every file, and return the errors of those that cannot be read.

        Returns
        -------
        dict of str to str
            Error messages by id.
        """
        messages = {}
        for index, name in enumerate(self.ids):
            try:
                self[index]
            except RiemhumanError as error:
                messages[name] = str(error)
        return messages


def load_shrec14(
    folder: str | os.PathLike[str],
    classes: str | os.PathLike[str] | None = None,
    *,
    scale: float = 1.0,
    allow_missing: bool = False,
) -> LabelledMeshes:
    r"""Find the meshes of a SHREC'14 human data set, labelled by a class file.

    The data sets are not part of this library [1]_. Their meshes are not registered to each other,
    so only descriptors that need no template apply to them.

    Parameters
    ----------
    folder : path_like
        The folder of the mesh files (``.ply``, ``.obj`` or ``.off``), or one above it. Of a mesh in
        several formats, the first of these is read.
    classes : path_like, optional
        The class file, in the format of the Princeton Shape Benchmark [2]_. By default the only
        file in the folder, or below it, that ends in ``.cla``. Its ids are names of mesh files,
        with or without suffix. An id that is a number may also stand for the file whose name has
        this number as its last.
    scale : float
        Factor from the files' unit to metres.
    allow_missing : bool
        Whether to leave out meshes that the class file lists and the folder lacks.

    Returns
    -------
    LabelledMeshes
        In the order of the class file; no mesh file has been read yet.

    Raises
    ------
    FileError
        If the folder does not exist, has no meshes, not exactly one class file, or lacks meshes
        that the class file lists.
    FileFormatError
        If the class file is damaged, with its line, or an id matches several meshes.

    References
    ----------
    .. [1] Pickup et al., "SHREC'14 Track: Shape Retrieval of Non-Rigid 3D Human Models",
       Eurographics Workshop on 3D Object Retrieval, 2014.
    .. [2] Shilane, Min, Kazhdan, Funkhouser, "The Princeton Shape Benchmark", SMI 2004.

    Examples
    --------
    >>> import os
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> os.mkdir("scans")
    >>> for number in (0, 1):
    ...     rh.save_mesh(f"scans/{number}.off", bodies[number], bodies.template.faces)
    >>> with open("scans/test.cla", "w") as file:
    ...     print("PSB 1\n1 2\n\nanna 0 2\n0\n1", file=file)
    >>> rh.datasets.load_shrec14("scans").ids
    ('0', '1')
    """
    root = existing_folder(folder)
    scale = real_number(scale, "scale", minimum=0.0, strict=True)
    class_file = _find_class_file(root) if classes is None else file_path(classes, "classes")
    members = read_classes(class_file)
    files = _find_meshes(root)
    by_name: dict[str, list[str]] = {}
    for key in files:
        for name in _names_of(key):
            by_name.setdefault(name, []).append(key)
    ids = [name for each in members.values() for name in each]
    labels = [number for number, each in enumerate(members.values()) for _ in each]
    keys = [_key_of(name, by_name, class_file) for name in ids]
    missing = tuple(name for name, key in zip(ids, keys, strict=True) if key is None)
    if missing and (not allow_missing or len(missing) == len(ids)):
        remedy = "" if len(missing) == len(ids) else "; allow_missing=True goes on with the others"
        raise FileError(
            f"{root} lacks {len(missing)} of the {len(ids)} meshes that {class_file} lists: "
            f"{join_names(missing, 20)}{remedy}"
        )
    present = [number for number, key in enumerate(keys) if key is not None]
    return LabelledMeshes(
        files=tuple(files[key] for key in keys if key is not None),
        ids=tuple(ids[number] for number in present),
        subject=np.array([labels[number] for number in present], dtype=np.int64),
        subject_names=tuple(members),
        scale=scale,
        missing=missing,
        unlisted=tuple(files[key].name for key in files if key not in set(keys)),
    )


def read_classes(path: str | os.PathLike[str]) -> dict[str, tuple[str, ...]]:
    """Return the ids of meshes by class, from a class file of the Princeton Shape Benchmark.

    Its first words are ``PSB 1`` and the numbers of classes and of meshes. The classes follow, each
    with its name, the name of its parent class or 0, the number of its meshes, and their ids. Line
    breaks have no meaning. Classes without meshes are left out.
    """
    words = _Words(file_path(path, "classes"))
    if words.next("the word PSB").upper() != "PSB":
        raise words.error("a class file begins with PSB")
    words.next("the version")
    n_classes = words.next_count("the number of classes")
    n_meshes = words.next_count("the number of meshes")
    members: dict[str, tuple[str, ...]] = {}
    known_ids: set[str] = set()
    for number in range(n_classes):
        name = words.next(f"the name of class {number + 1} of {n_classes}")
        if name in members:
            raise words.error("this class is there already")
        label = name[:60]
        parent = words.next(f"the parent of class {label}")
        if parent not in ("0", "-1") and parent not in members:
            raise words.error(f"the parent of class {label} must be 0 or a class defined before")
        ids = []
        for _ in range(words.next_count(f"the number of meshes of class {label}")):
            ids.append(words.next(f"the id of a mesh of class {label}"))
            if ids[-1] in known_ids:
                raise words.error("this mesh is in a class already")
            known_ids.add(ids[-1])
        members[name] = tuple(ids)
    if words.next():
        raise words.error("the file has more words than its header declares")
    if len(known_ids) != n_meshes:
        raise FileFormatError(
            f"{path}: {len(known_ids)} meshes found in classes, the header declares {n_meshes}"
        )
    return {name: ids for name, ids in members.items() if ids}


class _Words:
    """The words of a text file, one after the other, with their lines."""

    def __init__(self, file: Path) -> None:
        self._file = file
        self._matches = re.finditer(r"\r\n|\r|\n|[^ \t\r\n\v\f]+", read_text(file))
        self._line = 1
        self._word = ""

    def next(self, meaning: str = "") -> str:
        """Return the next word; at the end, "" or an error that names what was expected."""
        line = self._line
        self._word = ""
        for match in self._matches:
            if match[0] not in ("\r\n", "\r", "\n"):
                self._line, self._word = line, match[0]
                return self._word
            line += 1
        if meaning:
            raise FileFormatError(
                f"{self._file}, line {self._line}: the file ends where {meaning} was expected"
            )
        return ""

    def next_count(self, meaning: str) -> int:
        """Return the next word as a number."""
        word = self.next(meaning)
        if not re.fullmatch(r"[0-9]{1,9}", word):
            raise self.error(f"{meaning} was expected")
        return int(word)

    def error(self, reason: str) -> FileFormatError:
        """Return an error about the last word."""
        return FileFormatError(
            f"{self._file}, line {self._line}: {self._word[:60]!r} found; {reason}"
        )


def _find_class_file(root: Path) -> Path:
    files = sorted(file for file in root.rglob("*") if is_visible(file, (".cla",)))
    if not files:
        raise FileError(
            f"{root} holds no class file: no file there ends in .cla; name it, classes="
        )
    if len(files) > 1:
        several = ", ".join(str(file.relative_to(root)) for file in files)
        raise FileError(f"{root} holds {len(files)} class files: {several}; choose one, classes=")
    return files[0]


def _find_meshes(root: Path) -> dict[str, Path]:
    """Return mesh files by their path without suffix, in natural order."""
    files = preferred_formats(
        (str(file.relative_to(root).with_suffix("")), file)
        for file in root.rglob("*")
        if is_visible(file, MESH_ENDINGS) and file.is_file()
    )
    if not files:
        raise FileError(f"{root} holds no mesh: no file there ends in {', '.join(MESH_ENDINGS)}")
    return {key: files[key] for key in sorted(files, key=natural_key)}


def _names_of(key: str) -> set[str]:
    """Return the name of a mesh file and its last number, by which class files may name it."""
    stem = Path(key).name
    numbers = re.findall(r"[0-9]+", stem)
    return {stem, _as_number(numbers[-1])} if numbers else {stem}


def _key_of(name: str, by_name: Mapping[str, list[str]], class_file: Path) -> str | None:
    """Return the key of an id's mesh file, if there is one."""
    stem = Path(name).stem if Path(name).suffix.lower() in MESH_ENDINGS else Path(name).name
    keys = by_name.get(stem, [])
    if not keys and re.fullmatch(r"[0-9]+", stem):
        keys = by_name.get(_as_number(stem), [])
    if len(keys) > 1:
        raise FileFormatError(
            f"{class_file}: the id {name[:60]} fits several meshes, "
            f"{', '.join(sorted(keys))}; keep one"
        )
    return keys[0] if keys else None


def _as_number(digits: str) -> str:
    """Return a number as a key that differs from all names of files."""
    return f"/{digits.lstrip('0')}"
