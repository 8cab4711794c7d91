"""The commands of ``motions``: comparison, alignment, means and search of sequences of bodies."""

from __future__ import annotations

import argparse
import dataclasses
from typing import TYPE_CHECKING

import riemhuman as rh
from riemhuman.cli import _commands as cli
from riemhuman.cli import _inputs as inputs
from riemhuman.cli import _terminal as terminal
from riemhuman.errors import ArgumentError, counted

if TYPE_CHECKING:
    from riemhuman.arrays import Array, JSONRecord
    from riemhuman.datasets import Motion
    from riemhuman.motions import MotionSpace, Warp
    from riemhuman.motions.time_warping import MotionDistance
    from riemhuman.plots import Viewer

# Coordinates of all frames on a page, two bytes each.
_MOST_COORDINATES = 6_000_000

_TEMPLATE = cli.several(
    cli.path_option("--template", "MESH", "template mesh (default: the first frame)"),
    cli.UNIT,
    cli.JOINTS,
    cli.FPS,
)
_PAIR = cli.several(
    cli.path_option("a_motion", "A", "folder, .npz file, or recording"),
    cli.path_option("b_motion", "B", "folder, .npz file, or recording"),
    _TEMPLATE,
)
_SEVERAL = cli.several(
    cli.path_option("motions", "MOTIONS", "folders of meshes or motions, or recordings", nargs="+"),
    _TEMPLATE,
)
_BY = cli.choice(
    "--by",
    "dynamic time warping of poses, of their changes from the mean of each motion, or of "
    "velocities; or the rate-invariant metric",
    *("warping", "changes", "velocities", "rate-invariant"),
)
_METRIC = cli.choice(
    "--metric",
    "compare frames by the normals of the skin, or by rotations, which distinguish movements of "
    "people with different body shapes more reliably",
    *("pose", "rotation"),
)
_TRAVEL = cli.option(
    "--travel",
    "weight of how fast the body travels, compared with its pose, such as 1",
    default=0.0,
    metavar="W",
)
_N_TIMES = cli.option("--n-times", "number of times in the result", default=40, metavar="N")


def _read_pair(options: argparse.Namespace) -> inputs.Motions:
    read = inputs.read_motions(options, options.a_motion, options.b_motion)
    if len(read.names) != 2:
        raise ArgumentError(
            f"{options.a_motion} and {options.b_motion} must hold one motion each; found "
            f"{len(read.names)}"
        )
    return read


def _space(read: inputs.Motions, metric: str, n_times: int = 40) -> MotionSpace:
    """Return the space of motions with a metric on frames."""
    space = rh.AlignedSurfaces(read.template, equip=False)
    if metric == "rotation":
        space.equip_with_metric(rh.RotationMetric)
    else:
        space.equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    return rh.motions.MotionSpace(space, n_times)


def _measure(
    options: argparse.Namespace,
    space: MotionSpace,
    n_components: int | None = None,
    travel: float = 0.0,
) -> MotionDistance:
    """Return the measure of motions, exact or on principal components."""
    if options.by == "rate-invariant":
        if travel:
            raise ArgumentError("--travel is for --by warping, changes and velocities")
        return rh.motions.RateInvariantMetric(space, n_components=n_components)
    metric = space.frames.metric
    if options.by == "velocities":
        return rh.motions.VelocityTimeWarping(
            metric, n_components=n_components, n_jobs=-1, travel_weight=travel
        )
    return rh.motions.DynamicTimeWarping(
        metric,
        centered=options.by == "changes",
        between_frames=True,
        n_components=n_components,
        n_jobs=-1,
        travel_weight=travel,
    )


@cli.command(
    "motions dist",
    "Prints the distance between two motions after the best re-timing.",
    "  riemhuman motions dist anna_runs/ ben_runs/\n"
    "  riemhuman motions dist anna_runs/ ben_runs/ --by rate-invariant --json\n"
    "  riemhuman motions dist walk.bvh run.bvh --metric rotation --travel 1\n",
    _PAIR,
    _BY,
    _METRIC,
    _TRAVEL,
)
def _dist(options: argparse.Namespace) -> cli.Answer:
    read = _read_pair(options)
    measure = _measure(options, _space(read, options.metric), travel=options.travel)
    with options.task("Distance"):
        dist = float(measure.dist(*read.motions))
    record = {"a": read.names[0], "b": read.names[1], "by": options.by, "distance": dist}
    if not (options.quiet or options.json):
        terminal.note(f"for comparison, {_usual_distances(options)}")
    return cli.Answer(f"{dist:.8g}", record)


