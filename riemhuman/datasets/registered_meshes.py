"""Mesh files that share one triangulation, found in a folder and read together."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import overload

import numpy as np

from riemhuman.checks import one_of
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.progress import ProgressBar
from riemhuman.storage.file_content import file_path
from riemhuman.surfaces.mesh_arrays import face_difference
from riemhuman.surfaces.mesh_files import load_mesh
from riemhuman.surfaces.template import Template
from riemhuman.surfaces.upright import upright
from riemhuman.units import SCALES, refuse_other_scale

MESH_ENDINGS = (".ply", ".obj", ".off")


def find_meshes(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the mesh files of a folder in natural order: body_2 comes before body_10.

    Subfolders are not looked into, and hidden files are passed over.

    Parameters
    ----------
    folder : path_like
        The folder.

    Returns
    -------
    files : list of Path
        At least one.

    Raises
    ------
    FileError
        If there is no such folder, it cannot be read, or it holds no mesh file.
    ArgumentTypeError
        If `folder` is not a path.
    """
    root = existing_folder(folder)
    try:
        files = [
            file
            for file in root.iterdir()
            if file.suffix.lower() in MESH_ENDINGS and not file.name.startswith(".")
        ]
    except OSError as error:
        raise FileError(f"{root} cannot be read: {error.strerror}") from error
    if not files:
        raise FileError(f"{root} holds no mesh: no file there ends in {', '.join(MESH_ENDINGS)}")
    return sorted(files, key=lambda file: natural_key(file.name))


class RegisteredMeshes:
    """Registered surfaces in files, read on access and not kept.

    ``meshes[i]`` is a surface, shape (V, 3); ``meshes[i:j:k]`` are several, shape (n, V, 3).

    Parameters
    ----------
    files : sequence of path_like
        Mesh files (PLY, OBJ or OFF); at least one.
    reference : path_like, optional
        Mesh file whose number of vertices and triangles all must have; by default the first.
    scale : {"template"} or None
        Whether a mesh more than eight times as large or as small as the reference is refused,
        because it must be in another unit.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the files, brought to metres; by default their numbers are taken as they are.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up in the files, turned to y; by default they are not turned.

    Raises
    ------
    ArgumentError
        If there is no file.
    FileError
        If the reference is missing or cannot be read.
    FileFormatError
        If it is damaged.
    """

    def __init__(
        self,
        files: Sequence[str | os.PathLike[str]],
        reference: str | os.PathLike[str] | None = None,
        scale: str | None = "template",
        *,
        unit: str | None = None,
        up: str | None = None,
    ) -> None:
        self._scale = one_of(scale, "scale", SCALES)
        self._files = tuple(Path(file) for file in files)
        if not self._files:
            raise ArgumentError("files holds no mesh file; at least one is needed")
        self._reference = self._files[0] if reference is None else Path(reference)
        self._unit, self._up = unit, up
        vertices, self._faces = load_mesh(self._reference)
        self._vertices = upright(vertices, unit, up)

    @property
    def files(self) -> tuple[Path, ...]:
        """The files."""
        return self._files

    @property
    def faces(self) -> np.ndarray:
        """The triangles they share, shape (F, 3)."""
        return self._faces

    @property
    def reference(self) -> np.ndarray:
        """Vertices of the reference, shape (V, 3)."""
        return self._vertices

    def __len__(self) -> int:
        return len(self._files)

    @overload
    def __getitem__(self, index: int) -> np.ndarray: ...
    @overload
    def __getitem__(self, index: slice) -> np.ndarray: ...
    def __getitem__(self, index: int | slice) -> np.ndarray:
        if isinstance(index, slice):
            files = self._files[index]
            surfaces = np.empty((len(files), *self._vertices.shape))
            for number, file in enumerate(files):
                surfaces[number] = self._read(file)
            return surfaces
        return self._read(self._files[index])

    def _read(self, file: Path) -> np.ndarray:
        vertices, faces = load_mesh(file)
        vertices = upright(vertices, self._unit, self._up)
        if vertices.shape != self._vertices.shape:
            raise FileFormatError(
                f"{file} is not registered to {self._reference}: it has {len(vertices)} vertices, "
                f"that one has {len(self._vertices)}"
            )
        difference = face_difference(faces, self._faces)
        if difference:
            raise FileFormatError(f"{file} is not registered to {self._reference}: {difference}")
        if self._scale is not None:
            names = str(file), str(self._reference)
            refuse_other_scale(vertices, self._vertices, *names, error=FileFormatError)
        return vertices


