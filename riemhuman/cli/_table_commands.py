"""The commands ``tables``, ``scores``, ``plot`` and ``report``."""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import riemhuman as rh
from riemhuman.cli._commands import (
    JSON,
    UNIT,
    Answer,
    Argument,
    command,
    flag,
    option,
    output,
    path_option,
    several,
)
from riemhuman.cli._inputs import check_file, save_figure
from riemhuman.cli._terminal import lines, note
from riemhuman.errors import ArgumentError, FileFormatError, MissingDependencyError

if TYPE_CHECKING:
    from numpy import ndarray

    from riemhuman.datasets import Bodies

_QUESTIONS = {"subject": "Who is it?", "pose": "How do they stand?"}
_N_COMPONENTS = 100  # of the basis of Dynamic FAUST

_BODY_SET = several(
    several(
        option(
            "--open",
            "open bodies of the body model alone (plain, the default), or with individual poses, "
            "self-contact and soft tissue (natural)",
            choices=("plain", "natural"),
        ),
        option(
            "--faust",
            "use the registrations of MPI FAUST (tr_reg_000.ply ... tr_reg_099.ply) instead",
            metavar="FOLDER",
        ),
        option(
            "--bodies",
            "use the registered meshes of a folder instead; see --labels",
            metavar="FOLDER",
        ),
        option(
            "--reader",
            "use the bodies that another package's reader loads, see riemhuman.extensions",
            nargs=2,
            metavar=("NAME", "PATH"),
        ),
        exclusive=True,
    ),
    option(
        "--people",
        "open bodies of ten other people, drawn at random with this seed",
        metavar="SEED",
        type=int,
    ),
    option(
        "--labels",
        "with --bodies: a table with the columns file, subject and pose (default: labels.csv in "
        "the folder)",
        metavar="CSV",
    ),
    path_option(
        "--template", "MESH", "with --faust or --bodies: template mesh (default: the first mesh)"
    ),
    flag("--allow-missing", "with --faust or --bodies: leave out bodies without a file or a label"),
    UNIT,
)


def _check_body_set(options: argparse.Namespace) -> None:
    """Raise an error if an option does not apply to the chosen bodies."""
    if options.labels is not None and options.bodies is None:
        raise ArgumentError("--labels needs --bodies FOLDER")
    if options.faust is None and options.bodies is None:
        for name in ("template", "allow_missing"):
            if getattr(options, name):
                raise ArgumentError(f"--{name.replace('_', '-')} needs --faust or --bodies FOLDER")
    if options.bodies is None and (options.unit or options.up):
        raise ArgumentError("--unit and --up need --bodies FOLDER")
    if options.people is not None and (options.bodies or options.faust or options.reader):
        raise ArgumentError("--people SEED is for the open bodies")
    if options.reader is not None:
        rh.extensions.extension("readers", options.reader[0])


def _read_body_set(options: argparse.Namespace, resolution: str) -> Bodies:
    """Return the bodies that the options choose, the open bodies at a resolution."""
    bodies: Bodies
    if options.faust is not None:
        bodies = rh.datasets.load_faust(
            options.faust, options.template, allow_missing=options.allow_missing
        )
    elif options.bodies is not None:
        bodies = rh.datasets.load_bodies(
            options.bodies,
            options.labels,
            options.template,
            unit=options.unit,
            up=options.up,
            allow_missing=options.allow_missing,
            progress=options.reporter.bars,
        )
    elif options.reader is not None:
        name, place = options.reader
        bodies = rh.extensions.extension("readers", name)(place)
        report = rh.testing.check_dataset(bodies)
        if not report.passed:
            raise ArgumentError(f"--reader {name} returns unusable bodies. {report}")
    else:
        people = options.people
        bodies = rh.datasets.load_open_bodies(resolution, options.open or "plain", people)
    return bodies


@command(
    "tables",
    "retrieval tables: who is it, how do they stand?",
    "Computes all distances between registered human bodies, and prints how well they find\n"
    "the same person (shape) and the same pose. The default data are the 100 open bodies\n"
    "that ship with the package, ten people in ten poses.",
    "  riemhuman tables\n"
    "  riemhuman tables --resolution coarse\n"
    "  riemhuman tables --open natural --people 1    # ten people not used in tuning\n"
    "  riemhuman tables --faust ~/MPI-FAUST\n"
    "  riemhuman tables --bodies scans/ --labels scans/labels.csv\n"
    "  riemhuman tables --all --resolution coarse    # also descriptors and model vectors\n",
    _BODY_SET,
    option(
        "--resolution",
        "resolution of the open bodies: 13,348 or 1,202 vertices",
        choices=("full", "coarse"),
        default="full",
    ),
    flag(
        "--all",
        "all representations, with mean average precision and times; takes minutes at full "
        "resolution",
    ),
    JSON,
)
def _tables(options: argparse.Namespace) -> Answer:
    _check_body_set(options)
    with options.reporter.task("Loading the bodies"):
        bodies = _read_body_set(options, options.resolution)
    n_people, n_poses = (
        "unknown" if labels is None else len(set(labels))
        for labels in (bodies.subject, bodies.pose)
    )
    head = (
        f"{len(bodies)} bodies: {n_people} people, {n_poses} poses, "
        f"{bodies.template.n_vertices:,} vertices, {bodies.template.n_faces:,} triangles"
    )
    if options.all:
        from riemhuman.report._representations import available, benchmark_notes

        with options.reporter.task("All representations"):
            bars = options.reporter.bars
            records = rh.report.benchmark(bodies, available(bodies), n_jobs=-1, progress=bars)
        parts = [head, rh.report.format_benchmark(records), *benchmark_notes(records)]
        return Answer("\n\n".join(parts), [asdict(record) for record in records])
    return _metric_tables(bodies, head, options)