def _usual_distances(options: argparse.Namespace) -> str:
    """Return how far some open motions are from each other by the same measure."""
    import numpy as np

    people = ("lean runner", "average woman", "older heavy man")
    recorded = rh.datasets.load_open_motions("coarse", people, ("knees", "punching", "shake_arms"))
    template = recorded[0].template
    read = inputs.Motions([motion.sequence for motion in recorded], recorded, template)
    # Two seconds of each, at the frame rate of most recordings.
    frames = [motion[:120:4] for motion in recorded]
    measure = _measure(options, _space(read, options.metric))
    distances = measure.dist_pairwise(frames)
    same = np.equal.outer(read.names, read.names)
    np.fill_diagonal(same, False)
    others = ~np.equal.outer(read.names, read.names)
    return (
        "among simulated people: the same motion of another person "
        f"≈ {np.median(distances[same]):.2g}, another motion ≈ {np.median(distances[others]):.2g}"
    )


@cli.command(
    "motions matrix",
    "Writes the arrays distances (n, n) and names (n,) of an .npz file, or a .csv table.",
    "  riemhuman motions matrix all_motions/ -o D.npz\n"
    "  riemhuman motions matrix anna_*/ ben_*/ -o D.csv --by changes --components 200\n",
    _SEVERAL,
    cli.output("FILE", ".npz", ".csv"),
    cli.option("--components", "compare K principal components (faster)", type=int, metavar="K"),
    _BY,
    _METRIC,
    _TRAVEL,
)
def _matrix(options: argparse.Namespace) -> cli.Answer:
    import numpy as np

    from riemhuman.io.files import write_text

    read = inputs.read_motions(options, *options.motions)
    names, space = read.names, _space(read, options.metric)
    measure = _measure(options, space, options.components, options.travel)
    with options.task(f"Distances of {counted(len(names), 'motion', 'motions')}"):
        distances = measure.dist_pairwise(read.motions, progress=options.bars)
    if options.ending == ".npz":
        rh.io.save_arrays(options.output, {"distances": distances, "names": np.array(names)})
    else:
        write_text(options.output, terminal.matrix_text(names, distances, ""))
    return cli.Answer({"motions": len(names)}, {"names": names, "by": options.by})


@cli.command(
    "motions align",
    "Opens a page that plays both motions side by side, the second re-timed to the first or as\n"
    "recorded, with the warp, which shows the moments that correspond. Or writes the page\n"
    "(.html), a picture (.png), a film (.gif, or .mp4 with the extra video), or an .npz file\n"
    "with the arrays first, second, first_times and second_times.",
    "  riemhuman motions align anna_runs/ ben_runs/     # opens in the browser\n"
    "  riemhuman motions align walk.bvh run.bvh -o both.html\n"
    "  riemhuman motions align anna_runs/ ben_runs/ -o both.npz --n-times 100\n",
    _PAIR,
    cli.output(
        "FILE",
        *(".html", ".npz", ".png", ".gif", ".mp4"),
        text="page, picture, film or arrays to write; without one, a temporary page opens in the "
        "browser",
        required=False,
    ),
    cli.option("--n-times", "times of the arrays of an .npz file", default=40, metavar="N"),
    _BY,
    _METRIC,
)
def _align(options: argparse.Namespace) -> cli.Answer:
    read = _read_pair(options)
    space = _space(read, options.metric, options.n_times)
    (first_motion, second_motion), (first_name, second_name) = read.motions, read.names
    names = first_name, second_name
    measure = _measure(options, space)
    with options.task("Alignment"):
        if options.output is not None and options.ending == ".npz":
            first, second, warp = rh.motions.align_motions(
                space, first_motion, second_motion, measure, names
            )
            arrays = {"first": first, "second": second}
            arrays |= {"first_times": warp.first, "second_times": warp.second}
            rh.io.save_arrays(options.output, arrays)
        else:
            warp = measure.warp(first_motion, second_motion)
    record: JSONRecord = {"a": names[0], "b": names[1], "by": options.by, "distance": warp.dist}
    text: JSONRecord = {"distance": float(warp.dist)}
    if options.output is None or options.ending != ".npz":
        with options.task("Page"):
            viewer = _aligned_view(options, read, space, warp)
            page = inputs.save_or_open(viewer, options)
        if page is not None:
            text, record = text | {"page": page}, record | {"page": page}
    return cli.Answer(text, record)


