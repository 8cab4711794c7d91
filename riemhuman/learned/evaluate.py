"""Say how good the networks that ship are, on bodies that none of them has seen.

    python -m riemhuman.learned.evaluate [--only shape-pose]

prints the numbers of the model cards: on other random people in other random poses, and on the
open bodies, plain and natural, whose people and poses are no part of training.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence

import numpy as np
from numpy import ndarray
from scipy.spatial.distance import pdist
from scipy.stats import spearmanr

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.descriptors.spectra import spectrum
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.learned.build_weights import WEIGHTS
from riemhuman.learned.intrinsic_extrinsic_codes import IntrinsicExtrinsicCodes
from riemhuman.learned.metric_codes import MetricCodes
from riemhuman.learned.shape_pose_codes import ShapePoseCodes
from riemhuman.learned.training_bodies import random_bodies
from riemhuman.surfaces.procrustes import procrustes

UNSEEN = 1000
"""Seed of people and poses that no network was trained on."""

_PEOPLE, _POSES = 50, 2


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the numbers of the model cards.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line; the process's own by default.

    Returns
    -------
    status : int
        0.
    """
    parser = argparse.ArgumentParser(description="Say how good the networks that ship are.")
    parser.add_argument("--only", choices=tuple(_CARDS), action="append")
    options = parser.parse_args(arguments)
    for name in options.only or _CARDS:
        sys.stdout.write(f"\n{name}\n" + "".join(f"{row}\n" for row in _CARDS[name]()))
        sys.stdout.flush()
    return 0


class UnseenBodies:
    """Bodies of people and in poses that no network was trained on.

    Parameters
    ----------
    name : {"random", "plain", "natural"}
        Random people in random poses, or the open bodies of a variant.

    Attributes
    ----------
    points : array, shape (n, V, 3)
        Coarse surfaces.
    subject : array of int, shape (n,)
        Who it is.
    """

    def __init__(self, name: str) -> None:
        self.model = load_open_model("coarse")
        if name == "random":
            drawn = random_bodies(self.model, _PEOPLE, _POSES, rng=UNSEEN)
            self.points, self.subject, self._betas, self._poses = drawn
        else:
            bodies = load_open_bodies("coarse", name)
            self.points, self.subject = bodies.points, bodies.subject
            assert bodies.betas is not None
            assert bodies.pose_vectors is not None
            self._betas, self._poses = bodies.betas, bodies.pose_vectors

    def transfers(self) -> tuple[ndarray, ndarray, ndarray]:
        """Return people, poses of other people, and what the body model makes of both.

        Returns
        -------
        people, others : array of int, shape (n,)
            Numbers of bodies.
        truth : array, shape (n, V, 3)
            Each of the people in the pose of the other.
        """
        rng = np.random.default_rng(UNSEEN)
        people, others = np.arange(len(self.points)), np.empty(len(self.points), dtype=np.int64)
        for body in people:
            others[body] = rng.choice(np.flatnonzero(self.subject != self.subject[body]))
        return people, others, self.model(self._betas[people], self._poses[others])


def mean_error(found: ndarray, wanted: ndarray) -> float:
    """Return the mean distance of vertices, after the best rigid motion, in millimetres.

    Parameters
    ----------
    found, wanted : array, shape (n, V, 3)
        Surfaces, in metres.

    Returns
    -------
    float
    """
    moved = [procrustes(one, to=other) for one, other in zip(found, wanted, strict=True)]
    return float(1000.0 * np.linalg.norm(np.stack(moved) - wanted, axis=-1).mean())


def _shape_pose() -> list[str]:
    network = ShapePoseCodes.load_pretrained()
    rows = []
    for name in ("random", "plain", "natural"):
        bodies = UnseenBodies(name)
        codes = network.transform(bodies.points)
        shape, pose = network.split(codes)
        people, others, truth = bodies.transfers()
        mixed = network.inverse_transform(np.concatenate([shape[people], pose[others]], axis=1))
        again = network.inverse_transform(codes)
        rows.append(
            f"{name}: reconstruction {mean_error(again, bodies.points):.1f} mm, shape of one and "
            f"pose of another {mean_error(mixed, truth):.1f} mm"
        )
    return rows


def _metric(which: str) -> Callable[[], list[str]]:
    def card() -> list[str]:
        network = MetricCodes.load_pretrained(which=which)
        a, lam, c = WEIGHTS[which]
        rows = []
        for name in ("random", "plain", "natural"):
            bodies = UnseenBodies(name)
            space = AlignedSurfaces(bodies.model.template, equip=False)
            pairs = np.triu_indices(len(bodies.points), 1)
            metric = ElasticMetric(space, a=a, lam=lam, c=c)
            wanted = metric.dist_pairwise(bodies.points)[pairs]
            found = pdist(network.transform(bodies.points))
            error = np.abs(found - wanted) / wanted
            rows.append(
                f"{name}: error of a distance, mean {100 * error.mean():.1f} %, 95 of 100 pairs "
                f"within {100 * np.quantile(error, 0.95):.1f} %; rank correlation "
                f"{spearmanr(found, wanted).statistic:.4f}"
            )
        return rows

    return card


def _intrinsic_extrinsic() -> list[str]:
    network = IntrinsicExtrinsicCodes.load_pretrained()
    rows = []
    for name in ("random", "plain", "natural"):
        bodies = UnseenBodies(name)
        codes = network.transform(bodies.points)
        intrinsic, extrinsic = network.split(codes)
        people, others, truth = bodies.transfers()
        mixed = network.inverse_transform(
            np.concatenate([intrinsic[people], extrinsic[others]], axis=1)
        )
        seen = network.vertices_
        faces, count = bodies.model.faces, network.n_eigenvalues
        values = [spectrum(f, faces, count).eigenvalues for f in bodies.points]
        error = np.abs(network.spectra(codes) / np.stack(values) - 1.0).mean()
        again = network.inverse_transform(codes)
        rows.append(
            f"{name}: reconstruction {mean_error(again, bodies.points[:, seen]):.1f} mm, intrinsic "
            f"of one and extrinsic of another {mean_error(mixed, truth[:, seen]):.1f} mm, error of "
            f"an eigenvalue {100 * error:.1f} %"
        )
    return rows


_CARDS: dict[str, Callable[[], list[str]]] = {
    "shape-pose": _shape_pose,
    "intrinsic-extrinsic": _intrinsic_extrinsic,
    "metric-shape": _metric("shape"),
    "metric-pose": _metric("pose"),
}


if __name__ == "__main__":
    sys.exit(main())
