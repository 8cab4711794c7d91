"""Intrinsic and extrinsic codes of point clouds, after Aumentado-Armstrong and others."""

from __future__ import annotations

import os
from collections.abc import Mapping
from copy import copy
from types import MappingProxyType, ModuleType
from typing import Any, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.descriptors.spectra import spectrum
from riemhuman.errors import ArgumentError
from riemhuman.learned.codes import Codes, checked_template
from riemhuman.learned.networks import in_single_precision, initial_network, network, network_shapes
from riemhuman.learned.point_clouds import (
    cloud_features,
    cloud_shapes,
    initial_cloud,
    surface_points,
)
from riemhuman.learned.weight_files import Weights, check_training_bodies
from riemhuman.progress import ProgressBar
from riemhuman.surfaces.mesh_arrays import mesh_arrays
from riemhuman.surfaces.template import Template

# What counts one: an error of a point in metres, and one of the logarithm of an eigenvalue.
_ERROR, _LOGARITHM = 0.03, 0.02
# What the noise on codes, their size and their covariances count.
_NOISE, _SIZE, _COVARIANCE = 0.05, 1e-3, 1.0
# Clouds of a body whose codes are averaged, and the seed of their points.
_CLOUDS, _SEED_OF_POINTS = 4, 0


class IntrinsicExtrinsicCodes(Codes):
    r"""Two codes of a cloud of points, one of what bending leaves alone and one of the rest.

    After the geometrically disentangled autoencoder of Aumentado-Armstrong and others [1]_ (GDVAE).
    Nobody is known by name, and no mesh is registered when codes are found: the network reads
    points spread over a surface. From the intrinsic code alone it must tell the spectrum of the
    Laplace–Beltrami operator, which bending leaves alone; from both codes it must tell where the
    points of the template are. Covariances between the two codes are made small. Other than
    in [1]_, codes carry noise of a fixed size, the decoder gives points that correspond, and bodies
    are taken upright and facing forward, as they come: rotations are not learned.

    Parameters
    ----------
    template : Template
        What bodies are registered to in training.
    n_intrinsic, n_extrinsic : int
        Numbers of entries of the codes.
    n_points : int
        Number of points of a cloud.
    n_eigenvalues : int
        Number of eigenvalues.
    n_hidden, n_features : int
        Sizes of layers, and of what is found from a cloud before the codes.
    n_steps : int
        Number of steps of training.
    batch_size : int
        Number of clouds of a step.
    learning_rate : float
        Largest length of a step.
    random_state : int
        Seed.

    Attributes
    ----------
    parameters_ : dict of str to array
        Parameters of the networks.
    vertices_ : array of int, shape (n_points,)
        The vertices of the template that `inverse_transform` gives.
    losses_ : array, shape (n_steps,)
        What was lost at every step; only after `fit`.

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

    parameters_: dict[str, ndarray]
    vertices_: ndarray
    losses_: ndarray

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
        """Train the networks.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies over the template, upright and facing one way, in metres.
        y : object
            Not used.
        checkpoint : path_like, optional
            An .npz file that is written as training goes on. If it exists, training goes on from
            there, and ends as if it had not stopped.
        progress : bool
            Whether to show progress bars.

        Returns
        -------
        IntrinsicExtrinsicCodes
            The estimator itself.

        Raises
        ------
        MissingDependencyError
            If PyTorch is not installed.
        ArgumentError
            If bodies or parameters are wrong.
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
        # Two clouds of every body: the network is to know the body, not the points.
        clouds = np.stack(
            [[surface_points(f, template.faces, self.n_points, rng) for _ in "ab"] for f in points]
        )
        placed = points[:, self.vertices_] - points.mean(axis=1, keepdims=True)
        self._place = placed.mean(axis=0)
        data = {"clouds": clouds, "points": placed - self._place, "values": values - self._spectrum}
        start = initial_cloud(self.n_hidden, self.n_features, rng)
        for name, (n_in, n_out) in self._sizes().items():
            start |= initial_network(name, n_in, 2 * self.n_hidden, n_out, rng)
        self._train(start, data, self._loss, checkpoint, progress)
        self._place, self._spectrum = map(in_single_precision, (self._place, self._spectrum))
        return self

    def on(self, template: Template, correspondence: Any = None) -> Self:
        """Return the same network for bodies over another template.

        Parameters
        ----------
        template : Template
            The other template: no correspondence is needed to find codes.
        correspondence : object
            Not used.

        Returns
        -------
        IntrinsicExtrinsicCodes

        Raises
        ------
        ArgumentTypeError
            If it is not a template.
        ArgumentError
            If nothing was fitted.
        """
        self._require_fit("parameters_")
        other = copy(self)
        other._over = checked_template(template)
        return other

    @property
    def template_(self) -> Template:
        """What the bodies that `transform` takes are registered to."""
        self._require_fit("parameters_")
        return self._over

    def transform(self, X: ArrayLike) -> ndarray:
        """Return the codes of bodies.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies over the template, upright and facing forward.

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
        self._require_fit("parameters_")
        points = self._over.check_points(X, "X")
        if points.ndim != 3:
            raise ArgumentError(
                f"X must have shape (n, {self._over.n_vertices}, 3); found {points.shape}"
            )
        found = [self.describe(surface, self._over.faces) for surface in points]
        return np.array(found).reshape(len(points), self.n_intrinsic + self.n_extrinsic)

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> ndarray:
        """Return the codes of any mesh.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres, y up, the body facing +z.
        faces : array_like, shape (F, 3)
            Triangles.

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
        mesh = mesh_arrays(vertices, faces)
        self._check_scale(mesh[0], "vertices")
        rng = np.random.default_rng(_SEED_OF_POINTS)
        clouds = np.stack([surface_points(*mesh, self.n_points, rng) for _ in range(_CLOUDS)])
        return np.asarray(self._encoded(self._used, clouds).mean(axis=0))

    def inverse_transform(self, Z: ArrayLike) -> ndarray:
        """Return the points that have given codes.

        Parameters
        ----------
        Z : array_like, shape (n, n_intrinsic + n_extrinsic)
            Codes.

        Returns
        -------
        array, shape (n, n_points, 3)
            The vertices `vertices_` of the template that was trained on, about the body's mean
            vertex.

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the codes have another length.
        """
        self._require_fit("parameters_")
        codes = self._checked_codes(Z, self.n_intrinsic + self.n_extrinsic)
        found = network(self._used, "points", codes)
        return found.reshape(len(codes), self.n_points, 3) + self._place

    def spectra(self, Z: ArrayLike) -> ndarray:
        """Return the eigenvalues that the network tells from intrinsic codes.

        Parameters
        ----------
        Z : array_like, shape (n, n_intrinsic + n_extrinsic)
            Codes.

        Returns
        -------
        array, shape (n, n_eigenvalues)
            Ascending, without zero, in 1 / metre².

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the codes have another length.
        """
        self._require_fit("parameters_")
        intrinsic, _ = self.split(Z)
        return np.exp(network(self._used, "spectrum", intrinsic) + self._spectrum)

    def split(self, Z: ArrayLike) -> tuple[ndarray, ndarray]:
        """Return the intrinsic codes and the extrinsic codes.

        Parameters
        ----------
        Z : array_like, shape (n, n_intrinsic + n_extrinsic)
            Codes.

        Returns
        -------
        intrinsic : array, shape (n, n_intrinsic)
        extrinsic : array, shape (n, n_extrinsic)
        """
        codes = self._checked_codes(Z, self.n_intrinsic + self.n_extrinsic)
        return codes[:, : self.n_intrinsic], codes[:, self.n_intrinsic :]

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

    def _start_on(self, template: Template) -> None:
        super()._start_on(template)
        self._over = template

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
        shapes = cloud_shapes(self.n_hidden, self.n_features)
        for name, (n_in, n_out) in self._sizes().items():
            shapes |= network_shapes(name, n_in, 2 * self.n_hidden, n_out)
        self._used = {name: weights.numbers(name, shape) for name, shape in shapes.items()}
        self.parameters_ = {name: array.astype(np.float16) for name, array in self._used.items()}
