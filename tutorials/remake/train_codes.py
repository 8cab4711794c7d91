"""Train the networks that ship, or networks of your own bodies, with PyTorch.

    python tutorials/remake/train_codes.py [folder] [--only shape-pose]

trains on random people in random poses of the open body model and writes the weights, by default
over those that ship. Training runs on one thread, so the same versions of the packages write the
same files; an interrupted training continues from its last checkpoint beside the file.
`python tutorials/remake/evaluate_codes.py` prints how accurate the networks are. For your own
registered bodies, call `train_shape_pose` or `train_intrinsic_extrinsic`.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.cluster.vq import kmeans2
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree
from tqdm import tqdm
from training import (
    Training,
    initial_cloud,
    initial_networks,
    rotation_matrices,
    save_weights,
    train,
)
from training_bodies import random_bodies

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, FileError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.kernels.rotations import log, nearest_rotations
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.learned import IntrinsicExtrinsicCodes, ShapePoseCodes
from riemhuman.learned._codes import FOLDER
from riemhuman.learned._networks import network
from riemhuman.learned._parts import Parts, gradients
from riemhuman.learned.intrinsic_extrinsic_codes import CloudSizes, surface_points
from riemhuman.learned.intrinsic_extrinsic_codes import encoded as encoded_clouds
from riemhuman.learned.shape_pose_codes import ShapePoseSizes, decoded, encoded
from riemhuman.surfaces import Template
from riemhuman.surfaces.measures import adjacent_triangles
from riemhuman.surfaces.spectra import spectrum

# Shape and pose codes: bodies that parts are found from, vertices in the loss of a step, the error
# of a vertex with loss one, in metres, and the weight of self-consistency.
_BODIES_OF_PARTS, _VERTICES_OF_STEP = 500, 300
_ERROR, _CYCLE = 0.02, 0.3

# Least scales of rotations, in radians, and of stretches.
_LEAST_ROTATION, _LEAST_STRETCH = 0.05, 0.03

# Intrinsic and extrinsic codes: errors with loss one, of a point, in metres, and of the logarithm
# of an eigenvalue; standard deviation of the noise on codes, weights of their size and covariances.
_ERROR_OF_POINT, _LOGARITHM = 0.03, 0.02
_NOISE, _SIZE, _COVARIANCE = 0.05, 1e-3, 1.0

# Dimensions in which motions of triangles are compared, relative ridge of the regression of the
# weights of parts, and rounds of clustering.
_DIRECTIONS, _RIDGE, _ROUNDS = 64, 1e-5, 30

_SHAPE_POSE, _CLOUDS = ShapePoseSizes(), CloudSizes()
_USUAL, _SLOWER = Training(), Training(learning_rate=1e-3)


def train_shape_pose(
    template: Template,
    X: ArrayLike,
    y: ArrayLike,
    file: str | os.PathLike[str],
    sizes: ShapePoseSizes = _SHAPE_POSE,
    training: Training = _USUAL,
) -> tuple[ShapePoseCodes, ndarray]:
    """Train on bodies (n, V, 3) of people y (n,), and return the network in `file` and its losses.

    There must be two people in two poses each; `ShapePoseLoss` says what is learned.
    """
    _check_sizes(sizes)
    rng = np.random.default_rng(training.seed)
    points, bodies_of = _by_person(_check_bodies(template, X), y)
    some = rng.permutation(len(points))[:_BODIES_OF_PARTS]
    parts = find_parts(template, points[some], sizes.n_parts, rng)
    sizes = replace(sizes, n_parts=parts.n_parts)
    features, frames = parts.split(points)
    center = features.mean(axis=0)
    least = np.repeat([_LEAST_ROTATION, _LEAST_STRETCH], [3 * parts.n_parts, 6 * parts.n_parts])
    scale = np.maximum(features.std(axis=0), least)
    features = (features - center) / scale
    data = {
        "features": features,
        "points": (points - points.mean(axis=1, keepdims=True)) @ frames,
        "center": center,
        "scale": scale,
        "operator": parts.operator,
    }
    initial = initial_networks(sizes.networks(), rng)
    initial |= _principal_codes(sizes, features, bodies_of)
    loss = ShapePoseLoss(parts, bodies_of, training.batch_size)
    with single_threaded_libraries():
        parameters, losses = train(initial, data, loss, training)
    others = {
        "center": np.float32(center),
        "scale": np.float32(scale),
        "part_of": parts.part_of.astype(np.uint16),
        "part_weights": parts.weights.astype(np.float16),
        "part_parents": parts.parents.astype(np.int16),
    }
    save_weights(file, "ShapePoseCodes", asdict(sizes), template, {**parameters, **others})
    return ShapePoseCodes(file), losses


@dataclass(frozen=True, eq=False)
class ShapePoseLoss:
    """The loss of shape and pose codes, in two parts.

    - cross-consistency: the error of a body that is decoded from its own pose code and the shape
      code of the same person in another pose;
    - self-consistency: the decoder makes a body from the shape code of one person and the pose code
      of another. Its own codes must equal these, and its pose code with the second person's
      shape code must give the second person's body.
    """

    parts: Parts
    bodies_of: list[ndarray]  # the numbers of each person's bodies
    batch_size: int

    def __call__(
        self, torch: ModuleType, parameters: Any, data: Any, rng: np.random.Generator
    ) -> Any:
        size = min(self.batch_size, len(self.bodies_of) // 2)
        people = rng.permutation(len(self.bodies_of))[: 2 * size]
        pairs = [rng.choice(self.bodies_of[person], 2, replace=False) for person in people]
        # One person in two poses, and another person in two poses.
        first, second = np.array(pairs).T
        numbers = np.concatenate([first, second])
        vertices = rng.permutation(data["operator"].shape[0])[:_VERTICES_OF_STEP]
        features, wanted = data["features"][numbers], data["points"][numbers][:, vertices]
        shape, pose = encoded(parameters, features, self.parts.n_parts, torch)
        n_bodies = 2 * size
        swapped = torch.concatenate([shape[n_bodies:], shape[:n_bodies]], 0)
        remade = decoded(parameters, torch.concatenate([swapped, pose], 1), torch)
        crossed = self._error(torch, data, remade, vertices, wanted)
        crossed = crossed + ((remade - features) ** 2).mean()
        # Shapes of the first half of the people in poses of the other half.
        here, there = slice(0, size), slice(size, n_bodies)
        mixed = decoded(parameters, torch.concatenate([shape[here], pose[there]], 1), torch)
        again_shape, again_pose = encoded(parameters, mixed, self.parts.n_parts, torch)
        back = decoded(parameters, torch.concatenate([shape[there], again_pose], 1), torch)
        cycle = self._error(torch, data, back, vertices, wanted[there])
        cycle = cycle + ((again_shape - shape[here].detach()) ** 2).mean()
        same = ((shape[:n_bodies] - shape[n_bodies:]) ** 2).mean()
        return crossed + _CYCLE * (cycle + 2.0 * same)

    def _error(
        self, torch: ModuleType, data: Any, features: Any, vertices: ndarray, wanted: Any
    ) -> Any:
        """Return the mean squared error of some vertices of bodies."""
        surfaces = self.parts.surfaces(
            features * data["scale"] + data["center"],
            torch,
            data["operator"][vertices],
            rotation_matrices,
        )
        return ((surfaces - wanted) ** 2).sum(-1).mean() / _ERROR**2


def train_intrinsic_extrinsic(
    template: Template,
    X: ArrayLike,
    file: str | os.PathLike[str],
    sizes: CloudSizes = _CLOUDS,
    training: Training = _SLOWER,
) -> tuple[IntrinsicExtrinsicCodes, ndarray]:
    """Train on upright bodies (n, V, 3), and return the network in `file` and its losses.

    `CloudLoss` says what is learned.
    """
    _check_sizes(sizes)
    rng = np.random.default_rng(training.seed)
    points, n_points = _check_bodies(template, X), sizes.n_points
    if n_points > template.n_vertices:
        raise ArgumentError(f"n_points={n_points} exceeds the {template.n_vertices} vertices")
    vertices = np.sort(rng.permutation(template.n_vertices)[:n_points])
    bar = tqdm(points, disable=not training.progress, unit="body", desc="spectra")
    values = np.log([spectrum(f, template.faces, sizes.n_eigenvalues).eigenvalues for f in bar])
    mean_spectrum = values.mean(axis=0)
    # Two clouds of each body: the network shall learn the body, not the points.
    clouds = np.stack(
        [[surface_points(f, template.faces, n_points, rng) for _ in "ab"] for f in points]
    )
    placed = points[:, vertices] - points.mean(axis=1, keepdims=True)
    place = placed.mean(axis=0)
    data = {"clouds": clouds, "points": placed - place, "values": values - mean_spectrum}
    initial = initial_cloud(sizes.n_hidden, sizes.n_features, rng)
    initial |= initial_networks(sizes.networks(), rng)
    loss = CloudLoss(sizes.n_intrinsic, training.batch_size)
    with single_threaded_libraries():
        parameters, losses = train(initial, data, loss, training)
    others = {
        "vertices": vertices.astype(np.int32),
        "place": place.astype(np.float32),
        "mean_spectrum": mean_spectrum.astype(np.float32),
    }
    arrays = {**parameters, **others}
    save_weights(file, "IntrinsicExtrinsicCodes", asdict(sizes), template, arrays)
    return IntrinsicExtrinsicCodes(file), losses


@dataclass(frozen=True)
class CloudLoss:
    """The loss of intrinsic and extrinsic codes.

    It is the error of points and of the spectrum, which are predicted from noisy codes, and a
    penalty on covariances between the two codes.
    """

    n_intrinsic: int
    batch_size: int

    def __call__(
        self, torch: ModuleType, parameters: Any, data: Any, rng: np.random.Generator
    ) -> Any:
        size = min(self.batch_size, len(data["points"]))
        bodies = rng.permutation(len(data["points"]))[:size]
        clouds = data["clouds"][bodies, rng.integers(2, size=size)]
        codes = encoded_clouds(parameters, clouds, torch)
        deviations = codes - codes.mean(0)
        noise = rng.standard_normal(codes.shape).astype(np.float32)
        noisy = codes + _NOISE * torch.tensor(noise)
        placed = network(parameters, "points", noisy, torch).reshape(size, -1, 3)
        values = network(parameters, "spectrum", noisy[:, : self.n_intrinsic], torch)
        of_points = ((placed - data["points"][bodies]) ** 2).sum(-1).mean() / _ERROR_OF_POINT**2
        of_spectra = ((values - data["values"][bodies]) ** 2).mean() / _LOGARITHM**2
        intrinsic, extrinsic = deviations[:, : self.n_intrinsic], deviations[:, self.n_intrinsic :]
        covariances = (torch.swapaxes(intrinsic, 0, 1) @ extrinsic) / size
        penalty = _SIZE * (codes**2).mean() + _COVARIANCE * (covariances**2).mean()
        return of_points + of_spectra + penalty


def _check_bodies(template: Template, X: Any) -> ndarray:
    points: ndarray = template.check_points(X, "X")
    if points.ndim != 3 or len(points) < 2:
        raise ArgumentError(
            f"X must hold at least two surfaces, of shape (n, {template.n_vertices}, 3); found "
            f"shape {points.shape}"
        )
    AlignedSurfaces(template, equip=False).check_immersed(points, "X")
    return points


def _check_sizes(sizes: ShapePoseSizes | CloudSizes) -> None:
    for name, size in asdict(sizes).items():
        if size < 1:
            raise ArgumentError(f"{name} must be at least 1; found {size}")


def _principal_codes(
    sizes: ShapePoseSizes, features: ndarray, bodies_of: list[ndarray]
) -> dict[str, ndarray]:
    """Return initial linear parts that compute principal components."""
    n_rotations, n_codes = 3 * sizes.n_parts, sizes.n_shape + sizes.n_pose
    means = np.stack([features[bodies, n_rotations:].mean(axis=0) for bodies in bodies_of])
    shapes, spreads = _components(means, sizes.n_shape)
    poses, widths = _components(features[:, :n_rotations], sizes.n_pose)
    width = widths[widths > 0].mean() if widths.any() else 1.0
    spreads = np.where(spreads > 0, spreads, 1.0)
    rotations, stretches = np.zeros((n_codes, n_rotations)), np.zeros((n_codes, 2 * n_rotations))
    rotations[sizes.n_shape :] = width * poses.T
    stretches[: sizes.n_shape] = (shapes * spreads).T
    linear = {"shape": shapes / spreads, "pose": poses / width}
    linear |= {"turns": rotations, "stretches": stretches}
    return {f"{name}.L": part.astype(np.float32) for name, part in linear.items()}


def _by_person(points: ndarray, y: ArrayLike) -> tuple[ndarray, list[ndarray]]:
    """Return the bodies of people with more than one, and the numbers of each person's bodies."""
    labels = np.asarray(y)
    if labels.shape != (len(points),):
        raise ArgumentError(
            f"y must have shape ({len(points)},), one label per body; found {labels.shape}"
        )
    _, person = np.unique(labels, return_inverse=True)
    kept = np.bincount(person)[person] > 1
    points, person = points[kept], np.unique(person[kept], return_inverse=True)[1]
    n_people = int(person.max(initial=-1)) + 1
    if n_people < 2:
        raise ArgumentError(
            f"y must name at least two people in at least two poses each; found {n_people}"
        )
    return points, [np.flatnonzero(person == number) for number in range(n_people)]