def _aligned_view(
    options: argparse.Namespace, read: inputs.Motions, space: MotionSpace, warp: Warp
) -> Viewer:
    """Return the page of two motions and their warp, of frames at one rate, and not too many."""
    import numpy as np

    from riemhuman.mocap.motions import ModelMotion

    motions = dict(zip(("first", "second"), read.motions, strict=True))
    times = {"first": warp.first, "second": warp.second}
    # Meshes and array paths do not state their rate.
    rates = [
        None if place.is_dir() else getattr(motion, "frames_per_second", None)
        for place, motion in zip((options.a_motion, options.b_motion), read.motions, strict=True)
    ]
    known = [rate for rate in rates if rate is not None]
    shown: dict[str, Motion | Array] = {}
    for (name, motion), rate in zip(motions.items(), rates, strict=True):
        count = len(motion)
        factor = 1.0 if rate is None else known[0] / rate
        if isinstance(motion, ModelMotion) and factor == 1.0 and len(known) == 2:
            shown[name] = motion  # the page poses it, which takes little room
            continue
        # The largest numbers of frames of which a page stays below some 15 MB.
        most = max(2, _MOST_COORDINATES // (2 * 3 * read.template.n_vertices))
        n_frames = min(max(2, round((count - 1) * factor) + 1), most)
        places = np.linspace(0.0, count - 1.0, n_frames)
        is_as_recorded = n_frames == count
        shown[name] = motion[:] if is_as_recorded else space.resample(motion, at=places, name=name)
        times[name] = times[name] * (n_frames - 1) / (count - 1)
    aligned = dataclasses.replace(warp, first=times["first"], second=times["second"])
    usual = f"For comparison, {_usual_distances(options)}."
    return rh.plots.view_motions(
        shown["first"], shown["second"], aligned, read.template.faces, read.names, usual
    )


@cli.command(
    "motions mean",
    "Writes the Karcher mean of motions modulo re-timing: a folder of meshes with a page that\n"
    "plays them, motion.html, or one file.",
    "  riemhuman motions mean runs/ -o mean_run/\n"
    "  riemhuman motions mean anna_run/ ben_run/ carla_run/ -o mean.glb --n-times 30\n",
    _SEVERAL,
    inputs.MOTION_OUTPUT,
    _N_TIMES,
    _BY,
    _METRIC,
)
def _mean(options: argparse.Namespace) -> cli.Answer:
    read = inputs.read_motions(options, *options.motions)
    space = _space(read, options.metric, options.n_times)
    alignment, bars = _measure(options, space), options.bars
    estimator = rh.motions.MotionMean(space, alignment=alignment, progress=bars)
    with options.task(f"Mean of {counted(len(read.names), 'motion', 'motions')}"):
        mean = estimator.fit(read.motions)
    inputs.write_path(
        options, mean.estimate_, read.template.faces, "Mean of motions", times=mean.times_
    )
    text = {"motions": len(read.names), "variance": float(mean.variance_)}
    return cli.Answer(text, {"motions": read.names, "variance": mean.variance_})


@cli.command(
    "motions find",
    "Prints the parts of a motion that are most similar to a query, at any speed, the nearest\n"
    "first: distance, first and last frame and, for recordings (.bvh, .amc, .trc, .c3d, AMASS,\n"
    "videos), their times in seconds. At most 30 frames per second of a recording are read and\n"
    "counted. The motion is read once, frame by frame.",
    "  riemhuman motions find lifted_knee/ hour/\n  riemhuman motions find jump.bvh day.bvh\n"
    "  riemhuman motions find lifted_knee/ hour/ -k 20 --json\n",
    cli.path_option("a_motion", "QUERY", "motion to find"),
    cli.path_option("b_motion", "MOTION", "motion to search"),
    _TEMPLATE,
    cli.option("-k", "largest number of parts to print", default=5, metavar="K"),
    _METRIC,
)
def _find(options: argparse.Namespace) -> cli.Answer:
    read = _read_pair(options)
    metric = _space(read, options.metric).frames.metric
    search = rh.motions.MotionSearch(metric, options.bars)
    query, motion = read.motions
    parts = search.find(query, motion, options.k)
    record: list[JSONRecord] = [
        {"distance": p.dist, "first": p.start, "last": p.stop - 1} for p in parts
    ]
    rows = [f"{p.dist:10.6g}  {p.start:6d}  {p.stop - 1:6d}" for p in parts]
    head, rate = "  distance   first    last", getattr(motion, "frames_per_second", None)
    if rate is not None and not options.b_motion.is_dir():  # meshes do not state their rate
        head += "   seconds"
        for number, part in enumerate(record):
            seconds = [part[end] / rate for end in ("first", "last")]
            part["seconds"] = seconds
            rows[number] += f"   {seconds[0]:.2f} to {seconds[1]:.2f}"
    return cli.Answer("\n".join([head, *rows]), record)


@cli.command(
    "motions table",
    "Re-times the 140 open motions at random, to between 24 and 60 frames, and prints how\n"
    "well each representation finds the same motion of other people.",
    "  riemhuman motions table\n  riemhuman motions table --seed 3 --json\n",
    cli.option("--seed", "seed of the random speeds", default=0, metavar="S"),
)
def _table(options: argparse.Namespace) -> cli.Answer:
    compared = rh.motions.compare_representations(options.seed, task=options.task)
    rows = rh.retrieval.retrieval_table(*compared)
    return cli.Answer(rh.retrieval.format_table("Which motion is it?", rows), rows)
