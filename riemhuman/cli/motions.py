"""The verb ``motions``: sequences of bodies compared, aligned, averaged and searched."""

from __future__ import annotations

import argparse
import csv
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from riemhuman.cli.inputs import add_units, path_argument
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_force, add_json, add_verb
from riemhuman.errors import ArgumentError
from riemhuman.storage.outputs import check_file, check_folder, whole_folder

if TYPE_CHECKING:
    from riemhuman.motions import (
        DynamicTimeWarping,
        MotionSpace,
        RateInvariantMetric,
        VelocityTimeWarping,
    )
    from riemhuman.motions.frames import Motion

_PAGE = "motion.html"
_MEASURES = ("warping", "changes", "velocities", "rate-invariant")


def add_verbs(verbs: Verbs) -> None:
    """Declare ``motions`` with its own verbs.

    Parameters
    ----------
    verbs : argparse action
        Where verbs are declared.
    """
    parser = verbs.add_parser(
        "motions",
        help="motions compared, aligned, averaged and searched",
        description="Motions are folders of registered meshes, one a frame (frame_0001.ply, ...),\n"
        "or .npz files with an array path, as `riemhuman transfer` writes them.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    inner = parser.add_subparsers(metavar="VERB", required=True, title="verbs")
    _add_dist(inner)
    _add_matrix(inner)
    _add_align(inner)
    _add_mean(inner)
    _add_find(inner)
    _add_table(inner)


def _add_dist(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "dist",
        _dist,
        "distance of two motions, however fast they are",
        "Prints the distance of two motions after the best re-timing.",
        "  riemhuman motions dist anna_runs/ ben_runs/\n"
        "  riemhuman motions dist anna_runs/ ben_runs/ --by rate-invariant --json\n",
    )
    _add_two(parser)
    _add_measure(parser)
    add_json(parser)


def _add_matrix(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "matrix",
        _matrix,
        "all distances of several motions",
        "Writes the arrays distances (n, n) and names (n,) of an .npz file, or a .csv table.",
        "  riemhuman motions matrix all_motions/ -o D.npz\n"
        "  riemhuman motions matrix anna_*/ ben_*/ -o D.csv --by changes --components 200\n",
    )
    _add_several(parser)
    parser.add_argument(
        "-o", "--output", required=True, metavar="FILE", type=path_argument, help="file to write"
    )
    parser.add_argument(
        "--components",
        type=int,
        metavar="K",
        help="compare K principal components, which is faster (default: exact distances)",
    )
    _add_measure(parser)
    add_json(parser)
    add_force(parser)


def _add_align(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "align",
        _align,
        "two motions aligned in time",
        "Writes a page that plays both motions, the second re-timed to the first, with the\n"
        "re-timing as a curve and corresponding frames (.html), or the arrays first, second,\n"
        "first_times and second_times (.npz).",
        "  riemhuman motions align anna_runs/ ben_runs/ -o both.html\n"
        "  riemhuman motions align anna_runs/ ben_runs/ -o both.npz --n-times 100\n",
    )
    _add_two(parser)
    parser.add_argument(
        "-o", "--output", required=True, metavar="FILE", type=path_argument, help="file to write"
    )
    _add_n_times(parser)
    _add_measure(parser)
    add_json(parser)
    add_force(parser)


def _add_mean(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "mean",
        _mean,
        "the mean of several performances",
        "Writes the Karcher mean of motions modulo re-timing: a folder of meshes, or a file with\n"
        "the ending .glb (an animation) or .npz (the array path). A folder has a page to look at\n"
        "the motion, motion.html.",
        "  riemhuman motions mean runs/ -o mean_run/\n"
        "  riemhuman motions mean anna_run/ ben_run/ carla_run/ -o mean.glb --n-times 30\n",
    )
    _add_several(parser)
    parser.add_argument(
        "-o", "--output", required=True, metavar="PATH", help="folder, or file, to write"
    )
    _add_n_times(parser)
    _add_measure(parser)
    add_json(parser)
    add_force(parser)


def _add_find(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "find",
        _find,
        "where in a long motion a short one occurs",
        "Prints the parts of a motion that are most like a query, at any speed, nearest first:\n"
        "distance, first and last frame. The motion is read once, frame by frame.",
        "  riemhuman motions find lifted_knee/ hour/\n"
        "  riemhuman motions find lifted_knee/ hour/ -k 20 --json\n",
    )
    parser.add_argument("a_motion", metavar="QUERY", type=path_argument, help="what to look for")
    parser.add_argument("b_motion", metavar="MOTION", type=path_argument, help="where to look")
    _add_reading(parser)
    parser.add_argument(
        "-k", type=int, default=5, metavar="K", help="parts to print, at most (default: 5)"
    )
    add_json(parser)


def _add_table(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "table",
        _table,
        "which motion is it: representations compared on the open motions",
        "Re-times the 140 open motions at random, to 24 to 60 frames, and prints how well each\n"
        "representation finds the same motion of other people.",
        "  riemhuman motions table\n  riemhuman motions table --angles --seed 3 --json\n",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="seed of the speeds (default: 0)"
    )
    parser.add_argument(
        "--angles", action="store_true", help="compare joint angles too; takes minutes"
    )
    add_json(parser)


def _add_two(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("a_motion", metavar="A", type=path_argument, help="folder, or .npz file")
    parser.add_argument("b_motion", metavar="B", type=path_argument, help="folder, or .npz file")
    _add_reading(parser)


def _add_reading(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--template",
        metavar="MESH",
        type=path_argument,
        help="template mesh (default: the first frame)",
    )
    add_units(parser)


def _add_several(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "motions",
        metavar="MOTIONS",
        nargs="+",
        type=path_argument,
        help="folders of meshes, folders of such folders, .npz files",
    )
    _add_reading(parser)


def _add_n_times(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--n-times", type=int, default=40, metavar="N", help="times of the result (default: 40)"
    )


def _add_measure(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--by",
        choices=_MEASURES,
        default="warping",
        help="dynamic time warping of poses, or of their changes from each motion's mean, or of "
        "velocities; or the rate-invariant metric (default: warping)",
    )


def _dist(options: argparse.Namespace) -> None:
    names, motions = _read(options, [options.a_motion, options.b_motion], exactly=2)
    dist = float(_measure(options, _space(options, motions[0])).dist(*motions))
    if options.json:
        say_json({"a": names[0], "b": names[1], "by": options.by, "distance": dist})
        return
    say(f"{dist:.8g}")


def _matrix(options: argparse.Namespace) -> None:
    import numpy as np

    from riemhuman.storage.array_files import save_arrays
    from riemhuman.storage.whole_files import whole_file

    check_file(options.output, [".npz", ".csv"], force=options.force)
    reporter = Reporter(options.quiet)
    names, motions = _read(options, options.motions)
    measure = _measure(options, _space(options, motions[0]), options.components)
    with reporter.task(f"Distances of {len(motions)} motions"):
        distances = measure.dist_pairwise(motions, progress=reporter.bars)
    if options.output.suffix.lower() == ".npz":
        save_arrays(options.output, {"distances": distances, "names": np.array(names)})
    else:
        with whole_file(options.output) as neighbour, open(neighbour, "w", newline="") as table:
            rows = csv.writer(table)
            rows.writerow(["", *names])
            rows.writerows([name, *row] for name, row in zip(names, distances, strict=True))
    if options.json:
        say_json({"names": names, "by": options.by, "output": options.output})
        return
    say(f"written to  {options.output}")


def _align(options: argparse.Namespace) -> None:
    from riemhuman.motions.alignment import at_times, even_times
    from riemhuman.plots.motion_page import AlignedMotions
    from riemhuman.storage.array_files import save_arrays

    check_file(options.output, [".html", ".npz"], force=options.force)
    reporter = Reporter(options.quiet)
    names, (one, other) = _read(options, [options.a_motion, options.b_motion], exactly=2)
    space = _space(options, one, options.n_times)
    with reporter.task("Alignment"):
        warp = _measure(options, space).warp(one, other)
        first = space.resample(one, name=names[0])
        second = at_times(space, other, even_times(warp, space.n_times), names[1])
    if options.output.suffix.lower() == ".npz":
        arrays = {"first": first, "second": second}
        arrays |= {"first_times": warp.first, "second_times": warp.second}
        save_arrays(options.output, arrays)
    else:
        faces = space.frames.template.faces
        AlignedMotions(first, second, faces, warp, names).save(options.output)
    if options.json:
        record = {"a": names[0], "b": names[1], "by": options.by, "distance": warp.dist}
        say_json(record | {"output": options.output})
        return
    say(f"distance    {warp.dist:.8g}")
    say(f"written to  {options.output}")


def _mean(options: argparse.Namespace) -> None:
    from riemhuman.motions import MotionMean
    from riemhuman.plots.viewer import view_path
    from riemhuman.storage.array_files import save_arrays
    from riemhuman.surfaces.gltf_files import save_glb
    from riemhuman.surfaces.mesh_files import save_mesh

    output = path_argument(options.output)
    single = "" if options.output.endswith("/") or output.is_dir() else output.suffix.lower()
    if single:
        check_file(output, [".glb", ".npz", "/ (a folder)"], force=options.force)
    else:
        check_folder(output, _is_ours, force=options.force)
    reporter = Reporter(options.quiet)
    names, motions = _read(options, options.motions)
    space = _space(options, motions[0], options.n_times)
    estimator = MotionMean(space, alignment=_measure(options, space), progress=reporter.bars)
    with reporter.task(f"Mean of {len(motions)} motions"):
        mean = estimator.fit(motions)
    faces = space.frames.template.faces
    if single == ".glb":
        save_glb(output, mean.estimate_, faces, name="mean")
    elif single:
        save_arrays(output, {"path": mean.estimate_, "faces": faces, "times": mean.times_})
    else:
        with whole_folder(output, _is_ours) as folder:
            for k, frame in enumerate(mean.estimate_):
                save_mesh(folder / f"frame_{k:04d}.ply", frame, faces)
            view_path(mean.estimate_, faces, title="Mean of motions").save(folder / _PAGE)
    if options.json:
        say_json({"motions": names, "variance": mean.variance_, "output": output})
        return
    say(f"motions     {len(motions)}")
    say(f"variance    {mean.variance_:.8g}")
    say(f"written to  {output}")


def _find(options: argparse.Namespace) -> None:
    from riemhuman.motions import MotionSearch

    _, (query, motion) = _read(options, [options.a_motion, options.b_motion], exactly=2)
    search = MotionSearch(_space(options, query).frames.metric, Reporter(options.quiet).bars)
    found = search.find(query, motion, options.k)
    if options.json:
        say_json([{"distance": o.dist, "first": o.start, "last": o.stop - 1} for o in found])
        return
    say("  distance   first    last")
    for part in found:
        say(f"{part.dist:10.6g}  {part.start:6d}  {part.stop - 1:6d}")


def _table(options: argparse.Namespace) -> None:
    from dataclasses import asdict

    from riemhuman.motions.comparison import compare_representations
    from riemhuman.retrieval import format_table

    reporter = Reporter(options.quiet)
    rows = compare_representations(options.seed, angles=options.angles, task=reporter.task)
    if options.json:
        say_json({row.representation: asdict(row.scores) for row in rows})
        return
    say(format_table("Which motion is it?", rows))


def _read(
    options: argparse.Namespace, paths: list[Path], exactly: int | None = None
) -> tuple[list[str], list[Motion]]:
    """Return the names of motions, and the motions, whose frames are read when asked for."""
    from riemhuman.datasets.mesh_motions import load_mesh_motions

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
            f"{' and '.join(map(str, paths))} must be one motion each; found {len(motions)}"
        )
    first = motions[0].faces
    for name, motion in zip(names, motions, strict=True):
        if motion.faces.shape != first.shape or (motion.faces != first).any():
            raise ArgumentError(
                f"all motions must share one triangulation; {name} has another than {names[0]}"
            )
    return names, motions


class _StoredMotion:
    """The motion in an .npz file, as `riemhuman transfer` writes it."""

    def __init__(self, path: Path) -> None:
        from riemhuman.storage.array_files import load_arrays

        arrays = load_arrays(path, ("path", "faces"))
        self._frames, self.faces = arrays["path"], arrays["faces"]

    def __len__(self) -> int:
        return len(self._frames)

    def __getitem__(self, index: Any) -> Any:
        return self._frames[index]


def _space(options: argparse.Namespace, motion: Any, n_times: int = 40) -> MotionSpace:
    """Return the space over a template, or a motion's first frame, with the metric of poses."""
    from riemhuman.datasets.registered_meshes import RegisteredMeshes
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
    from riemhuman.geometry.elastic_metric import ElasticMetric
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


def _measure(
    options: argparse.Namespace, space: MotionSpace, n_components: int | None = None
) -> DynamicTimeWarping | VelocityTimeWarping | RateInvariantMetric:
    from riemhuman.motions import DynamicTimeWarping, RateInvariantMetric, VelocityTimeWarping

    if options.by == "rate-invariant":
        return RateInvariantMetric(space, n_components=n_components)
    shared: dict[str, Any] = {"n_components": n_components, "n_jobs": -1}
    if options.by == "velocities":
        return VelocityTimeWarping(space.frames.metric, **shared)
    centered = options.by == "changes"
    return DynamicTimeWarping(space.frames.metric, centered=centered, between_frames=True, **shared)


def _is_ours(name: str) -> bool:
    return name == _PAGE or re.fullmatch(r"frame_\d{4,}\.ply", name) is not None
