"""Registered meshes that commands read, and the folders, animations and pictures they write."""

from __future__ import annotations

import argparse
import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

import riemhuman as rh
from riemhuman.cli._commands import path
from riemhuman.errors import ArgumentError

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.surfaces import Template

MESH_ENDINGS = (".ply", ".obj", ".off")
_POINT_ENDINGS = (".xyz", ".npy")
_MOTION_PAGE = "motion.html"


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Registered surfaces in files, which are read and aligned when they are accessed.

    ``surfaces[i]`` has shape (V, 3), ``surfaces[i:j]`` has shape (j - i, V, 3).
    """

    meshes: Any
    template: Template
    align: bool

    def __len__(self) -> int:
        return len(self.meshes)

    @overload
    def __getitem__(self, part: int) -> ndarray: ...
    @overload
    def __getitem__(self, part: slice) -> ndarray: ...
    def __getitem__(self, part: int | slice) -> ndarray:
        points: ndarray = self.meshes[part]
        if self.align:
            points = rh.procrustes(points, to=self.template.vertices, scale=None)
        return points


def list_meshes(paths: Sequence[Path]) -> list[Path]:
    """Return mesh files: those that are named, and those of folders in natural order."""
    files: list[Path] = []
    for place in paths:
        if place.suffix.lower() in _POINT_ENDINGS:
            raise ArgumentError(f"{place} holds points without triangles; {advice(place)}")
        files += list_folder(place) if place.is_dir() else [place]
    return files


def list_folder(folder: Path) -> list[Path]:
    """Return the mesh files of a folder in natural order."""
    files: list[Path] = rh.datasets.find_meshes(folder)
    return files


def advice(scan: Path) -> str:
    """Return what to do with a scan, for messages."""
    return f"register it first: riemhuman register {scan} -o body.ply"


def read_surfaces(files: Sequence[Path], options: argparse.Namespace) -> Surfaces:
    """Return the surfaces in mesh files, with the chosen template, by default the first file."""
    scale = None if options.any_scale else "template"
    files = list_meshes(files)
    meshes = rh.datasets.RegisteredMeshes(
        files, options.template, scale, unit=options.unit, up=options.up
    )
    return Surfaces(meshes, rh.Template(meshes.reference, meshes.faces), options.align)


def same_file(a: Path, b: Path) -> bool:
    """Return whether two paths lead to the same file."""
    return a.exists() and b.exists() and os.path.samefile(a, b)


def open_model_like(n_vertices: int) -> Any:
    """Return the open body model of a number of vertices, or None."""
    for resolution in ("coarse", "full"):
        model = rh.datasets.load_open_model(resolution)
        if model.n_vertices == n_vertices:
            return model
    return None


def check_file(file: Path | None, endings: Sequence[str], options: argparse.Namespace) -> None:
    """Raise an error before the work if a file could not be written after it."""
    from riemhuman.io.outputs import check_output_file

    if file is not None:
        check_output_file(file, endings, force=options.force)


def check_picture(options: argparse.Namespace) -> None:
    """Raise an error before the work if its picture could not be written."""
    check_file(options.picture, (".png", ".html"), options)


def check_folder(folder: Path, is_ours: Callable[[str], bool], options: argparse.Namespace) -> None:
    """Raise an error before the work if a folder could not be written after it."""
    from riemhuman.io.outputs import check_output_folder

    check_output_folder(folder, is_ours, force=options.force)


def _is_of_motion(name: str) -> bool:
    return name == _MOTION_PAGE or re.fullmatch(r"frame_\d{4,}\.ply", name) is not None


def check_folder_or_file(
    options: argparse.Namespace,
    endings: Sequence[str] = (".glb", ".npz"),
    is_ours: Callable[[str], bool] = _is_of_motion,
) -> tuple[Path, str]:
    """Return the folder or file to write, and the ending of a file, by default for a motion."""
    output = path(options.output)
    is_folder = options.output.endswith("/") or output.is_dir()
    ending = "" if is_folder else output.suffix.lower()
    if ending:
        check_file(output, [*endings, "/ (a folder)"], options)
    else:
        check_folder(output, is_ours, options)
    return output, ending


def write_motion(
    output: Path,
    ending: str,
    frames: ndarray,
    faces: ndarray,
    title: str,
    description: str = "",
    **arrays: ndarray,
) -> None:
    """Write an animation, arrays, or a folder of meshes with a page that plays them."""
    from riemhuman.io.outputs import atomic_folder

    if ending == ".glb":
        rh.save_glb(output, frames, faces, name=title)
    elif ending:
        rh.io.save_arrays(output, {"path": frames, "faces": faces, **arrays})
    else:
        viewer = rh.plots.view_path(frames, faces, title=title, description=description)
        with atomic_folder(output, _is_of_motion) as folder:
            for k, frame in enumerate(frames):
                rh.save_mesh(folder / f"frame_{k:04d}.ply", frame, faces)
            viewer.save(folder / _MOTION_PAGE)


def save_figure(figure: Any, file: Path) -> None:
    """Write a matplotlib figure on white to a file, in the format of its ending."""
    from riemhuman.io.files import atomic_file

    with atomic_file(file) as temporary:
        ending = file.suffix[1:].lower()
        figure.savefig(temporary, dpi=200, facecolor="white", format=ending)
