"""Codes whose Euclidean distances approximate the distances of a metric."""

from __future__ import annotations

import os
from collections.abc import Mapping
from types import MappingProxyType, ModuleType
from typing import Any, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import RiemannianMetric
from riemhuman.learned.codes import Codes
from riemhuman.learned.networks import in_single_precision, network
from riemhuman.learned.part_features import part_arrays, read_parts
from riemhuman.learned.parts import Parts, find_parts
from riemhuman.learned.weight_files import Weights, check_training_bodies
from riemhuman.progress import ProgressBar

# Number of bodies that parts are found from, and of bodies in a block of distances.
_BODIES_OF_PARTS, _BLOCK = 300, 48


class MetricCodes(Codes):
    r"""Codes of bodies whose Euclidean distances approximate those of a metric.

    A network computes, from the mean deformation gradients and the stretches of parts (see
    `riemhuman.learned.parts`), vectors :math:`c` with :math:`|c_i - c_j| \approx d(f_i, f_j)`.
    Training minimises the mean of :math:`(|c_i - c_j| - d_{ij})^2 / (d_{ij} \bar d)` over pairs of
    bodies. Codes compare many bodies in the time of a matrix product. For exact nearest neighbours,
    give the bodies with the nearest codes to `NearestNeighbors.kneighbors` as `candidates`: it
    compares them first, and then others until none can be nearer.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric on surfaces over a template, with a closed-form distance.
    n_codes : int
        Number of entries of a code.

    Attributes
    ----------
    parts_ : Parts
        The parts.
    parameters_ : dict of str to array
        Parameters of the network.
    metric_ : str
        The expression that constructs the metric.
    losses_ : array, shape (n_steps,)
        Loss at each step; only after `fit`.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> codes = rh.learned.MetricCodes.load_pretrained(bodies.template, which="pose")
    >>> codes.transform(bodies.points[:2]).shape
    (2, 32)
    """

    parts_: Parts
    metric_: str

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
        """Train the network, on bodies over the metric's template.

        Distances are computed within blocks of about 48 bodies, in the given order: each block
        should hold bodies near each other and bodies far apart.

        Raises
        ------
        MissingDependencyError
            If PyTorch is not installed.
        ArgumentTypeError
            If there is no metric.
        ArgumentError
            If bodies or parameters are wrong.
        DegenerateSurfaceError
            If a triangle has no area.
        FileFormatError
            If the checkpoint is from another training.
        """
        rng = self._generator()
        if not isinstance(self.metric, RiemannianMetric):
            raise ArgumentTypeError(
                f"metric must be a RiemannianMetric; found {type(self.metric).__name__}"
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
        start = self._initial_networks(rng)
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

    def _sizes(self) -> dict[str, tuple[int, int]]:
        return {"codes": (15 * self.parts_.n_parts, self.n_codes)}

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
        self._scale = weights.numbers("scale", (n_in,), positive=True)
        self._unit = float(weights.numbers("unit", (), positive=True))
        self.metric_ = weights.text("metric")
        self._read_networks(weights, {})


def _principal(features: ndarray, count: int) -> ndarray:
    """Return principal directions, scaled to make distances about one."""
    values, vectors = np.linalg.eigh(features.T @ features / len(features))
    found = np.zeros((features.shape[1], count))
    n_found = min(count, len(values))
    found[:, :n_found] = vectors[:, ::-1][:, :n_found]
    return (found / np.sqrt(2.0 * max(values[-count:].sum(), 1e-12))).astype(np.float32)