def _components(rows: ndarray, count: int) -> tuple[ndarray, ndarray]:
    """Return principal directions as columns, and the deviations along them, padded with zeros."""
    directions, deviations = np.zeros((rows.shape[1], count)), np.zeros(count)
    values, vectors = np.linalg.eigh(rows.T @ rows / len(rows))
    n_found = min(count, len(values))
    directions[:, :n_found] = vectors[:, ::-1][:, :n_found]
    deviations[:n_found] = np.sqrt(np.maximum(values[::-1][:n_found], 0.0))
    return directions, deviations


def find_parts(
    template: Template, points: ndarray, n_parts: int, rng: np.random.Generator
) -> Parts:
    """Find at most so many parts whose triangles move alike on many bodies, (n, V, 3)."""
    areas, n_faces = template.face_areas, template.n_faces
    if n_parts >= n_faces:
        raise ArgumentError(
            f"n_parts={n_parts} must be less than the number of triangles, {n_faces}"
        )
    moved = gradients(template, points).transpose(1, 0, 2, 3).reshape(n_faces, -1)
    with single_threaded_libraries():
        scale = np.sqrt(areas)[:, None]
        directions, squares = _principal(scale * moved)
        # Motions of triangles, as metres that the end of a limb of one metre moves, and places.
        ways = directions * np.sqrt(squares / moved.shape[1]) / scale
        places = template.vertices[template.faces].mean(axis=1)
        part_of = kmeans2(
            np.concatenate([ways, places], axis=1), n_parts, _ROUNDS, minit="++", rng=rng
        )[1]
        _, part_of = np.unique(part_of, return_inverse=True)
        n_parts = int(part_of.max()) + 1
        sums = np.bincount(part_of, areas)
        means = sparse.csr_array((areas / sums[part_of], (part_of, np.arange(n_faces)))) @ moved
        products = means @ means.T
        products += _RIDGE * np.trace(products) / n_parts * np.eye(n_parts)
        weights = np.linalg.solve(products, means @ moved.T).T
    # In half precision, the precision of files.
    weights = weights.astype(np.float16).astype(np.float64)
    turns = nearest_rotations(means.reshape(n_parts, -1, 3, 3))
    return Parts(template, part_of, weights, _tree(template, part_of, turns))


