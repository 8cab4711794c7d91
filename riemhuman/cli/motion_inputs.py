"""The motions that verbs take, and the space and the measure that compare them."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from riemhuman.cli.inputs import add_units, path_argument
from riemhuman.errors import ArgumentError

if TYPE_CHECKING:
    from riemhuman.motions import (
        DynamicTimeWarping,
        MotionSpace,
        RateInvariantMetric,
        VelocityTimeWarping,
    )
    from riemhuman.motions._frames import Motion

_MEASURES = ("warping", "changes", "velocities", "rate-invariant")


def add_motions(parser: argparse.ArgumentParser, **motions: str) -> None:
    """Declare up to two motions as arguments, and the options for reading motions.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    **motions : str
        Help text of each argument by its name; the options ``a_motion`` and ``b_motion`` receive
        the paths.
    """
    for dest, (name, text) in zip(("a_motion", "b_motion"), motions.items(), strict=False):
        parser.add_argument(dest, metavar=name, type=path_argument, help=text)
    parser.add_argument(
        "--template",
        metavar="MESH",
        type=path_argument,
        help="template mesh (default: the first frame)",
    )
    add_units(parser)


def add_measure(parser: argparse.ArgumentParser) -> None:
    """Declare the option that chooses the measure of motions.

    Parameters
    ----------
    parser : argparse.ArgumentParser
        Parser of the verb.
    """
    parser.add_argument(
        "--by",
        choices=_MEASURES,
        default="warping",
        help="dynamic time warping of poses, of their changes from the mean of each motion, or of "
        "velocities; or the rate-invariant metric (default: warping)",
    )


def read_motions(
    options: argparse.Namespace, paths: Sequence[Path], exactly: int | None = None
) -> tuple[list[str], list[Motion]]:
    """Return motions, whose frames are read when they are needed, and their names.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    paths : sequence of Path
        Folders of meshes, folders of such folders, and .npz files.
    exactly : int, optional
        Number of motions that there must be.

    Returns
    -------
    names : list of str
    motions : list of Motion

    Raises
    ------
    ArgumentError
        If the number of motions is wrong, or they do not share one triangulation.
    """
    from riemhuman.datasets.motions import load_mesh_motions

    if (options.unit or options.up) and not any(path.is_dir() for path in paths):
        raise ArgumentError("--unit and --up are for folders of meshes; .npz files are in metres")
    names: list[str] = []
    motions: list[Motion] = []
    for path in paths:
        if path.suffix.lower() == ".npz":
            names.append(path.stem)
            motions.append(_StoredMotion(path))
            continue
        for motion in load_mesh_motions(path, unit=options.unit, up=options.up):
            names.append(motion.sequence)
            motions.append(motion)
    if exactly is not None and len(motions) != exactly:
        raise ArgumentError(
            f"{' and '.join(map(str, paths))} must hold one motion each; found {len(motions)}"
        )
    first = motions[0].faces
    for name, motion in zip(names, motions, strict=True):
        if motion.faces.shape != first.shape or (motion.faces != first).any():
            raise ArgumentError(
                f"all motions must share one triangulation; {name} has another than {names[0]}"
            )
    return names, motions


class _StoredMotion:
    """The motion in an .npz file that `riemhuman transfer` wrote."""

    def __init__(self, path: Path) -> None:
        from riemhuman.io.arrays import load_arrays

        arrays = load_arrays(path, ("path", "faces"))
        self._frames, self.faces = arrays["path"], arrays["faces"]

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: Any) -> Any:
        return self._frames[index]


def motion_space(options: argparse.Namespace, motion: Any, n_times: int = 40) -> MotionSpace:
    """Return the space of motions, with the pose metric.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    motion : Motion
        A motion; by default, its first frame is the template.
    n_times : int
        Number of times of resampled motions.

    Returns
    -------
    MotionSpace

    Raises
    ------
    ArgumentError
        If the template has other triangles than the motion.
    """
    from riemhuman.datasets import RegisteredMeshes
    from riemhuman.geometry import AlignedSurfaces, ElasticMetric
    from riemhuman.motions import MotionSpace
    from riemhuman.surfaces.template import Template

    body = motion[0]
    if options.template is not None:
        units = {"unit": options.unit, "up": options.up}
        meshes = RegisteredMeshes([options.template], **units)
        if meshes.faces.shape != motion.faces.shape or (meshes.faces != motion.faces).any():
            raise ArgumentError(
                f"--template {options.template} has other triangles than the motions"
            )
        body = meshes[0]
    space = AlignedSurfaces(Template(body, motion.faces), equip=False)
    space.equip_with_metric(ElasticMetric, a=0.0, lam=0.0, c=1.0)
    return MotionSpace(space, n_times)


def motion_measure(
    options: argparse.Namespace, space: MotionSpace, n_components: int | None = None
) -> DynamicTimeWarping | VelocityTimeWarping | RateInvariantMetric:
    """Return the measure that the options choose.

    Parameters
    ----------
    options : argparse.Namespace
        Parsed options.
    space : MotionSpace
        The space of the motions.
    n_components : int, optional
        Number of principal components that are compared; by default distances are exact.

    Returns
    -------
    DynamicTimeWarping, VelocityTimeWarping or RateInvariantMetric
    """
    from riemhuman.motions import DynamicTimeWarping, RateInvariantMetric, VelocityTimeWarping

    if options.by == "rate-invariant":
        return RateInvariantMetric(space, n_components=n_components)
    shared: dict[str, Any] = {"n_components": n_components, "n_jobs": -1}
    if options.by == "velocities":
        return VelocityTimeWarping(space.frames.metric, **shared)
    centered = options.by == "changes"
    return DynamicTimeWarping(space.frames.metric, centered=centered, between_frames=True, **shared)
