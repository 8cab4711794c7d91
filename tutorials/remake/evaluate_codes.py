"""Evaluate the networks that ship on bodies that they were not trained on.

    python tutorials/remake/evaluate_codes.py [--only shape-pose]

prints the numbers of the model cards: for other random people in other random poses, and for the
plain and natural open bodies, whose people and poses are not part of the training data.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy import ndarray
from training_bodies import random_bodies

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.learned import IntrinsicExtrinsicCodes, ShapePoseCodes
from riemhuman.learned._codes import PairedCodes
from riemhuman.surfaces.procrustes import procrustes
from riemhuman.surfaces.spectra import spectrum

UNSEEN = 1000
"""Seed of random people and poses that no network was trained on."""

_PEOPLE, _POSES = 50, 2


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the numbers of the model cards."""
    parser = argparse.ArgumentParser(description="Evaluate the networks that ship.")
    parser.add_argument("--only", choices=tuple(_CARDS), action="append")
    options = parser.parse_args(arguments)
    for name in options.only or _CARDS:
        sys.stdout.write(f"\n{name}\n")
        for variant in ("random", "plain", "natural"):
            sys.stdout.write(f"{variant}: {_CARDS[name](UnseenBodies(variant))}\n")
            sys.stdout.flush()


class UnseenBodies:
    """Bodies that no network was trained on: neither their people nor their poses.

    Parameters
    ----------
    name : {"random", "plain", "natural"}
        Random people in random poses, or a variant of the open bodies.

    Attributes
    ----------
    points : array, shape (n, V, 3)
        Surfaces at the coarse resolution, metres.
    subject : array of int, shape (n,)
        Number of the person.
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
        """Return pairs of bodies, and the person of the first in the pose of the second.

        Returns
        -------
        people, others : array of int, shape (n,)
            Numbers of the bodies that give the person and the pose.
        truth : array, shape (n, V, 3)
            The body model's surfaces, metres.
        """
        rng = np.random.default_rng(UNSEEN)
        people, others = np.arange(len(self.points)), np.empty(len(self.points), dtype=np.int64)
        for body in people:
            others[body] = rng.choice(np.flatnonzero(self.subject != self.subject[body]))
        return people, others, self.model(self._betas[people], self._poses[others])


def mean_error(surfaces: ndarray, expected: ndarray) -> float:
    """Return the mean distance of vertices after rigid alignment, in millimetres.

    Parameters
    ----------
    surfaces, expected : array, shape (n, V, 3)
        Surfaces, metres.

    Returns
    -------
    float
    """
    moved = [
        procrustes(surface, to=target) for surface, target in zip(surfaces, expected, strict=True)
    ]
    return float(1000.0 * np.linalg.norm(np.stack(moved) - expected, axis=-1).mean())


def _two_codes(network: PairedCodes, bodies: UnseenBodies, vertices: Any) -> str:
    codes = network.transform(bodies.points)
    first, second = network.split(codes)
    people, others, truth = bodies.transfers()
    mixed = network.inverse_transform(np.concatenate([first[people], second[others]], axis=1))
    again = mean_error(network.inverse_transform(codes), bodies.points[:, vertices])
    first_name, second_name = network.code_names
    return (
        f"reconstruction {again:.1f} mm, {first_name} of one and {second_name} of another "
        f"{mean_error(mixed, truth[:, vertices]):.1f} mm"
    )


def _shape_pose(bodies: UnseenBodies) -> str:
    return _two_codes(ShapePoseCodes.load_pretrained(), bodies, slice(None))


def _intrinsic_extrinsic(bodies: UnseenBodies) -> str:
    network = IntrinsicExtrinsicCodes.load_pretrained()
    faces, count = bodies.model.faces, network.n_eigenvalues
    exact = [spectrum(surface, faces, count).eigenvalues for surface in bodies.points]
    predicted = network.spectra(network.transform(bodies.points))
    error = np.abs(predicted / np.stack(exact) - 1.0).mean()
    return (
        f"{_two_codes(network, bodies, network.vertices_)}, error of an eigenvalue "
        f"{100 * error:.1f} %"
    )


_CARDS: dict[str, Callable[[UnseenBodies], str]] = {
    "shape-pose": _shape_pose,
    "intrinsic-extrinsic": _intrinsic_extrinsic,
}


if __name__ == "__main__":
    main()
