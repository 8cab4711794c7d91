"""Codes whose Euclidean distances are close to the distances of a metric."""

from __future__ import annotations

import os
from collections.abc import Mapping
from types import MappingProxyType, ModuleType
from typing import Any, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.learned.codes import Codes
from riemhuman.learned.networks import in_single_precision, initial_network, network, network_shapes
from riemhuman.learned.part_features import part_arrays, read_parts
from riemhuman.learned.parts import Parts, find_parts
from riemhuman.learned.weight_files import Weights, check_training_bodies
from riemhuman.progress import ProgressBar

_BODIES_OF_PARTS = 300
# Bodies all of whose distances are computed at a time.
_BLOCK = 48


class MetricCodes(Codes):
    r"""Codes of bodies whose Euclidean distances are nearly those of a metric.

    A network finds, from the mean deformation gradients and the stretches of parts (see
    `riemhuman.learned.parts`), vectors :math:`c` with :math:`|c_i - c_j| \approx d(f_i, f_j)`. What
    is small after training is the mean of :math:`(|c_i - c_j| - d_{ij})^2 / (d_{ij} \bar d)` over
    pairs of bodies. Many bodies are compared by their codes in the time of a matrix product.
    To be exact, give those of the nearest codes to `NearestNeighbors.kneighbors` as its
    `candidates`: it compares them first, and others until none can be nearer.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric on surfaces over a template, with a closed form of its distance.
    n_codes : int
        Number of entries of a code.
    n_parts : int
        Number of parts.
    n_hidden : int
        Size of the hidden layers.
    n_steps : int
        Number of steps of training.
    learning_rate : float
        Largest length of a step.
    random_state : int
        Seed.

    Attributes
    ----------
    parts_ : Parts
        The parts.
    parameters_ : dict of str to array
        Parameters of the network.
    metric_ : str
        How the metric was constructed.
    losses_ : array, shape (n_steps,)
        What was lost at every step; only after `fit`.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> codes = rh.learned.MetricCodes.load_pretrained(bodies.template, which="pose")
    >>> codes.transform(bodies.points[:2]).shape
    (2, 32)
    """

    parts_: Parts
    parameters_: dict[str, ndarray]
    metric_: str
    losses_: ndarray

    _SETTINGS = ("n_codes", "n_parts", "n_hidden")
    _SHIPPED = MappingProxyType(
        {"shape": "metric_codes_shape.npz", "pose": "metric_codes_pose.npz"}
    )

    def __init__(
        self,
        metric: RiemannianMetric | None = None,
        n_codes: int = 32,
        *,
        n_parts: int = 96,
        n_hidden: int = 128,
        n_steps: int = 3000,
        learning_rate: float = 2e-3,
        random_state: int = 0,
    ) -> None:
        self.metric = metric
        self.n_codes = n_codes
        self.n_parts = n_parts
        self.n_hidden = n_hidden
        self.n_steps = n_steps
        self.learning_rate = learning_rate
        self.random_state = random_state

    def fit(
        self,
        X: ArrayLike,
        y: object = None,
        *,
        checkpoint: str | os.PathLike[str] | None = None,
        progress: bool = False,
    ) -> Self:
        """Train the network.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies over the metric's template. Distances are computed within blocks of 48 of them,
            in the order given: let every block hold bodies near each other and bodies far apart.
        y : object
            Not used.
        checkpoint : path_like, optional
            An .npz file that is written as training goes on. If it exists, training goes on from
            there, and ends as if it had not stopped.
        progress : bool
            Whether to show progress bars.

        Returns
        -------
        MetricCodes
            The estimator itself.

        Raises
        ------
        MissingDependencyError
            If PyTorch is not installed.
        ArgumentTypeError
            If there is no metric.
        ArgumentError
            If bodies or parameters are wrong.
        """
        rng = self._generator()
        if not isinstance(self.metric, RiemannianMetric):
            raise ArgumentTypeError(
                f"metric must be a metric to train on; found {type(self.metric).__name__}"
            )
        template, points = check_training_bodies(getattr(self.metric.space, "template", None), X)
        self._start_on(template)
        self.metric_ = repr(self.metric)
        some = rng.permutation(len(points))[:_BODIES_OF_PARTS]
        self.parts_ = find_parts(template, points[some], self.n_parts, rng)
        features = self.parts_.gradients(points)
        self._center = features.mean(axis=0)
        # One scale for all gradients and one for all stretches: how much they vary matters.
        sizes = [9 * self.parts_.n_parts, 6 * self.parts_.n_parts]
        halves = np.split(features.std(axis=0), sizes[:1])
        self._scale = np.repeat([half.mean() for half in halves], sizes)
        features = (features - self._center) / self._scale

        n_blocks = max(1, len(points) // _BLOCK)
        blocks = np.array_split(np.arange(len(points)), n_blocks)
        size = min(len(block) for block in blocks)
        if size < 2:
            raise ArgumentError("X must hold at least two bodies")
        members = np.stack([block[:size] for block in blocks])
        bar = ProgressBar(members, disable=not progress, unit="block", desc="distances")
        distances = np.stack([self.metric.dist_pairwise(points[block]) for block in bar])
        self._unit = float(distances[distances > 0].mean()) if (distances > 0).any() else 1.0
        n_in = features.shape[1]
        start = initial_network("codes", n_in, self.n_hidden, self.n_codes, rng)
        start["codes.L"] = _principal(features, self.n_codes)
        data = {"features": features, "distances": distances / self._unit}

        def loss(
            torch: ModuleType,
            parameters: Mapping[str, Any],
            tensors: Mapping[str, Any],
            rng: np.random.Generator,
        ) -> Any:
            chosen = rng.integers(len(members), size=2)
            missed = 0.0
            for number in chosen:
                codes = network(parameters, "codes", tensors["features"][members[number]], torch)
                i, j = np.triu_indices(size, 1)
                found = torch.sqrt(((codes[i] - codes[j]) ** 2).sum(-1) + 1e-12)
                wanted = tensors["distances"][number][i, j]
                missed = missed + ((found - wanted) ** 2 / (wanted + 1e-3)).mean()
            return missed / len(chosen)

        self._train(start, data, loss, checkpoint, progress)
        self._center, self._scale = map(in_single_precision, (self._center, self._scale))
        self._unit = float(in_single_precision(self._unit))
        return self

    def transform(self, X: ArrayLike) -> ndarray:
        """Return the codes of bodies.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies over the template.

        Returns
        -------
        array, shape (n, n_codes)
            In the unit of the metric's distances.

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the bodies do not fit the template.
        DegenerateSurfaceError
            If a triangle has no area.
        """
        points = self._home_points(X)
        features = (self.parts_.gradients(points) - self._center) / self._scale
        return np.asarray(self._unit * network(self._used, "codes", features))

    def _settings(self) -> dict[str, int]:
        return super()._settings() | {"n_parts": self.parts_.n_parts}

    def _arrays(self) -> dict[str, ndarray]:
        scales = {"center": self._center, "scale": self._scale, "unit": self._unit}
        single = {name: np.array(value, dtype=np.float32) for name, value in scales.items()}
        named = {"metric": np.array(self.metric_)}
        return self.parameters_ | single | named | part_arrays(self.parts_)

    def _read(self, weights: Weights) -> None:
        n_in = 15 * self.n_parts
        self.parts_ = read_parts(weights, self._home, self.n_parts)
        self._center = weights.numbers("center", (n_in,))
        self._scale = weights.positive("scale", (n_in,))
        self._unit = float(weights.positive("unit", ()))
        self.metric_ = weights.text("metric")
        shapes = network_shapes("codes", n_in, self.n_hidden, self.n_codes)
        self._used = {name: weights.numbers(name, shape) for name, shape in shapes.items()}
        self.parameters_ = {name: array.astype(np.float16) for name, array in self._used.items()}


def _principal(features: ndarray, count: int) -> ndarray:
    """Return principal directions, scaled so that distances are about one."""
    values, vectors = np.linalg.eigh(features.T @ features / len(features))
    found = np.zeros((features.shape[1], count))
    n_found = min(count, len(values))
    found[:, :n_found] = vectors[:, ::-1][:, :n_found]
    return (found / np.sqrt(2.0 * max(values[-count:].sum(), 1e-12))).astype(np.float32)
