"""The main job: tables of who it is, and how they stand."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from riemhuman.errors import RiemhumanError


def main(arguments: Sequence[str] | None = None) -> int:
    """Compute the paper's distances on a set of bodies and print the retrieval tables.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line arguments, by default those of the process.

    Returns
    -------
    int
        Exit code: 0, or 2 where the data cannot be used.
    """
    options = _parser().parse_args(arguments)
    try:
        _run(options)
    except RiemhumanError as error:
        print(f"riemhuman: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("riemhuman: interrupted", file=sys.stderr)
        return 130
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="riemhuman",
        description="Distances between registered human bodies, and how well they tell who it is "
        "(shape) and how they stand (pose).",
        epilog="Without arguments: the 100 open bodies that ship with the package, ten people in "
        "ten poses.",
    )
    parser.add_argument(
        "--faust",
        metavar="FOLDER",
        help="use the registrations of MPI FAUST (tr_reg_000.ply ... tr_reg_099.ply) instead",
    )
    parser.add_argument(
        "--resolution",
        choices=("full", "coarse"),
        default="full",
        help="resolution of the open bodies: 13,348 or 1,202 vertices (default: full)",
    )
    return parser


def _run(options: argparse.Namespace) -> None:
    # Loaded here so that --help and usage errors answer at once.
    from riemhuman import datasets, retrieval
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces, ElasticMetric
    from riemhuman.geometry.srnf import SRNFMetric

    with _timed("Loading the bodies"):
        if options.faust is None:
            bodies = datasets.load_open_bodies(options.resolution)
        else:
            bodies = datasets.load_faust(options.faust)
    n_people, n_poses = len(set(bodies.subject)), len(set(bodies.pose))
    print(
        f"  {len(bodies)} bodies: {n_people} people, {n_poses} poses, "
        f"{bodies.template.n_vertices:,} vertices, {bodies.template.n_faces:,} triangles"
    )

    space = AlignedSurfaces(bodies.template, equip=False)
    metrics = {
        "shape metric (1, 0.0001, 0)": ElasticMetric(space, a=1.0, lam=1e-4, c=0.0),
        "pose metric (0, 0, 1)": ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
        "SRNF": SRNFMetric(space),
    }
    n_pairs = len(bodies) * (len(bodies) - 1) // 2
    distances = {}
    for name, metric in metrics.items():
        with _timed(f"{name}: {n_pairs:,} distances"):
            distances[name] = metric.dist_pairwise(bodies.points, n_jobs=-1)

    for title, labels in (("Who is it?", bodies.subject), ("How do they stand?", bodies.pose)):
        rows = retrieval.retrieval_table(distances, labels)
        print(f"\n{retrieval.format_table(title, rows)}")
    print(
        "\nPer cent, every body against all others: NN nearest neighbour, FT and ST first and "
        "second tier."
    )


@contextmanager
def _timed(task: str) -> Iterator[None]:
    """Say what is being done, and how long it took."""
    print(f"{task} ...", end=" ", flush=True)
    start = time.perf_counter()
    try:
        yield
    except BaseException:
        print(flush=True)
        raise
    print(f"{time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    sys.exit(main())
