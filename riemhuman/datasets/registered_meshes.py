"""Mesh files of a folder that share one triangulation."""

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
from riemhuman.io.files import file_path
from riemhuman.io.mesh_arrays import face_difference
from riemhuman.io.meshes import load_mesh
from riemhuman.progress import ProgressBar
from riemhuman.surfaces.template import Template
from riemhuman.surfaces.upright import upright
from riemhuman.units import SCALES, check_same_scale

MESH_ENDINGS = (".ply", ".obj", ".off")


def find_meshes(folder: str | os.PathLike[str]) -> list[Path]:
    """Return the mesh files of a folder in natural order: body_2 comes before body_10.

    Subfolders and hidden files are ignored.

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
        If the folder does not exist, cannot be read, or has no mesh files.
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
    """Registered surfaces in files, which are read on access and not kept.

    ``meshes[i]`` is a surface, shape (V, 3); ``meshes[i:j:k]`` are several, shape (n, V, 3).

    Parameters
    ----------
    files : sequence of path_like
        Mesh files (PLY, OBJ or OFF); at least one.
    reference : path_like, optional
        Mesh file whose number of vertices and triangles all files must have; by default the first.
    scale : {"template"} or None
        With "template", a mesh more than eight times as large or as small as the reference is
        refused, because it is evidently in another unit.
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the files, converted to metres; by default coordinates are not scaled.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up in the files, rotated to y; by default meshes are not rotated.

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
        """The common triangles, shape (F, 3)."""
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
            check_same_scale(vertices, self._vertices, *names, error=FileFormatError)
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
    files, reference, scale, unit, up
        As for `RegisteredMeshes`.
    progress : bool
        Whether to show a progress bar over files.

    Returns
    -------
    points : array, shape (n, V, 3)
        Vertices of every mesh.
    faces : array of int, shape (F, 3)
        The common triangles.

    Raises
    ------
    ArgumentError
        If there is no file.
    FileError
        If a file is missing or cannot be read.
    FileFormatError
        If a file is damaged, or differs from the reference in its triangles, its number of vertices
        or evidently in its unit; the message names the file and the difference.
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
    """Return the given template, or the first mesh if none is given.

    A template must be a body. The mean of the vertices is not a body if poses differ: its arms
    shrink, and their triangles lose their weight in every integral over the template. Unlike a
    medoid, the first body needs no computation and stays the same when bodies are added.

    Parameters
    ----------
    template : Template or path_like or None
        The template, a mesh file with it, or None.
    first_mesh : path_like
        The file of the first mesh.
    unit, up
        Unit and vertical axis of a file, as for `RegisteredMeshes`.

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
    """Refuse a template to which meshes are not registered.

    Parameters
    ----------
    template : Template
        The template.
    points : array, shape (n, V, 3)
        Vertices of the meshes.
    faces : array of int, shape (F, 3)
        Their triangles.
    scale : {"template"} or None
        With "template", meshes more than eight times as large or as small are refused.

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
        check_same_scale(points, template.vertices, "the mesh", "the template")


def existing_folder(folder: str | os.PathLike[str]) -> Path:
    """Return the path of a folder after checking that it is one.

    Parameters
    ----------
    folder : path_like
        The folder; ``~`` stands for the user's home.

    Raises
    ------
    FileError
        If the folder does not exist.
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
    """Return a sorting key that compares numbers within names as numbers.

    Parameters
    ----------
    name : str
        A name.
    """
    # The key alternates text and numbers, so that text is compared with text.
    texts = re.split(r"[0-9]+", name.casefold())
    digits = [found.lstrip("0") for found in re.findall(r"[0-9]+", name)]
    # A number with more digits is larger; Python refuses to convert thousands of digits.
    numbers = [(len(found), found) for found in digits]
    return (*itertools.chain(*itertools.zip_longest(texts, numbers, fillvalue=(-1, ""))),), name
