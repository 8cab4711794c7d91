"""Train the networks that ship, on random people in random poses of the open body model.

    python -m riemhuman.learned.build_weights [folder] [--only shape-pose]

writes their weights, by default over those that ship. It needs PyTorch. The same versions write
the same files: training runs on one thread. One that was interrupted goes on from its last
checkpoint beside the file. `python -m riemhuman.learned.evaluate` says how good they are.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

from riemhuman.datasets import load_open_model
from riemhuman.errors import FileError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.learned.codes import FOLDER, Codes
from riemhuman.learned.intrinsic_extrinsic_codes import IntrinsicExtrinsicCodes
from riemhuman.learned.metric_codes import MetricCodes
from riemhuman.learned.shape_pose_codes import ShapePoseCodes
from riemhuman.learned.training_bodies import random_bodies

WEIGHTS = {"shape": (1.0, 1e-4, 0.0), "pose": (0.0, 0.0, 1.0)}
"""Weights (a, λ, c) of the metrics that `MetricCodes` ships for."""
N_CODES = {"shape": 64, "pose": 32}
"""Lengths of their codes: under the metric of shapes, people are all far from each other."""


def shape_pose(checkpoint: Path) -> Codes:
    """Train `ShapePoseCodes`.

    Parameters
    ----------
    checkpoint : Path
        Where checkpoints are kept.

    Returns
    -------
    ShapePoseCodes
    """
    model = load_open_model("coarse")
    bodies = random_bodies(model, 2000, 4, rng=0)
    codes = ShapePoseCodes(model.template)
    return codes.fit(bodies.points, bodies.subject, checkpoint=checkpoint, progress=True)


def intrinsic_extrinsic(checkpoint: Path) -> Codes:
    """Train `IntrinsicExtrinsicCodes`.

    Parameters
    ----------
    checkpoint : Path
        Where checkpoints are kept.

    Returns
    -------
    IntrinsicExtrinsicCodes
    """
    model = load_open_model("coarse")
    bodies = random_bodies(model, 1000, 3, rng=1)
    codes = IntrinsicExtrinsicCodes(model.template)
    return codes.fit(bodies.points, checkpoint=checkpoint, progress=True)


def metric(which: str) -> Callable[[Path], Codes]:
    """Return what trains `MetricCodes`.

    Parameters
    ----------
    which : {"shape", "pose"}
        Which metric.

    Returns
    -------
    callable
        Takes the place of checkpoints to the codes.
    """
    a, lam, c = WEIGHTS[which]

    def train(checkpoint: Path) -> Codes:
        model = load_open_model("coarse")
        # Sixteen people in three poses make a block of distances.
        bodies = random_bodies(model, 1600, 3, rng=2)
        space = AlignedSurfaces(model.template, equip=False)
        codes = MetricCodes(ElasticMetric(space, a=a, lam=lam, c=c), N_CODES[which])
        return codes.fit(bodies.points, checkpoint=checkpoint, progress=True)

    return train


RECIPES: dict[str, tuple[str, Callable[[Path], Codes]]] = {
    "shape-pose": ("shape_pose_codes", shape_pose),
    "intrinsic-extrinsic": ("intrinsic_extrinsic_codes", intrinsic_extrinsic),
    "metric-shape": ("metric_codes_shape", metric("shape")),
    "metric-pose": ("metric_codes_pose", metric("pose")),
}
"""What ships: the name of its file and what trains it."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Train and write.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line; the process's own by default.

    Returns
    -------
    status : int
        0.

    Raises
    ------
    MissingDependencyError
        If PyTorch is not installed.
    FileError
        If the folder does not exist or cannot be written to.
    """
    parser = argparse.ArgumentParser(description="Train the networks that ship.")
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--only", choices=tuple(RECIPES), action="append")
    options = parser.parse_args(arguments)
    if not options.folder.is_dir():
        raise FileError(f"{options.folder} is not a folder; it must exist to receive the weights")
    for name in options.only or RECIPES:
        title, train = RECIPES[name]
        file = options.folder / f"{title}.npz"
        checkpoint = options.folder / f"{title}.checkpoint.npz"
        clock, work = time.perf_counter(), time.process_time()
        train(checkpoint).save(file)
        checkpoint.unlink(missing_ok=True)
        sys.stdout.write(
            f"{file}: {file.stat().st_size / 1e6:.2f} MB, {time.process_time() - work:.0f} s of "
            f"one core, {time.perf_counter() - clock:.0f} s on the clock\n"
        )
        sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
