"""Intrinsic and extrinsic codes of point clouds, after Aumentado-Armstrong et al."""

from __future__ import annotations

import os
from collections.abc import Mapping
from copy import copy
from types import MappingProxyType, ModuleType
from typing import Any, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.learned.codes import PairedCodes, checked_template
from riemhuman.learned.networks import in_single_precision, network
from riemhuman.learned.point_clouds import (
    cloud_features,
    cloud_shapes,
    initial_cloud,
    surface_points,
)
from riemhuman.learned.weight_files import Weights, check_training_bodies
from riemhuman.progress import ProgressBar
from riemhuman.surfaces.spectra import spectrum
from riemhuman.surfaces.template import Template

# Errors with loss one: of a point, in metres, and of the logarithm of an eigenvalue.
_ERROR, _LOGARITHM = 0.03, 0.02
# Standard deviation of the noise on codes, and the weights of their size and covariances.
_NOISE, _SIZE, _COVARIANCE = 0.05, 1e-3, 1.0
# Number of clouds of a body whose codes are averaged, and the seed of their points.
_CLOUDS, _SEED_OF_POINTS = 4, 0


class IntrinsicExtrinsicCodes(PairedCodes):
    r"""Two codes of a point cloud: one of what bending does not change, and one of the rest.

    After the geometrically disentangled autoencoder of Aumentado-Armstrong et al. [1]_ (GDVAE).
    Training needs no labels, and codes need no registered mesh: the network reads points spread
    over a surface. It predicts the spectrum of the Laplace–Beltrami operator, which bending does
    not change, from the intrinsic code alone, and the positions of points of the template from both
    codes. The loss also penalises covariances between the two codes. Unlike in [1]_, the noise on
    codes has a fixed size, the decoder gives points in correspondence, and bodies must be upright
    and face forward: rotations are not learned.

    Parameters
    ----------
    template : Template
        Template of the bodies in training.
    n_intrinsic, n_extrinsic : int
        Numbers of entries of the codes.
    n_points : int
        Number of points of a cloud.
    n_eigenvalues : int
        Number of eigenvalues.
    n_hidden, n_features : int
        Sizes of the hidden layers, and number of features of a cloud.
    batch_size : int
        Number of clouds per step.

    Attributes
    ----------
    parameters_ : dict of str to array
        Parameters of the networks.
    vertices_ : array of int, shape (n_points,)
        Vertices of the template that `inverse_transform` returns.
    losses_ : array, shape (n_steps,)
        Loss at each step; only after `fit`.

    References
    ----------
    .. [1] Aumentado-Armstrong, Tsogkas, Jepson, Dickinson, "Geometric disentanglement for
       generative latent shape models", ICCV 2019.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> codes = rh.learned.IntrinsicExtrinsicCodes.load_pretrained(bodies.template)
    >>> intrinsic, extrinsic = codes.split(codes.transform(bodies.points[:2]))
    >>> intrinsic.shape, extrinsic.shape
    ((2, 10), (2, 24))
    """

    vertices_: ndarray

    code_names = ("intrinsic", "extrinsic")
    _WIDTH = 2
    _SETTINGS = (
        "n_intrinsic",
        "n_extrinsic",
        "n_points",
        "n_eigenvalues",
        "n_hidden",
        "n_features",
    )
    _SHIPPED = MappingProxyType({None: "intrinsic_extrinsic_codes.npz"})

    def __init__(
        self,
        template: Template | None = None,
        n_intrinsic: int = 10,
        n_extrinsic: int = 24,
        *,
        n_points: int = 300,
        n_eigenvalues: int = 16,
        n_hidden: int = 48,
        n_features: int = 256,
        n_steps: int = 3000,
        batch_size: int = 32,
        learning_rate: float = 1e-3,
        random_state: int = 0,
    ) -> None:
        self.template = template
        self.n_intrinsic = n_intrinsic
        self.n_extrinsic = n_extrinsic
        self.n_points = n_points
        self.n_eigenvalues = n_eigenvalues
        self.n_hidden = n_hidden
        self.n_features = n_features
        self.n_steps = n_steps
        self.batch_size = batch_size
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
        """Train the networks, on bodies that are upright and face forward.

        Raises
        ------
        MissingDependencyError
            If PyTorch is not installed.
        ArgumentError
            If bodies or parameters are wrong.
        DegenerateSurfaceError
            If a triangle has no area.
        FileFormatError
            If the checkpoint is from another training.
        """
        rng = self._generator("batch_size")
        template, points = check_training_bodies(self.template, X)
        if self.n_points > template.n_vertices:
            raise ArgumentError(
                f"n_points={self.n_points} exceeds the {template.n_vertices} vertices"
            )
        self._start_on(template)
        self.vertices_ = np.sort(rng.permutation(template.n_vertices)[: self.n_points])
        bar = ProgressBar(points, disable=not progress, unit="body", desc="spectra")
        values = np.log([spectrum(f, template.faces, self.n_eigenvalues).eigenvalues for f in bar])
        self._spectrum = values.mean(axis=0)
        # Two clouds of each body: the network shall learn the body, not the points.
        clouds = np.stack(
            [[surface_points(f, template.faces, self.n_points, rng) for _ in "ab"] for f in points]
        )
        placed = points[:, self.vertices_] - points.mean(axis=1, keepdims=True)
        self._place = placed.mean(axis=0)
        data = {"clouds": clouds, "points": placed - self._place, "values": values - self._spectrum}
        start = initial_cloud(self.n_hidden, self.n_features, rng)
        start |= self._initial_networks(rng)
        self._train(start, data, self._loss, checkpoint, progress)
        self._place, self._spectrum = map(in_single_precision, (self._place, self._spectrum))
        return self

    def on(self, template: Template, correspondence: Any = None) -> Self:
        """Return the same network for bodies over another template.

        Parameters
        ----------
        template : Template
            The other template; these codes need no correspondence.
        correspondence : object
            Ignored.

        Raises
        ------
        ArgumentTypeError
            If `template` is not a template.
        ArgumentError
            If nothing was fitted.
        """
        self._require_fit("parameters_")
        other = copy(self)
        other._template = checked_template(template)
        return other

    def transform(self, X: ArrayLike) -> ndarray:
        """Return the codes of bodies, which must be upright and face forward.

        Returns
        -------
        array, shape (n, n_intrinsic + n_extrinsic)
            The intrinsic code, then the extrinsic code, see `split`.

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the bodies do not fit the template.
        DegenerateSurfaceError
            If a body has no area.
        """
        points = self._checked_points(X)
        found = [self.describe(surface, self.template_.faces) for surface in points]
        return np.array(found).reshape(len(points), sum(self._n_codes))

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> ndarray:
        """Return the codes of any mesh.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres, y up, the body facing +z.
        faces : array_like, shape (F, 3)
            Vertex indices of each triangle, counted from 0.

        Returns
        -------
        array, shape (n_intrinsic + n_extrinsic,)

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the arrays are no mesh.
        DegenerateSurfaceError
            If the mesh has no area.
        """
        self._require_fit("parameters_")
        mesh = check_mesh(vertices, faces)
        self._check_scale(mesh[0], "vertices")
        rng = np.random.default_rng(_SEED_OF_POINTS)
        clouds = np.stack([surface_points(*mesh, self.n_points, rng) for _ in range(_CLOUDS)])
        return np.asarray(self._encoded(self._used, clouds).mean(axis=0))

    def inverse_transform(self, Z: ArrayLike) -> ndarray:
        """Return points of the bodies with given codes.

        Returns
        -------
        array, shape (n, n_points, 3)
            The vertices `vertices_` of the training template, relative to the body's mean vertex,
            metres.

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the codes have another length.
        """
        self._require_fit("parameters_")
        codes = self._checked_codes(Z)
        found = network(self._used, "points", codes)
        return found.reshape(len(codes), self.n_points, 3) + self._place

    def spectra(self, Z: ArrayLike) -> ndarray:
        """Return the eigenvalues that the network predicts from intrinsic codes.

        Parameters
        ----------
        Z : array_like, shape (n, n_intrinsic + n_extrinsic)
            Codes; the extrinsic ones have no effect.

        Returns
        -------
        array, shape (n, n_eigenvalues)
            Without zero, in 1 / metre².

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the codes have another length.
        """
        self._require_fit("parameters_")
        intrinsic, _ = self.split(Z)
        return np.exp(network(self._used, "spectrum", intrinsic) + self._spectrum)

    @staticmethod
    def _encoded(parameters: Any, clouds: Any, backend: ModuleType = np) -> Any:
        features = cloud_features(parameters, clouds, backend)
        return network(parameters, "codes", features, backend)

    def _loss(
        self,
        torch: ModuleType,
        parameters: Mapping[str, Any],
        data: Mapping[str, Any],
        rng: np.random.Generator,
    ) -> Any:
        size = min(self.batch_size, len(data["points"]))
        bodies = rng.permutation(len(data["points"]))[:size]
        codes = self._encoded(parameters, data["clouds"][bodies, rng.integers(2, size=size)], torch)
        deviations = codes - codes.mean(0)
        noise = rng.standard_normal(codes.shape).astype(np.float32)
        noisy = codes + _NOISE * torch.tensor(noise)
        placed = network(parameters, "points", noisy, torch).reshape(size, -1, 3)
        values = network(parameters, "spectrum", noisy[:, : self.n_intrinsic], torch)
        missed = ((placed - data["points"][bodies]) ** 2).sum(-1).mean() / _ERROR**2
        untold = ((values - data["values"][bodies]) ** 2).mean() / _LOGARITHM**2
        covariances = (
            torch.swapaxes(deviations[:, : self.n_intrinsic], 0, 1)
            @ deviations[:, self.n_intrinsic :]
        ) / size
        penalty = _SIZE * (codes**2).mean() + _COVARIANCE * (covariances**2).mean()
        return missed + untold + penalty

    def _sizes(self) -> dict[str, tuple[int, int]]:
        n_codes = self.n_intrinsic + self.n_extrinsic
        return {
            "codes": (self.n_features, n_codes),
            "points": (n_codes, 3 * self.n_points),
            "spectrum": (self.n_intrinsic, self.n_eigenvalues),
        }

    def _arrays(self) -> dict[str, ndarray]:
        return self.parameters_ | {
            "vertices": self.vertices_.astype(np.int32),
            "place": self._place.astype(np.float32),
            "mean_spectrum": self._spectrum.astype(np.float32),
        }

    def _read(self, weights: Weights) -> None:
        n_vertices = weights.template.n_vertices
        self.vertices_ = weights.indices("vertices", (self.n_points,), 0, n_vertices)
        self._place = weights.numbers("place", (self.n_points, 3))
        self._spectrum = weights.numbers("mean_spectrum", (self.n_eigenvalues,))
        self._read_networks(weights, cloud_shapes(self.n_hidden, self.n_features))