def _metric_tables(bodies: Bodies, head: str, options: argparse.Namespace) -> Answer:
    from riemhuman.report._representations import metrics_of_extensions
    from riemhuman.report.retrieval_benchmark import table_metrics

    n_pairs = len(bodies) * (len(bodies) - 1) // 2
    distances = {}
    for name, metric in (table_metrics(bodies) | metrics_of_extensions(bodies)).items():
        with options.reporter.task(f"{name}: {n_pairs:,} distances"):
            distances[name] = metric.dist_pairwise(bodies.points, n_jobs=-1)
    learned = _learned_distances(bodies, options) if options.open == "natural" else {}
    tables = {
        question: rh.retrieval.retrieval_table(
            distances | learned.get(label, {}), getattr(bodies, label)
        )
        for label, question in _QUESTIONS.items()
        if getattr(bodies, label) is not None
    }
    if options.open == "natural":
        poses = distances | learned.get("pose", {})
        rows = rh.retrieval.retrieval_table(poses, bodies.pose, groups=bodies.subject)
        tables["How, among other people?"] = rows
    record = {
        title: {row.representation: asdict(row.scores) for row in rows}
        for title, rows in tables.items()
    }
    end = (
        "Per cent, each body against all others: NN nearest neighbour, FT and ST first and second "
        "tier."
    )
    if options.open == "natural":
        end += " Among other people: other bodies of the same person are left out."
    parts = [rh.retrieval.format_table(title, rows) for title, rows in tables.items()]
    return Answer("\n\n".join([head, *parts, end]), record)


def _learned_distances(
    bodies: Bodies, options: argparse.Namespace
) -> dict[str, dict[str, ndarray]]:
    """Return distances by label and name that are learned from other people's labels."""
    from riemhuman.report.retrieval_benchmark import LEARNED_METRIC, learned_distances

    try:
        with options.reporter.task(f"{LEARNED_METRIC}: distances"):
            distances = learned_distances(bodies)
    except MissingDependencyError:
        note("pip install '.[statistics]' adds the distances learned from labels")
        return {}
    labels = {"shape": "subject", "pose": "pose"}
    return {labels[task]: {LEARNED_METRIC: matrix} for task, matrix in distances.items()}


def _matrix_options(*, required: bool) -> Argument:
    return several(
        path_option("matrix", "NPZ", "distance matrix, see riemhuman matrix"),
        path_option(
            "--labels", "CSV", "table with the columns file, subject and pose", required=required
        ),
        flag("--allow-missing", "leave out meshes without labels, and labels without a mesh"),
    )


def _read_matrix(file: Path) -> tuple[ndarray, list[str]]:
    arrays: dict[str, Any] = rh.io.load_arrays(file, ["distances", "names"])
    distances, names = arrays["distances"], [str(name) for name in arrays["names"]]
    if distances.shape != (len(names), len(names)):
        raise FileFormatError(
            f"{file}: distances must be a matrix with a row and a column for each of its "
            f"{len(names)} names; found shape {distances.shape}"
        )
    return distances, names


def _read_labelled_matrix(options: argparse.Namespace) -> tuple[ndarray, dict[str, list[str]]]:
    """Return the distances between the meshes with labels, and their labels."""
    distances, names = _read_matrix(options.matrix)
    numbers, labels = rh.datasets.read_labels(
        options.labels, names, allow_missing=options.allow_missing
    )
    return distances[numbers][:, numbers], labels