def load_registered(
    files: Sequence[str | os.PathLike[str]],
    reference: str | os.PathLike[str] | None = None,
    *,
    scale: str | None = "template",
    unit: str | None = None,
    up: str | None = None,
    progress: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Read meshes that share one triangulation.

    Parameters
    ----------
    files : sequence of path_like
        Mesh files (PLY, OBJ or OFF); at least one.
    reference : path_like, optional
        Mesh file whose number of vertices and triangles all must have; by default the first.
    scale : {"template"} or None
        Whether a mesh more than eight times as large or as small as the reference is refused,
        because it must be in another unit.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the files, brought to metres; by default their numbers are taken as they are.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up in the files, turned to y; by default they are not turned.
    progress : bool
        Whether to show a progress bar over files.

    Returns
    -------
    points : array, shape (n, V, 3)
        Vertices of every mesh.
    faces : array of int, shape (F, 3)
        The triangles they share.

    Raises
    ------
    ArgumentError
        If there is no file.
    FileError
        If a file is missing or cannot be read.
    FileFormatError
        If a file is damaged, or has other triangles, another number of vertices or another unit of
        length than the reference: it is named, and what differs.
    """
    meshes = RegisteredMeshes(files, reference, scale, unit=unit, up=up)
    if not progress:
        return meshes[:], meshes.faces
    numbers = ProgressBar(range(len(meshes)), desc="Meshes", unit="mesh")
    return np.stack([meshes[number] for number in numbers]), meshes.faces


def read_template(
    template: Template | str | os.PathLike[str] | None,
    first_mesh: str | os.PathLike[str],
    *,
    unit: str | None = None,
    up: str | None = None,
) -> Template:
    """Return the given template, or else the first mesh.

    A template is a body. The mean of the vertices is none where poses differ: its arms shrink, and
    their triangles lose their weight in every integral over the template. Unlike a medoid, the
    first body costs nothing however many there are, and stays the same when more are added.

    Parameters
    ----------
    template : Template or path_like or None
        The template, a mesh file with it, or none.
    first_mesh : path_like
        The file of the first mesh.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of a file, brought to metres; by default its numbers are taken as they are.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up in a file, turned to y; by default it is not turned.

    Raises
    ------
    FileError
        If the file cannot be read.
    FileFormatError
        If it is damaged.
    DegenerateSurfaceError
        If a triangle of the template has no area.
    """
    if isinstance(template, Template):
        return template
    file = first_mesh if template is None else template
    read = Template.from_file(file)
    return Template(upright(read.vertices, unit, up), read.faces) if unit or up else read


def check_template(
    template: Template, points: np.ndarray, faces: np.ndarray, scale: str | None = "template"
) -> None:
    """Refuse a template that meshes are not registered to.

    Parameters
    ----------
    template : Template
        The template.
    points : array, shape (n, V, 3)
        Vertices of the meshes.
    faces : array of int, shape (F, 3)
        Their triangles.
    scale : {"template"} or None
        Whether meshes more than eight times as large or as small are refused.

    Raises
    ------
    ArgumentError
        If the template has other triangles, another number of vertices or another unit.
    """
    if template.n_vertices != points.shape[1]:
        raise ArgumentError(
            f"template has {template.n_vertices} vertices; the meshes have {points.shape[1]}"
        )
    difference = face_difference(template.faces, faces)
    if difference:
        raise ArgumentError(f"template must have the triangles of the meshes: {difference}")
    if scale is not None:
        refuse_other_scale(points, template.vertices, "the mesh", "the template")


def existing_folder(folder: str | os.PathLike[str]) -> Path:
    """Return the path of a folder after checking that it is one.

    Parameters
    ----------
    folder : path_like
        The folder; ``~`` stands for the user's home.

    Raises
    ------
    FileError
        If there is no such folder.
    ArgumentTypeError
        If `folder` is not a path.
    """
    root = file_path(folder, "folder", "folder")
    if not root.is_dir():
        raise FileError(
            f"{root} is a file, not a folder" if root.exists() else f"there is no folder {root}"
        )
    return root


def natural_key(name: str) -> tuple[object, ...]:
    """Return a sorting key by which numbers within names count as numbers.

    Parameters
    ----------
    name : str
        A name.
    """
    # Splitting at the digits alternates text and numbers, so that like is compared with like.
    texts = re.split(r"[0-9]+", name.casefold())
    digits = [found.lstrip("0") for found in re.findall(r"[0-9]+", name)]
    # Of two numbers the one with more digits is larger; Python reads no number of thousands.
    numbers = [(len(found), found) for found in digits]
    return (*itertools.chain(*itertools.zip_longest(texts, numbers, fillvalue=(-1, ""))),), name
