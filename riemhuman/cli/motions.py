"""The verb ``motions``: comparison, alignment, means and search of sequences of bodies."""

from __future__ import annotations

import argparse

from riemhuman.cli.csv_files import write_csv
from riemhuman.cli.inputs import path_argument
from riemhuman.cli.motion_inputs import (
    add_measure,
    add_motions,
    motion_measure,
    motion_space,
    read_motions,
)
from riemhuman.cli.outputs import add_folder_or_file, checked_output, write_motion
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_output, add_verb
from riemhuman.io.outputs import check_output_file


def add_verbs(verbs: Verbs) -> None:
    """Declare ``motions`` and its own verbs.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = verbs.add_parser(
        "motions",
        help="compare, align, average and search motions",
        description="A motion is a folder of registered meshes, one per frame (frame_0001.ply,\n"
        "...), or an .npz file with an array path, as `riemhuman transfer` writes it.",
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
        "distance of two motions, whatever their speeds",
        "Prints the distance of two motions after the best re-timing.",
        "  riemhuman motions dist anna_runs/ ben_runs/\n"
        "  riemhuman motions dist anna_runs/ ben_runs/ --by rate-invariant --json\n",
    )
    add_motions(parser, A="folder or .npz file", B="folder or .npz file")
    add_measure(parser)
    add_json(parser)


def _add_matrix(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "matrix",
        _matrix,
        "all distances between several motions",
        "Writes the arrays distances (n, n) and names (n,) of an .npz file, or a .csv table.",
        "  riemhuman motions matrix all_motions/ -o D.npz\n"
        "  riemhuman motions matrix anna_*/ ben_*/ -o D.csv --by changes --components 200\n",
    )
    _add_several(parser)
    add_output(parser, "FILE")
    parser.add_argument(
        "--components",
        type=int,
        metavar="K",
        help="compare K principal components, which is faster (default: exact distances)",
    )
    add_measure(parser)
    add_json(parser)


def _add_align(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "align",
        _align,
        "two motions aligned in time",
        "Writes a page (.html) that plays both motions, the second re-timed to the first, with\n"
        "the re-timing as a curve and corresponding frames, or an .npz file with the arrays\n"
        "first, second, first_times and second_times.",
        "  riemhuman motions align anna_runs/ ben_runs/ -o both.html\n"
        "  riemhuman motions align anna_runs/ ben_runs/ -o both.npz --n-times 100\n",
    )
    add_motions(parser, A="folder or .npz file", B="folder or .npz file")
    add_output(parser, "FILE")
    _add_n_times(parser)
    add_measure(parser)
    add_json(parser)


def _add_mean(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "mean",
        _mean,
        "the mean of several performances",
        "Writes the Karcher mean of motions modulo re-timing: a folder of meshes with a page that\n"
        "plays them, motion.html, or a .glb file (an animation) or an .npz file (the array\n"
        "path).",
        "  riemhuman motions mean runs/ -o mean_run/\n"
        "  riemhuman motions mean anna_run/ ben_run/ carla_run/ -o mean.glb --n-times 30\n",
    )
    _add_several(parser)
    add_folder_or_file(parser)
    _add_n_times(parser)
    add_measure(parser)
    add_json(parser)


def _add_find(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "find",
        _find,
        "occurrences of a short motion in a long one",
        "Prints the parts of a motion that are most similar to a query, at any speed, nearest\n"
        "first: distance, first and last frame. The motion is read once, frame by frame.",
        "  riemhuman motions find lifted_knee/ hour/\n"
        "  riemhuman motions find lifted_knee/ hour/ -k 20 --json\n",
    )
    add_motions(parser, QUERY="motion to find", MOTION="motion to search")
    parser.add_argument(
        "-k", type=int, default=5, metavar="K", help="largest number of parts to print (default: 5)"
    )
    add_json(parser)


def _add_table(verbs: Verbs) -> None:
    parser = add_verb(
        verbs,
        "table",
        _table,
        "scores of representations on the open motions",
        "Re-times the 140 open motions at random, to between 24 and 60 frames, and prints how\n"
        "well each representation finds the same motion of other people.",
        "  riemhuman motions table\n  riemhuman motions table --angles --seed 3 --json\n",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="seed of the speeds (default: 0)"
    )
    parser.add_argument(
        "--angles", action="store_true", help="also compare joint angles, which takes minutes"
    )
    add_json(parser)


def _add_several(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "motions",
        metavar="MOTIONS",
        nargs="+",
        type=path_argument,
        help="folders of meshes, folders of such folders, or .npz files",
    )
    add_motions(parser)


def _add_n_times(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--n-times",
        type=int,
        default=40,
        metavar="N",
        help="times of the result (default: 40)",
    )


def _dist(options: argparse.Namespace) -> None:
    names, motions = read_motions(options, [options.a_motion, options.b_motion], exactly=2)
    dist = float(motion_measure(options, motion_space(options, motions[0])).dist(*motions))
    if options.json:
        say_json({"a": names[0], "b": names[1], "by": options.by, "distance": dist})
        return
    say(f"{dist:.8g}")


def _matrix(options: argparse.Namespace) -> None:
    import numpy as np

    from riemhuman.io.arrays import save_arrays

    check_output_file(options.output, [".npz", ".csv"], force=options.force)
    reporter = Reporter(options.quiet)
    names, motions = read_motions(options, options.motions)
    measure = motion_measure(options, motion_space(options, motions[0]), options.components)
    with reporter.task(f"Distances of {len(motions)} motions"):
        distances = measure.dist_pairwise(motions, progress=reporter.bars)
    if options.output.suffix.lower() == ".npz":
        save_arrays(options.output, {"distances": distances, "names": np.array(names)})
    else:
        rows = zip(names, distances.tolist(), strict=True)
        write_csv(options.output, [["", *names], *([name, *row] for name, row in rows)])
    if options.json:
        say_json({"names": names, "by": options.by, "output": options.output})
        return
    say(f"written to  {options.output}")


def _align(options: argparse.Namespace) -> None:
    from riemhuman.io.arrays import save_arrays
    from riemhuman.motions import align_motions
    from riemhuman.plots.viewer import AlignedMotions

    check_output_file(options.output, [".html", ".npz"], force=options.force)
    reporter = Reporter(options.quiet)
    names, (one, other) = read_motions(options, [options.a_motion, options.b_motion], exactly=2)
    space = motion_space(options, one, options.n_times)
    with reporter.task("Alignment"):
        measure = motion_measure(options, space)
        first, second, warp = align_motions(space, one, other, measure, (names[0], names[1]))
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

    output, ending = checked_output(options)
    reporter = Reporter(options.quiet)
    names, motions = read_motions(options, options.motions)
    space = motion_space(options, motions[0], options.n_times)
    estimator = MotionMean(space, alignment=motion_measure(options, space), progress=reporter.bars)
    with reporter.task(f"Mean of {len(motions)} motions"):
        mean = estimator.fit(motions)
    faces = space.frames.template.faces
    write_motion(output, ending, mean.estimate_, faces, "Mean of motions", times=mean.times_)
    if options.json:
        say_json({"motions": names, "variance": mean.variance_, "output": output})
        return
    say(f"motions     {len(motions)}")
    say(f"variance    {mean.variance_:.8g}")
    say(f"written to  {output}")


def _find(options: argparse.Namespace) -> None:
    from riemhuman.motions import MotionSearch

    _, (query, motion) = read_motions(options, [options.a_motion, options.b_motion], exactly=2)
    search = MotionSearch(motion_space(options, query).frames.metric, Reporter(options.quiet).bars)
    found = search.find(query, motion, options.k)
    if options.json:
        say_json([{"distance": o.dist, "first": o.start, "last": o.stop - 1} for o in found])
        return
    say("  distance   first    last")
    for part in found:
        say(f"{part.dist:10.6g}  {part.start:6d}  {part.stop - 1:6d}")


def _table(options: argparse.Namespace) -> None:
    from dataclasses import asdict

    from riemhuman.motions import compare_representations
    from riemhuman.retrieval import format_table, retrieval_table

    reporter = Reporter(options.quiet)
    rows = retrieval_table(
        *compare_representations(options.seed, angles=options.angles, task=reporter.task)
    )
    if options.json:
        say_json({row.representation: asdict(row.scores) for row in rows})
        return
    say(format_table("Which motion is it?", rows))
