"""Labelled meshes that are not registered, such as SHREC'14: a folder with a class file."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from riemhuman.arrays import Array, Integers, Triangles
from riemhuman.checks import checked, positive
from riemhuman.datasets.registered_meshes import (
    MESH_ENDINGS,
    existing_folder,
    in_one_format,
    no_meshes,
)
from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.files import file_path, format_errors, read_text, short_message, visible_files
from riemhuman.io.label_tables import without_ending
from riemhuman.io.meshes import load_mesh
from riemhuman.representation import Record, join_names


@dataclass(frozen=True, eq=False, repr=False)
class LabelledMeshes(Record):
    """Labelled meshes, read from their files on access.

    ``meshes[i]`` is a pair: vertices, shape (V, 3), and faces, shape (F, 3).

    Attributes
    ----------
    files : tuple of Path
    ids : tuple of str
        Name of each mesh in the class file.
    subject : array of int, shape (n,)
        Class of each mesh, an index into `subject_names`.
    subject_names : tuple of str
    scale : float
        Factor from the files' unit to metres.

    Examples
    --------
    >>> vertices, faces = rh.datasets.load_shrec14("SHREC14/Real")[0]  # doctest: +SKIP
    """

    files: tuple[Path, ...]
    ids: tuple[str, ...]
    subject: Integers
    subject_names: tuple[str, ...]
    scale: float

    def __len__(self) -> int:
        """Return the number of meshes."""
        return len(self.files)

    def __getitem__(self, index: int) -> tuple[Array, Triangles]:
        vertices, faces = load_mesh(self.files[index])
        return self.scale * vertices, faces


@checked(scale=positive)
def load_shrec14(
    folder: str | os.PathLike[str],
    classes: str | os.PathLike[str] | None = None,
    *,
    scale: float = 1.0,
) -> LabelledMeshes:
    r"""Find the meshes of a SHREC'14 human data set, labelled by a class file.

    The data sets are not part of this library [1]_. Their meshes are not registered to each other,
    so only descriptors that need no template apply to them.

    Parameters
    ----------
    folder : path_like
        The folder of the mesh files, or one above it.
    classes : path_like, optional
        The class file, in the format of the Princeton Shape Benchmark [2]_. By default the only
        file in the folder, or below it, that ends in ``.cla``. Its ids are names of mesh files,
        with or without suffix.
    scale : float
        Factor from the files' unit to metres.

    References
    ----------
    .. [1] Pickup et al., "SHREC'14 Track: Shape Retrieval of Non-Rigid 3D Human Models",
       Eurographics Workshop on 3D Object Retrieval, 2014.
    .. [2] Shilane, Min, Kazhdan, Funkhouser, "The Princeton Shape Benchmark", SMI 2004.

    Examples
    --------
    >>> template = rh.datasets.load_open_model("coarse").template
    >>> rh.save_mesh("0.off", template.vertices, template.faces)
    >>> with open("test.cla", "w") as file:
    ...     print("PSB 1\n1 1\n\nanna 0 1\n0", file=file)
    >>> rh.datasets.load_shrec14(".").subject_names
    ('anna',)
    """
    root = existing_folder(folder)
    class_file = _find_class_file(root) if classes is None else file_path(classes, "classes")
    members = read_classes(class_file)
    by_name: dict[str, list[Path]] = {}
    for file in in_one_format(visible_files(root, *MESH_ENDINGS, deep=True)):
        by_name.setdefault(without_ending(file.name), []).append(file)
    if not by_name:
        raise no_meshes(root)
    subject: list[int] = []
    ids: list[str] = []
    files: list[Path] = []
    missing: list[str] = []
    for number, names in enumerate(members.values()):
        for name in names:
            matches = by_name.get(without_ending(Path(name).name), [])
            if len(matches) > 1:
                several = ", ".join(str(file.relative_to(root).with_suffix("")) for file in matches)
                raise FileFormatError(
                    f"{class_file}: the id {name[:60]} matches several meshes, {several}; keep one"
                )
            if matches:
                subject.append(number)
                ids.append(name)
                files += matches
            else:
                missing.append(name)
    if missing:
        raise FileError(
            f"{root} lacks {len(missing)} of the {len(missing) + len(files)} meshes that "
            f"{class_file} lists: {join_names(missing, 20)}"
        )
    return LabelledMeshes(
        tuple(files), tuple(ids), np.array(subject, dtype=np.int64), tuple(members), scale
    )


def read_classes(path: str | os.PathLike[str]) -> dict[str, tuple[str, ...]]:
    """Return the ids of meshes by class, from a class file of the Princeton Shape Benchmark."""
    file = file_path(path, "classes")
    words = iter(re.findall(r"[^ \t\v\f\r\n]+", read_text(file)))
    members: dict[str, tuple[str, ...]] = {}
    where = "its header"
    with format_errors(file, "a class file"):
        if next(words, "").upper() != "PSB":
            raise FileFormatError("it does not begin with PSB")
        try:
            next(words)  # the version
            n_classes = int(next(words))
            n_meshes = int(next(words))
            for number in range(n_classes):
                where = f"class {number + 1} of {n_classes}"
                name = next(words)
                next(words)  # its parent
                count = int(next(words))
                if name in members:
                    raise FileFormatError(f"{where} repeats the name {name[:60]!r}")
                members[name] = tuple(islice(words, count))
        except (StopIteration, ValueError) as error:
            raise FileFormatError(f"{where} is damaged: {short_message(error)}") from error
        ids = [model_id for names in members.values() for model_id in names]
        n_further = len(list(words))
        if n_further or not len(set(ids)) == len(ids) == n_meshes:
            raise FileFormatError(
                f"its header declares {n_meshes} different meshes; found {len(ids)}, "
                f"{len(set(ids))} of them different, and {n_further} further words"
            )
    return {name: names for name, names in members.items() if names}


def _find_class_file(root: Path) -> Path:
    files = visible_files(root, ".cla", deep=True)
    if not files:
        raise FileError(
            f"{root} holds no class file: no file there ends in .cla; pass its path as classes="
        )
    if len(files) > 1:
        several = ", ".join(str(file.relative_to(root)) for file in files)
        raise FileError(f"{root} holds {len(files)} class files: {several}; choose one, classes=")
    return files[0]