@command(
    "scores",
    "how well a distance matrix finds people and poses",
    "Prints how many of the nearest meshes share the person, and how many share the pose:\n"
    "nearest neighbour (NN), first and second tier (FT, ST) and mean average precision\n"
    "(mAP), per cent.",
    "  riemhuman scores D.npz --labels labels.csv\n"
    "  riemhuman scores D.npz --labels labels.csv --json\n",
    _matrix_options(required=True),
    JSON,
)
def _scores(options: argparse.Namespace) -> Answer:
    distances, both = _read_labelled_matrix(options)
    scores = {
        name: rh.retrieval.scores(distances, labels)
        for name, labels in both.items()
        if len(set(labels)) < len(labels)
    }
    if not scores:
        raise ArgumentError(f"{options.labels}: no two meshes share a subject or a pose")
    said = [f"{'':<20}{'NN':>8}{'FT':>8}{'ST':>8}{'mAP':>8}"]
    for name, own in scores.items():
        values = (own.nn, own.first_tier, own.second_tier, own.mean_average_precision)
        said.append(f"{_QUESTIONS[name]:<20}{''.join(f'{value:8.1f}' for value in values)}")
    return Answer("\n".join(said), {name: asdict(own) for name, own in scores.items()})


@command(
    "plot",
    "a map of a distance matrix",
    "Draws the meshes of a distance matrix, see riemhuman matrix, as points in the plane by\n"
    "multidimensional scaling, or by t-SNE, which preserves neighbourhoods. Points have the\n"
    "names of their files, or the colours of their labels.",
    "  riemhuman plot D.npz -o map.png\n"
    "  riemhuman plot D.npz --labels labels.csv -o people.svg\n"
    "  riemhuman plot D.npz --labels labels.csv --by pose --method t-sne -o poses.pdf\n",
    _matrix_options(required=False),
    output("FILE", "picture to write: .png, .svg or .pdf"),
    option("--by", "label that the colours show", choices=tuple(_QUESTIONS), default="subject"),
    option("--method", "method that places the points", choices=("mds", "t-sne"), default="mds"),
)
def _plot(options: argparse.Namespace) -> Answer:
    import numpy as np

    from riemhuman.optional import import_optional

    check_file(options.output, (".png", ".svg", ".pdf"), options)
    import_optional("matplotlib", "plot")
    classes, item_names = None, None
    if options.labels is None:
        distances, names = _read_matrix(options.matrix)
        item_names, items = [Path(name).stem for name in names], np.zeros(len(names), dtype=int)
    else:
        distances, both = _read_labelled_matrix(options)
        values, items = np.unique(both[options.by], return_inverse=True)
        classes = [str(name) for name in values]
    positions = rh.plots.embed(distances, options.method)
    stress = rh.plots.stress(distances, positions) if options.method == "mds" else None
    with rh.plots.figure_style():
        figure = rh.plots.new_figure(6.0, 4.9)
        ax = rh.plots.plot_embedding(
            positions,
            items,
            classes,
            item_names=item_names,
            unit=None if stress is None else "m",
            ax=figure.subplots(),
        )
        if stress is None:
            ax.set_xlabel("Near points are similar bodies (t-SNE); their distances have no unit.")
        else:
            ax.set_xlabel(
                "Points are as far from each other as their bodies under the metric, in metres,\n"
                f"as well as a plane allows (stress {stress:.2f}; 0 would preserve all distances)."
            )
        save_figure(figure, options.output)
    text = lines(
        meshes=f"{len(items)}, {options.method}",
        stress=None if stress is None else f"{stress:.3f}  (0 would preserve all distances)",
        written_to=options.output,
    )
    return Answer(text)


@command(
    "report",
    "a page with the paper's experiments",
    "Repeats the paper's experiments and writes a report into a folder: index.html, which\n"
    "needs no network connection, figures, tables, matrices and their provenance. The default\n"
    "data are the open bodies that ship with the package. Results of an earlier run are\n"
    "reused.",
    "  riemhuman report\n"
    "  riemhuman report --quick -o quick-report\n"
    "  riemhuman report --open natural -o natural-report\n"
    "  riemhuman report --faust ~/MPI-FAUST --dfaust registrations_m.hdf5 -o faust-report\n"
    "  riemhuman report --bodies scans/ --labels scans/labels.csv -o scans-report\n",
    _BODY_SET,
    option("--dfaust", "motions of Dynamic FAUST for the basis of geodesics", metavar="FILE"),
    path_option(
        "-o --output",
        "FOLDER",
        "folder to write (default: riemhuman-report)",
        default=Path("riemhuman-report"),
    ),
    path_option(
        "--scans",
        "FOLDER",
        "also show the scans that riemhuman register has registered into this folder",
    ),
    flag("--quick", "a smaller report, in half a minute"),
)
def _report(options: argparse.Namespace) -> Answer:
    _check_body_set(options)
    reporter = options.reporter
    with reporter.task("Loading the bodies"):
        bodies = _read_body_set(options, "coarse" if options.quick else "full")
    basis = None
    if options.dfaust is not None:
        with reporter.task("Basis of Dynamic FAUST"):
            motions = rh.datasets.load_dfaust(options.dfaust)
            basis = rh.DeformationBasis.from_motions(motions, _N_COMPONENTS, progress=reporter.bars)
    page = rh.report.make_report(
        options.output,
        bodies=bodies,
        basis=basis,
        quick=options.quick,
        scans=options.scans,
        progress=reporter.task,
        bars=reporter.bars,
    )
    return Answer(str(page))
