"""Labelled meshes that are not registered, such as SHREC'14: a folder with a class file."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from riemhuman.checks import real_number
from riemhuman.datasets.registered_meshes import MESH_ENDINGS, existing_folder, natural_key
from riemhuman.errors import FileError, FileFormatError, RiemhumanError
from riemhuman.io.files import file_path
from riemhuman.io.meshes import load_mesh
from riemhuman.io.text_tables import read_text
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
        found = {}
        for index, name in enumerate(self.ids):
            try:
                self[index]
            except RiemhumanError as error:
                found[name] = str(error)
        return found


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
    ArgumentTypeError
        If a path argument is not a path.
    ArgumentError
        If the scale is not a positive number.
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
    names, files = _find_meshes(root)
    ids = [name for each in members.values() for name in each]
    found = {name: _file_of(name, names, class_file) for name in ids}
    missing = tuple(name for name in ids if found[name] is None)
    if missing and (not allow_missing or len(missing) == len(ids)):
        names_missing = join_names(missing, 20)
        rest = "" if len(missing) == len(ids) else "; allow_missing=True goes on with the others"
        raise FileError(
            f"{root} lacks {len(missing)} of the {len(ids)} meshes that {class_file} lists: "
            f"{names_missing}{rest}"
        )
    subjects = [number for number, each in enumerate(members.values()) for _ in each]
    kept = [(name, label) for name, label in zip(ids, subjects, strict=True) if found[name]]
    used = {found[name] for name, _ in kept}
    return LabelledMeshes(
        files=tuple(files[str(found[name])] for name, _ in kept),
        ids=tuple(name for name, _ in kept),
        subject=np.array([label for _, label in kept], dtype=np.int64),
        subject_names=tuple(members),
        scale=scale,
        missing=missing,
        unlisted=tuple(files[name].name for name in files if name not in used),
    )


def read_classes(path: str | os.PathLike[str]) -> dict[str, tuple[str, ...]]:
    """Read a class file of the Princeton Shape Benchmark."""
    file = file_path(path, "classes")
    words = _Words(file, read_text(file))
    if words.next("the word PSB").upper() != "PSB":
        words.refuse("a class file begins with PSB")
    words.next("the version")
    n_classes = words.next_count("the number of classes")
    n_meshes = words.next_count("the number of meshes")
    members: dict[str, tuple[str, ...]] = {}
    seen: set[str] = set()
    for number in range(n_classes):
        name = words.next(f"the name of class {number + 1} of {n_classes}")
        if name in members:
            words.refuse("this class is there already")
        label = name[:60]
        parent = words.next(f"the parent of class {label}")
        if parent not in ("0", "-1") and parent not in members:
            words.refuse(f"the parent of class {label} must be 0 or a class defined before")
        ids = []
        for _ in range(words.next_count(f"the number of meshes of class {label}")):
            ids.append(words.next(f"the id of a mesh of class {label}"))
            if ids[-1] in seen:
                words.refuse("this mesh is in a class already")
            seen.add(ids[-1])
        members[name] = tuple(ids)
    words.refuse_more()
    if len(seen) != n_meshes:
        raise FileFormatError(
            f"{file}: {len(seen)} meshes found in classes, the header declares {n_meshes}"
        )
    return {name: ids for name, ids in members.items() if ids}


class _Words:
    """The words of a text with their lines."""

    def __init__(self, file: Path, text: str) -> None:
        self._file = file
        self._matches = re.finditer(r"\r\n|\r|\n|[^ \t\r\n\v\f]+", text)
        self._line = 1
        self._word = ""

    def next(self, meaning: str) -> str:
        self._word = self._following()
        if not self._word:
            raise FileFormatError(
                f"{self._file}, line {self._line}: the file ends where {meaning} was expected"
            )
        return self._word

    def next_count(self, meaning: str) -> int:
        word = self.next(meaning)
        if not re.fullmatch(r"[0-9]{1,9}", word):
            self.refuse(f"{meaning} was expected")
        return int(word)

    def refuse(self, reason: str) -> None:
        raise FileFormatError(
            f"{self._file}, line {self._line}: {self._word[:60]!r} found; {reason}"
        )

    def refuse_more(self) -> None:
        self._word = self._following()
        if self._word:
            self.refuse("the file has more words than its header declares")

    def _following(self) -> str:
        """Return the next word, empty at the end, and count the line ends before it."""
        line = self._line
        for match in self._matches:
            if match[0] not in ("\r\n", "\r", "\n"):
                self._line = line
                return match[0]
            line += 1
        return ""


def _find_class_file(root: Path) -> Path:
    found = sorted(file for file in root.rglob("*") if _is_visible(file, (".cla",)))
    if not found:
        raise FileError(
            f"{root} holds no class file: no file there ends in .cla; name it, classes="
        )
    if len(found) > 1:
        several = ", ".join(str(file.relative_to(root)) for file in found)
        raise FileError(f"{root} holds {len(found)} class files: {several}; choose one, classes=")
    return found[0]


def _find_meshes(root: Path) -> tuple[dict[str, list[str]], dict[str, Path]]:
    """Return keys of mesh files by name and last number, and files by key, the path but suffix."""
    files: dict[str, Path] = {}
    for file in root.rglob("*"):
        if _is_visible(file, MESH_ENDINGS):
            key = str(file.relative_to(root).with_suffix(""))
            files[key] = min(files.get(key, file), file, key=_preference)
    if not files:
        raise FileError(f"{root} holds no mesh: no file there ends in {', '.join(MESH_ENDINGS)}")
    files = {key: files[key] for key in sorted(files, key=natural_key)}
    names: dict[str, list[str]] = {}
    for key in files:
        stem = Path(key).name
        numbers = re.findall(r"[0-9]+", stem)
        for name in {stem, _number(numbers[-1])} if numbers else {stem}:
            names.setdefault(name, []).append(key)
    return names, files


def _file_of(name: str, names: Mapping[str, list[str]], class_file: Path) -> str | None:
    """Return the key of an id's mesh file, if there is one."""
    stem = Path(name).stem if Path(name).suffix.lower() in MESH_ENDINGS else Path(name).name
    keys = names.get(stem, [])
    if not keys and re.fullmatch(r"[0-9]+", stem):
        keys = names.get(_number(stem), [])
    if len(keys) > 1:
        raise FileFormatError(
            f"{class_file}: the id {name[:60]} fits several meshes, "
            f"{', '.join(sorted(keys))}; keep one"
        )
    return keys[0] if keys else None


def _number(digits: str) -> str:
    """Return a number as a key that differs from all names of files."""
    return f"/{digits.lstrip('0')}"


def _is_visible(file: Path, endings: tuple[str, ...]) -> bool:
    return file.suffix.lower() in endings and not file.name.startswith(".") and file.is_file()


def _preference(file: Path) -> tuple[int, str]:
    return MESH_ENDINGS.index(file.suffix.lower()), file.name
