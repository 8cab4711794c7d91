"""The main job: tables of who it is, and how they stand."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from typing import TYPE_CHECKING

from riemhuman.cli.terminal import Reporter, say, say_json
from riemhuman.cli.verbs import Verbs, add_json, add_verb
from riemhuman.errors import ArgumentError

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies


def add_verbs(verbs: Verbs) -> None:
    """Declare ``tables``.

    Parameters
    ----------
    verbs : argparse action
        Where verbs are declared.
    """
    parser = add_verb(
        verbs,
        "tables",
        _run,
        "retrieval tables: who is it, how do they stand? (the main job)",
        "Distances between registered human bodies, and how well they tell who it is\n"
        "(shape) and how they stand (pose). Without options: the 100 open bodies that ship\n"
        "with the package, ten people in ten poses.",
        "  riemhuman\n"
        "  riemhuman tables --resolution coarse\n"
        "  riemhuman tables --faust ~/MPI-FAUST\n"
        "  riemhuman tables --bodies scans/ --labels scans/labels.csv\n"
        "  riemhuman tables --all --resolution coarse    # descriptors and model vectors too\n",
    )
    source = parser.add_mutually_exclusive_group()
    source.add_argument(
        "--faust",
        metavar="FOLDER",
        help="use the registrations of MPI FAUST (tr_reg_000.ply ... tr_reg_099.ply) instead",
    )
    source.add_argument(
        "--bodies",
        metavar="FOLDER",
        help="use the registered meshes of a folder instead; see --labels",
    )
    parser.add_argument(
        "--labels",
        metavar="CSV",
        help="with --bodies: who and in which pose, a table with the columns file, subject and "
        "pose (default: labels.csv in the folder)",
    )
    parser.add_argument(
        "--resolution",
        choices=("full", "coarse"),
        default="full",
        help="resolution of the open bodies: 13,348 or 1,202 vertices (default: full)",
    )
    parser.add_argument(
        "--all",
        action="store_true",
        help="every representation there is, with mean average precision and times; takes some "
        "minutes in full resolution",
    )
    add_json(parser)


def _run(options: argparse.Namespace) -> None:
    from riemhuman import retrieval
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
    from riemhuman.geometry.elastic_metric import ElasticMetric
    from riemhuman.geometry.srnf import SRNFMetric

    if options.labels is not None and options.bodies is None:
        raise ArgumentError("--labels goes with --bodies FOLDER")
    watch = Reporter(options.quiet).task if options.json or options.quiet else _timed
    with watch("Loading the bodies"):
        bodies = _bodies(options)
    if not options.json:
        n_people, n_poses = len(set(bodies.subject)), len(set(bodies.pose))
        say(
            f"  {len(bodies)} bodies: {n_people} people, {n_poses} poses, "
            f"{bodies.template.n_vertices:,} vertices, {bodies.template.n_faces:,} triangles"
        )

    if options.all:
        _compare_all(bodies, options)
        return

    space = AlignedSurfaces(bodies.template, equip=False)
    metrics = {
        "shape metric (1, 0.0001, 0)": ElasticMetric(space, a=1.0, lam=1e-4, c=0.0),
        "pose metric (0, 0, 1)": ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
        "SRNF": SRNFMetric(space),
    }
    n_pairs = len(bodies) * (len(bodies) - 1) // 2
    distances = {}
    for name, metric in metrics.items():
        with watch(f"{name}: {n_pairs:,} distances"):
            distances[name] = metric.dist_pairwise(bodies.points, n_jobs=-1)

    tables = {
        "Who is it?": retrieval.retrieval_table(distances, bodies.subject),
        "How do they stand?": retrieval.retrieval_table(distances, bodies.pose),
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
        "\nPer cent, every body against all others: NN nearest neighbour, FT and ST first and "
        "second tier."
    )


def _compare_all(bodies: Bodies, options: argparse.Namespace) -> None:
    from riemhuman import retrieval
    from riemhuman.report.representations import available

    reporter = Reporter(options.quiet)
    with reporter.task("All representations"):
        records = retrieval.benchmark(bodies, available(bodies), n_jobs=-1, progress=reporter.bars)
    if options.json:
        say_json([asdict(record) for record in records])
        return
    say(f"\n{retrieval.format_benchmark(records)}")
    say(
        "\nPer cent, every body against all others: NN nearest neighbour, FT and ST first and "
        "second tier,\nmAP mean average precision; an asterisk marks the best of a column."
    )


def _bodies(options: argparse.Namespace) -> Bodies:
    from riemhuman import datasets

    if options.faust is not None:
        return datasets.load_faust(options.faust)
    if options.bodies is not None:
        return datasets.load_bodies(options.bodies, options.labels)
    return datasets.load_open_bodies(options.resolution)


@contextmanager
def _timed(task: str) -> Iterator[None]:
    """Say what is being done, and how long it took."""
    sys.stdout.write(f"{task} ... ")
    sys.stdout.flush()
    start = time.perf_counter()
    try:
        yield
    except BaseException:
        say()
        raise
    say(f"{time.perf_counter() - start:.1f} s")
