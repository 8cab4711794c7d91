"""Outputs that are a folder of meshes, or one file instead."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from riemhuman.cli.inputs import path_argument
from riemhuman.cli.verbs import add_force
from riemhuman.io.outputs import atomic_folder, check_output_file, check_output_folder

if TYPE_CHECKING:
    from numpy import ndarray

_PAGE = "motion.html"


def _of_motion(name: str) -> bool:
    return name == _PAGE or re.fullmatch(r"frame_\d{4,}\.ply", name) is not None


def add_folder_or_file(parser: argparse.ArgumentParser) -> None:
    """Declare the option for the output, and the option to replace it.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument(
        "-o", "--output", required=True, metavar="PATH", help="folder or file to write"
    )
    add_force(parser)


def checked_output(
    options: argparse.Namespace,
    endings: Sequence[str] = (".glb", ".npz"),
    is_ours: Callable[[str], bool] = _of_motion,
) -> tuple[Path, str]:
    """Return the folder or file to write and the ending of a file, by default for a motion.

    Parameters
    ----------
    options : argparse.Namespace
        The parsed options.
    endings : sequence of str
        Suffixes that a file may have.
    is_ours : callable
        Tells whether the verb writes files of a given name into a folder.
    """
    output = path_argument(options.output)
    is_folder = options.output.endswith("/") or output.is_dir()
    ending = "" if is_folder else output.suffix.lower()
    if ending:
        check_output_file(output, [*endings, "/ (a folder)"], force=options.force)
    else:
        check_output_folder(output, is_ours, force=options.force)
    return output, ending


def write_motion(
    output: Path,
    ending: str,
    frames: ndarray,
    faces: ndarray,
    title: str,
    said: str = "",
    **arrays: ndarray,
) -> None:
    """Write an animation, arrays, or a folder of meshes with a page that plays them.

    Parameters
    ----------
    output : Path
    ending : str
        The folder or file and its ending, from `checked_output`.
    frames : array, shape (n_frames, V, 3)
        The motion.
    faces : array of int, shape (F, 3)
        Triangles.
    title, said : str
        Title and description of the page.
    **arrays
        Further arrays for an .npz file.
    """
    from riemhuman.io.arrays import save_arrays
    from riemhuman.io.gltf import save_glb
    from riemhuman.io.meshes import save_mesh
    from riemhuman.plots.viewer import view_path

    if ending == ".glb":
        save_glb(output, frames, faces, name=title)
    elif ending:
        save_arrays(output, {"path": frames, "faces": faces, **arrays})
    else:
        with atomic_folder(output, _of_motion) as folder:
            for k, frame in enumerate(frames):
                save_mesh(folder / f"frame_{k:04d}.ply", frame, faces)
            view_path(frames, faces, title=title, description=said).save(folder / _PAGE)
