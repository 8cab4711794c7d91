"""Shape and pose codes, after Zhou, Bhatnagar and Pons-Moll."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import partial
from types import MappingProxyType, ModuleType
from typing import Any, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.errors import ArgumentError
from riemhuman.learned.codes import PairedCodes
from riemhuman.learned.networks import in_single_precision, network
from riemhuman.learned.part_features import part_arrays, read_parts, scales_of
from riemhuman.learned.parts import Parts, find_parts
from riemhuman.learned.weight_files import Weights, check_training_bodies
from riemhuman.surfaces.template import Template

# Number of bodies that parts are found from, and of vertices in the loss of a step.
_BODIES_OF_PARTS, _VERTICES_OF_STEP = 500, 300
# Error of a vertex with loss one, in metres, and the weight of self-consistency.
_ERROR, _CYCLE = 0.02, 0.3


class ShapePoseCodes(PairedCodes):
    r"""Two codes of a body by an autoencoder: one of the person, and one of the pose.

    After Zhou, Bhatnagar and Pons-Moll [1]_: one encoder computes a shape code, another a pose
    code, and a decoder rebuilds the body from both. Training uses labels of people, but none of
    poses. The loss has two parts:

    - cross-consistency: the error of a body that is decoded from its own pose code and the shape
      code of the same person in another pose;
    - self-consistency: the decoder makes a body from the shape code of one person and the pose code
      of another. Its own codes must equal these, and its pose code with the second person's
      shape code must give the second person's body.

    Instead of convolutions on the mesh, the networks use rotations and stretches of parts, see
    `riemhuman.learned.parts`: the shape code depends on the stretches of parts, the pose code on
    their rotations relative to their neighbours, and the decoder gives both. Codes therefore do not
    depend on the body's position and orientation.

    Parameters
    ----------
    template : Template
        Template of the bodies; it must be connected.
    n_shape, n_pose : int
        Numbers of entries of the codes.
    batch_size : int
        Number of pairs of people per step, each person in two poses.

    Attributes
    ----------
    parts_ : Parts
        The parts.
    parameters_ : dict of str to array
        Parameters of the networks.
    losses_ : array, shape (n_steps,)
        Loss at each step; only after `fit`.

    References
    ----------
    .. [1] Zhou, Bhatnagar, Pons-Moll, "Unsupervised shape and pose disentanglement for 3D meshes",
       ECCV 2020.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> codes = rh.learned.ShapePoseCodes.load_pretrained(bodies.template)
    >>> found = codes.transform(bodies.points[:2])
    >>> shape, pose = codes.split(found)
    >>> shape.shape, pose.shape, codes.inverse_transform(found).shape
    ((2, 16), (2, 64), (2, 1202, 3))
    """

    parts_: Parts

    code_names = ("shape", "pose")
    _SETTINGS = ("n_shape", "n_pose", "n_parts", "n_hidden")
    _SHIPPED = MappingProxyType({None: "shape_pose_codes.npz"})

    def __init__(
        self,
        template: Template | None = None,
        n_shape: int = 16,
        n_pose: int = 64,
        *,
        n_parts: int = 96,
        n_hidden: int = 192,
        n_steps: int = 3000,
        batch_size: int = 32,
        learning_rate: float = 2e-3,
        random_state: int = 0,
    ) -> None:
        self.template = template
        self.n_shape = n_shape
        self.n_pose = n_pose
        self.n_parts = n_parts
        self.n_hidden = n_hidden
        self.n_steps = n_steps
        self.batch_size = batch_size
        self.learning_rate = learning_rate
        self.random_state = random_state

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        checkpoint: str | os.PathLike[str] | None = None,
        progress: bool = False,
    ) -> Self:
        """Train the networks, on at least two people in at least two poses each.

        People with only one body are left out.

        Raises
        ------
        MissingDependencyError
            If PyTorch is not installed.
        ArgumentError
            If bodies, labels or parameters are wrong.
        DegenerateSurfaceError
            If a triangle has no area.
        FileFormatError
            If the checkpoint is from another training.
        """
        rng = self._generator("batch_size")
        template, points = check_training_bodies(self.template, X)
        self._start_on(template)
        points, bodies_of = _by_person(points, y)
        some = rng.permutation(len(points))[:_BODIES_OF_PARTS]
        self.parts_ = find_parts(self._home, points[some], self.n_parts, rng)
        features, frames = self.parts_.split(points)
        self._center, self._scale = scales_of(features)
        features = (features - self._center) / self._scale
        placed = (points - points.mean(axis=1, keepdims=True)) @ frames
        data = {
            "features": features,
            "points": placed,
            "center": self._center,
            "scale": self._scale,
            "operator": self.parts_.operator,
        }
        start = self._initial(features, bodies_of, rng)

        loss = partial(self._loss, bodies_of=bodies_of)
        self._train(start, data, loss, checkpoint, progress)
        self._center, self._scale = map(in_single_precision, (self._center, self._scale))
        return self

    def transform(self, X: ArrayLike) -> ndarray:
        """Return the codes of bodies.

        Returns
        -------
        array, shape (n, n_shape + n_pose)
            The shape code, then the pose code, see `split`.

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the bodies do not fit the template.
        DegenerateSurfaceError
            If a triangle has no area.
        """
        points = self._home_points(X)
        features, _ = self.parts_.split(points)
        features = (features - self._center) / self._scale
        return np.concatenate(self._encoded(self._used, features), axis=1)

    def inverse_transform(self, Z: ArrayLike) -> ndarray:
        """Return the bodies with given codes.

        Returns
        -------
        array, shape (n, V, 3)
            Bodies with the orientation of the template and their mean vertex at the origin, metres.

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the codes have another length.
        """
        self._require_fit("parameters_")
        codes = self._checked_codes(Z)
        features = self._decoded(self._used, codes) * self._scale + self._center
        return self._carried_back(self.parts_.surfaces(features))

    def transfer(self, X: ArrayLike, poses: ArrayLike) -> ndarray:
        """Return people in the poses of other bodies.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies that give the shapes, metres.
        poses : array_like, shape (n, V, 3)
            Bodies that give the poses, metres.

        Returns
        -------
        array, shape (n, V, 3)
            Bodies as `inverse_transform` returns them.

        Raises
        ------
        ArgumentError
            If the numbers of bodies differ, or the bodies do not fit the template.
        """
        people, others = self.transform(X), self.transform(poses)
        if len(people) != len(others):
            raise ArgumentError(
                f"X and poses must have the same length; found {len(people)} and {len(others)}"
            )
        mixed = [self.split(people)[0], self.split(others)[1]]
        return self.inverse_transform(np.concatenate(mixed, axis=1))

    def _encoded(self, parameters: Any, features: Any, backend: ModuleType = np) -> list[Any]:
        n_turns = 3 * self.parts_.n_parts
        return [
            network(parameters, "shape", features[:, n_turns:], backend),
            network(parameters, "pose", features[:, :n_turns], backend),
        ]

    @staticmethod
    def _decoded(parameters: Any, codes: Any, backend: ModuleType = np) -> Any:
        found = [network(parameters, name, codes, backend) for name in ("turns", "stretches")]
        return backend.concatenate(found, 1)

    def _loss(
        self,
        torch: ModuleType,
        parameters: Mapping[str, Any],
        data: Mapping[str, Any],
        rng: np.random.Generator,
        bodies_of: list[ndarray],
    ) -> Any:
        size = min(self.batch_size, len(bodies_of) // 2)
        people = rng.permutation(len(bodies_of))[: 2 * size]
        chosen = np.array([rng.choice(bodies_of[person], 2, replace=False) for person in people])
        # One person in two poses, and another person in two poses.
        first, second = chosen.T
        numbers = np.concatenate([first, second])
        vertices = rng.permutation(data["operator"].shape[0])[:_VERTICES_OF_STEP]
        operator = data["operator"][vertices]
        features = data["features"][numbers]
        wanted = data["points"][numbers][:, vertices]

        def surfaces(decoded: Any) -> Any:
            return self.parts_.surfaces(decoded * data["scale"] + data["center"], torch, operator)

        def missed(found: Any, wanted: Any) -> Any:
            return ((found - wanted) ** 2).sum(-1).mean() / _ERROR**2

        shape, pose = self._encoded(parameters, features, torch)
        n_bodies = 2 * size
        swapped = torch.concatenate([shape[n_bodies:], shape[:n_bodies]], 0)
        decoded = self._decoded(parameters, torch.concatenate([swapped, pose], 1), torch)
        crossed = missed(surfaces(decoded), wanted) + ((decoded - features) ** 2).mean()

        # Shapes of the first half of the people in poses of the other half.
        here, there = slice(0, size), slice(size, n_bodies)
        mixed = torch.concatenate([shape[here], pose[there]], 1)
        again_shape, again_pose = self._encoded(
            parameters, self._decoded(parameters, mixed, torch), torch
        )
        back = self._decoded(parameters, torch.concatenate([shape[there], again_pose], 1), torch)
        cycle = missed(surfaces(back), wanted[there])
        cycle = cycle + ((again_shape - shape[here].detach()) ** 2).mean()
        same = ((shape[:n_bodies] - shape[n_bodies:]) ** 2).mean()
        return crossed + _CYCLE * (cycle + 2.0 * same)

    def _initial(
        self, features: ndarray, bodies_of: list[ndarray], rng: np.random.Generator
    ) -> dict[str, ndarray]:
        """Return initial networks that compute principal components."""
        n_turns, n_codes = 3 * self.parts_.n_parts, self.n_shape + self.n_pose
        found = self._initial_networks(rng)
        means = np.stack([features[bodies, n_turns:].mean(axis=0) for bodies in bodies_of])
        shapes, spreads = _components(means, self.n_shape)
        poses, widths = _components(features[:, :n_turns], self.n_pose)
        width = widths[widths > 0].mean() if widths.any() else 1.0
        spreads = np.where(spreads > 0, spreads, 1.0)
        turns, stretches = np.zeros((n_codes, n_turns)), np.zeros((n_codes, 2 * n_turns))
        turns[self.n_shape :] = width * poses.T
        stretches[: self.n_shape] = (shapes * spreads).T
        linear = {"shape": shapes / spreads, "pose": poses / width}
        linear |= {"turns": turns, "stretches": stretches}
        return found | {f"{name}.L": part.astype(np.float32) for name, part in linear.items()}

    def _sizes(self) -> dict[str, tuple[int, int]]:
        n_turns, n_stretches = 3 * self.parts_.n_parts, 6 * self.parts_.n_parts
        n_codes = self.n_shape + self.n_pose
        return {
            "shape": (n_stretches, self.n_shape),
            "pose": (n_turns, self.n_pose),
            "turns": (n_codes, n_turns),
            "stretches": (n_codes, n_stretches),
        }

    def _settings(self) -> dict[str, int]:
        return super()._settings() | {"n_parts": self.parts_.n_parts}

    def _arrays(self) -> dict[str, ndarray]:
        scales = {"center": self._center, "scale": self._scale}
        single = {name: numbers.astype(np.float32) for name, numbers in scales.items()}
        return self.parameters_ | single | part_arrays(self.parts_)

    def _read(self, weights: Weights) -> None:
        self.parts_ = read_parts(weights, self._home, self.n_parts)
        self._center = weights.numbers("center", (9 * self.parts_.n_parts,))
        self._scale = weights.numbers("scale", (9 * self.parts_.n_parts,), positive=True)
        self._read_networks(weights, {})


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