def _principal(rows: ndarray) -> tuple[ndarray, ndarray]:
    """Return the leading left singular vectors as columns, and the squared singular values."""
    n_rows, n_columns = rows.shape
    kept = slice(-min(_DIRECTIONS, n_rows, n_columns), None)
    if n_rows <= n_columns:
        values, vectors = np.linalg.eigh(rows @ rows.T)
        return vectors[:, kept], np.maximum(values[kept], 0.0)
    values, vectors = np.linalg.eigh(rows.T @ rows)
    squares = np.maximum(values[kept], np.finfo(float).eps * values[-1])
    return rows @ vectors[:, kept] / np.sqrt(squares), squares


def _tree(template: Template, part_of: ndarray, turns: ndarray) -> ndarray:
    """Return the parent of each part: a neighbour with a similar rotation."""
    pairs = np.unique(np.sort(part_of[adjacent_triangles(template.faces)[0]], axis=1), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    angles = np.linalg.norm(log(turns[pairs[:, 0]], turns[pairs[:, 1]]), axis=-1)
    costs = np.sqrt(np.mean(angles**2, axis=1)) + 1e-6
    n_parts = len(turns)
    graph = sparse.csr_array((costs, tuple(pairs.T)), shape=(n_parts, n_parts))
    tree = minimum_spanning_tree(graph)
    root = int(np.argmax(np.bincount(part_of, template.face_areas)))
    reached, before = breadth_first_order(tree, root, directed=False)
    if len(reached) < n_parts:
        raise ArgumentError("template must be connected; found parts without neighbours")
    return np.where(before < 0, -1, before).astype(np.int64)


def _shape_pose(model: BodyModel, file: Path, checkpoint: Path) -> None:
    bodies = random_bodies(model, 2000, 4, rng=0)
    training = replace(_USUAL, checkpoint=checkpoint, progress=True)
    labels = bodies.subject
    train_shape_pose(model.template, bodies.points, labels, file, training=training)


def _intrinsic_extrinsic(model: BodyModel, file: Path, checkpoint: Path) -> None:
    bodies = random_bodies(model, 1000, 3, rng=1)
    training = replace(_SLOWER, checkpoint=checkpoint, progress=True)
    train_intrinsic_extrinsic(model.template, bodies.points, file, training=training)


RECIPES: dict[str, tuple[str, Callable[[BodyModel, Path, Path], None]]] = {
    "shape-pose": ("shape_pose_codes", _shape_pose),
    "intrinsic-extrinsic": ("intrinsic_extrinsic_codes", _intrinsic_extrinsic),
}
"""The networks that ship: the name of the file, and the function that trains them."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Train the networks and write their files."""
    parser = argparse.ArgumentParser(description="Train the networks that ship.")
    parser.add_argument("folder", nargs="?", type=Path, default=FOLDER)
    parser.add_argument("--only", choices=tuple(RECIPES), action="append")
    options = parser.parse_args(arguments)
    if not options.folder.is_dir():
        raise FileError(f"{options.folder} is not a folder; it must exist to receive the weights")
    for name in options.only or RECIPES:
        title, recipe = RECIPES[name]
        file = options.folder / f"{title}.npz"
        checkpoint = options.folder / f"{title}.checkpoint.npz"
        clock, work = time.perf_counter(), time.process_time()
        recipe(load_open_model("coarse"), file, checkpoint)
        checkpoint.unlink(missing_ok=True)
        sys.stdout.write(
            f"{file}: {file.stat().st_size / 1e6:.2f} MB, {time.process_time() - work:.0f} s of "
            f"one core, {time.perf_counter() - clock:.0f} s on the clock\n"
        )
        sys.stdout.flush()


if __name__ == "__main__":
    main()
