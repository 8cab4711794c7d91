"""The verb ``tables``: retrieval of people and of poses."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING

from riemhuman.cli.body_sets import add_body_sets, check_body_sets, read_body_set
from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_verb

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies


def add_verbs(verbs: Verbs) -> None:
    """Declare ``tables``.

    Parameters
    ----------
    verbs : argparse action
        The parser's verbs.
    """
    parser = add_verb(
        verbs,
        "tables",
        _run,
        "retrieval tables: who is it, how do they stand? (the default)",
        "Computes all distances between registered human bodies, and prints how well they find\n"
        "the same person (shape) and the same pose. The default data are the 100 open bodies\n"
        "that ship with the package, ten people in ten poses.",
        "  riemhuman\n"
        "  riemhuman tables --resolution coarse\n"
        "  riemhuman tables --open natural --people 1    # ten people not used in tuning\n"
        "  riemhuman tables --faust ~/MPI-FAUST\n"
        "  riemhuman tables --bodies scans/ --labels scans/labels.csv\n"
        "  riemhuman tables --all --resolution coarse    # also descriptors and model vectors\n",
    )
    add_body_sets(parser)
    parser.add_argument(
        "--resolution",
        choices=("full", "coarse"),
        default="full",
        help="resolution of the open bodies: 13,348 or 1,202 vertices (default: full)",
    )
    parser.add_argument(
        "--all",
        action="store_true",
        help="all representations, with mean average precision and times; takes "
        "minutes at full resolution",
    )
    add_json(parser)


def _run(options: argparse.Namespace) -> None:
    from riemhuman import retrieval
    from riemhuman.report.representations import metrics_of_extensions
    from riemhuman.report.retrieval_benchmark import table_metrics

    check_body_sets(options)
    watch = Reporter(options.quiet).task if options.json or options.quiet else _timed
    with watch("Loading the bodies"):
        bodies = read_body_set(options, options.resolution)
    if not options.json:
        n_people, n_poses = (
            "unknown" if labels is None else len(set(labels))
            for labels in (bodies.subject, bodies.pose)
        )
        say(
            f"  {len(bodies)} bodies: {n_people} people, {n_poses} poses, "
            f"{bodies.template.n_vertices:,} vertices, {bodies.template.n_faces:,} triangles"
        )

    if options.all:
        _compare_all(bodies, options)
        return

    n_pairs = len(bodies) * (len(bodies) - 1) // 2
    distances = {}
    for name, metric in (table_metrics(bodies) | metrics_of_extensions(bodies)).items():
        with watch(f"{name}: {n_pairs:,} distances"):
            distances[name] = metric.dist_pairwise(bodies.points, n_jobs=-1)

    questions = {"Who is it?": bodies.subject, "How do they stand?": bodies.pose}
    tables = {
        question: retrieval.retrieval_table(distances, labels)
        for question, labels in questions.items()
        if labels is not None
    }
    if options.json:
        say_json(
            {
                title: {row.representation: asdict(row.scores) for row in rows}
                for title, rows in tables.items()
            }
        )
        return
    for title, rows in tables.items():
        say(f"\n{retrieval.format_table(title, rows)}")
    say(
        "\nPer cent, each body against all others: NN nearest neighbour, FT and ST first and "
        "second tier."
    )


def _compare_all(bodies: Bodies, options: argparse.Namespace) -> None:
    from riemhuman.report import benchmark, format_benchmark
    from riemhuman.report.code_descriptors import LEARNED
    from riemhuman.report.representations import STRAIGHT, available

    reporter = Reporter(options.quiet)
    with reporter.task("All representations"):
        records = benchmark(bodies, available(bodies), n_jobs=-1, progress=reporter.bars)
    if options.json:
        say_json([asdict(record) for record in records])
        return
    say(f"\n{format_benchmark(records)}")
    say(
        "\nPer cent, each body against all others: NN nearest neighbour, FT and ST first and "
        "second tier,\nmAP mean average precision; an asterisk marks the best of a column."
    )
    if any(record.representation.endswith(STRAIGHT) for record in records):
        say(
            "\nMetrics called straight have no closed-form distance: their rows compare by the\n"
            "norm of the difference of two bodies, halfway between them."
        )
    if any(record.representation.endswith(LEARNED) for record in records):
        say(f"\n{_about_codes()}")


def _about_codes() -> str:
    """Return a note on the networks of the codes, with the paper's scores of the originals."""
    from riemhuman.report.paper import PAPER_TABLES

    printed = [
        f"{row[0]} {', '.join(f'{score:.1f}' for score in row[1:])} ({task})"
        for task, rows in PAPER_TABLES.items()
        for row in rows
        if row[0].startswith(("GDVAE", "Zhou"))
    ]
    return (
        "Codes are from networks after GDVAE and Zhou et al., trained on open bodies of other "
        "people in other\nposes. The paper's scores of the originals on FAUST (NN, FT, ST):\n"
        + "\n".join(f"  {line}" for line in printed)
    )


@contextmanager
def _timed(task: str) -> Iterator[None]:
    """Print the task, and then the time that it took."""
    sys.stdout.write(f"{task} ... ")
    sys.stdout.flush()
    start = time.perf_counter()
    try:
        yield
    except BaseException:
        say()
        raise
    say(f"{time.perf_counter() - start:.1f} s")
