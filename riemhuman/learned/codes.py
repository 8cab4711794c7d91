"""Base classes of learned codes: templates, training, files and correspondences."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Mapping
from copy import copy
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.checks import one_of, real_array, real_number, whole_number
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.estimator import Estimator
from riemhuman.geometry import AlignedSurfaces
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.learned.correspondence import Correspondence
from riemhuman.learned.networks import initial_network, network_shapes
from riemhuman.learned.training import Loss, trained
from riemhuman.learned.weight_files import Weights, save_weights
from riemhuman.surfaces.template import Template
from riemhuman.units import check_same_scale

FOLDER = Path(__file__).parent / "data"
"""Folder of the weights that ship."""

_REMEDY = "give them in the unit that the network was trained in"


class Codes(Estimator):
    """Vectors that networks compute for bodies registered to a template.

    Parameters
    ----------
    n_parts : int
        Number of parts.
    n_hidden : int
        Size of the hidden layers.
    n_steps : int
        Number of training steps.
    learning_rate : float
        Largest learning rate of Adam.
    random_state : int
        Seed.
    """

    parameters_: dict[str, ndarray]
    losses_: ndarray
    # Parameters that all networks share.
    n_hidden: int
    n_steps: int
    learning_rate: float
    random_state: int

    # Parameters that are sizes of arrays, and the size of hidden layers in units of `n_hidden`.
    _SETTINGS: tuple[str, ...] = ()
    _WIDTH = 1
    # Names of the files that ship, by the argument `which` of `load_pretrained`.
    _SHIPPED: Mapping[str | None, str] = MappingProxyType({})

    @abstractmethod
    def fit(
        self,
        X: ArrayLike,
        y: Any,
        *,
        checkpoint: str | os.PathLike[str] | None = None,
        progress: bool = False,
    ) -> Self:
        """Train the networks.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies over the template, metres.
        y : array_like, shape (n,)
            Person of each body, for `ShapePoseCodes`; other codes ignore it.
        checkpoint : path_like, optional
            An .npz file that is written during training. If it exists, training continues from it
            and ends with the same result as without interruption.
        progress : bool
            Whether to show progress bars.

        Returns
        -------
        Codes
            The estimator itself.
        """

    @abstractmethod
    def transform(self, X: ArrayLike) -> ndarray:
        """Return the codes of bodies.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies over the template `template_`, metres.

        Returns
        -------
        array, shape (n, n_codes)

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the bodies do not fit the template.
        DegenerateSurfaceError
            If a triangle has no area.
        """

    @classmethod
    def load_pretrained(
        cls,
        template: Template | None = None,
        correspondence: Any = None,
        *,
        which: str | None = None,
    ) -> Self:
        """Return the network that ships, trained on the open body model.

        Parameters
        ----------
        template : Template, optional
            Template of the bodies; by default that of the coarse open model.
        correspondence : array_like of int, pair, or sparse matrix, optional
            Where the vertices of the coarse open template lie on `template`, see `on`.
        which : str, optional
            Name of the network, required by `MetricCodes` alone: "shape" or "pose".

        Returns
        -------
        Codes
            The trained network; it does not need PyTorch.

        Raises
        ------
        ArgumentError
            If the template is not in correspondence, or there is no such network.
        """
        found = cls.load(FOLDER / cls._SHIPPED[one_of(which, "which", tuple(cls._SHIPPED))])
        return found if template is None else found.on(template, correspondence)

    def on(self, template: Template, correspondence: Any = None) -> Self:
        """Return the same network for bodies over another template.

        The other template may be of any person in any pose, with any triangles; a correspondence
        says which of its points match the vertices of the network's own template.

        Parameters
        ----------
        template : Template
            The other template.
        correspondence : array_like of int, pair, or sparse matrix, optional
            Where the vertices of the network's template lie on the other: numbers of vertices,
            shape (V,); a pair of numbers of triangles, shape (V,), and barycentric coordinates,
            shape (V, 3); or a matrix whose rows sum to one. It is optional if the other template
            has vertices at the same places, as the full open template has those of the coarse one.

        Returns
        -------
        Codes

        Raises
        ------
        ArgumentTypeError
            If `template` is not a template.
        ArgumentError
            If nothing was fitted, or the correspondence is missing or does not fit.
        """
        self._require_fit("parameters_")
        checked_template(template)
        other = copy(self)
        same = template.n_vertices == self._home.n_vertices and np.array_equal(
            template.faces, self._home.faces
        )
        given = same and correspondence is None
        other._carried = None if given else Correspondence(self._home, template, correspondence)
        other._template = self._home if given else template
        return other

    @property
    def template_(self) -> Template:
        """Template that bodies must be registered to."""
        self._require_fit("parameters_")
        return self._template

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the network to an .npz file.

        Parameters
        ----------
        path : path_like
            The file; an existing file is replaced.

        Raises
        ------
        ArgumentError
            If nothing was fitted.
        FileError
            If the file cannot be written.
        """
        self._require_fit("parameters_")
        save_weights(path, type(self).__name__, self._settings(), self._home, self._arrays())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a network that `save` wrote.

        Parameters
        ----------
        path : path_like
            The file. Its arrays are checked, and nothing in it is executed.

        Returns
        -------
        Codes
            The saved network, bit for bit.

        Raises
        ------
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If it does not hold a network of this class.
        """
        weights = Weights(path, cls.__name__, cls._SETTINGS)
        found = cls(**weights.settings)
        found._start_on(weights.template)
        found._read(weights)
        return found

    def _generator(self, *sizes: str) -> np.random.Generator:
        """Check the parameters, including the named sizes, and return the random generator."""
        for name in (*self._SETTINGS, "n_steps", *sizes):
            whole_number(getattr(self, name), name, minimum=1)
        real_number(self.learning_rate, "learning_rate", minimum=0.0, strict=True)
        return np.random.default_rng(whole_number(self.random_state, "random_state", minimum=0))

    def _train(
        self,
        start: Mapping[str, ndarray],
        data: Mapping[str, ndarray],
        loss: Loss,
        checkpoint: str | os.PathLike[str] | None,
        progress: bool,
    ) -> None:
        with single_threaded_libraries():
            self.parameters_, self.losses_ = trained(
                start,
                data,
                loss,
                n_steps=self.n_steps,
                seed=int(self.random_state),
                learning_rate=float(self.learning_rate),
                checkpoint=checkpoint,
                progress=progress,
            )
        self._used = {name: array.astype(np.float64) for name, array in self.parameters_.items()}

    @abstractmethod
    def _sizes(self) -> dict[str, tuple[int, int]]:
        """Return the numbers of inputs and outputs of each network."""

    def _initial_networks(self, rng: np.random.Generator) -> dict[str, ndarray]:
        found: dict[str, ndarray] = {}
        for name, (n_in, n_out) in self._sizes().items():
            found |= initial_network(name, n_in, self._WIDTH * self.n_hidden, n_out, rng)
        return found

    def _read_networks(self, weights: Weights, shapes: Mapping[str, tuple[int, ...]]) -> None:
        """Read the networks, and other parameters of the given shapes."""
        shapes = dict(shapes)
        for name, (n_in, n_out) in self._sizes().items():
            shapes |= network_shapes(name, n_in, self._WIDTH * self.n_hidden, n_out)
        self._used = {name: weights.numbers(name, shape) for name, shape in shapes.items()}
        self.parameters_ = {name: array.astype(np.float16) for name, array in self._used.items()}

    def _settings(self) -> dict[str, int]:
        """Return the sizes of the trained network."""
        return {name: int(getattr(self, name)) for name in self._SETTINGS}

    @abstractmethod
    def _arrays(self) -> dict[str, ndarray]:
        """Return all learned arrays by name."""

    @abstractmethod
    def _read(self, weights: Weights) -> None:
        """Read the learned arrays from a file."""

    def _start_on(self, template: Template) -> None:
        self._home = self._template = template
        self._carried: Correspondence | None = None

    def _checked_points(self, X: Any) -> ndarray:
        template = self.template_
        points = template.check_points(X, "X")
        if points.ndim != 3:
            raise ArgumentError(
                f"X must have shape (n, {template.n_vertices}, 3); found {points.shape}"
            )
        return points

    def _home_points(self, X: Any) -> ndarray:
        """Return bodies over the network's own template, whose triangles all have an area."""
        points = self._checked_points(X)
        if self._carried is not None:
            points = self._carried.forth(points)
        if len(points):
            AlignedSurfaces(self._home, equip=False).check_immersed(points, "X")
            self._check_scale(points, "X")
        return points

    def _check_scale(self, points: ndarray, name: str) -> None:
        check_same_scale(
            points, self._home.vertices, name, "the network's template", remedy=_REMEDY
        )

    def _carried_back(self, points: ndarray) -> ndarray:
        return points if self._carried is None else self._carried.back(points)


class PairedCodes(Codes):
    """Two codes of a body, one after the other, and bodies from both."""

    code_names: ClassVar[tuple[str, str]]

    @abstractmethod
    def inverse_transform(self, Z: ArrayLike) -> ndarray:
        """Return the bodies with given codes.

        Parameters
        ----------
        Z : array_like, shape (n, n_codes)
            Both codes of each body, see `split`; they may come from different bodies.

        Returns
        -------
        array, shape (n, V, 3)

        Raises
        ------
        ArgumentError
            If nothing was fitted, or the codes have another length.
        """

    def split(self, Z: ArrayLike) -> tuple[ndarray, ndarray]:
        """Return the two codes of each body.

        Parameters
        ----------
        Z : array_like, shape (n, n_codes)
            Codes, as `transform` returns them.

        Returns
        -------
        first, second : array, shape (n, n_first) and (n, n_second)
            Shape and pose codes of `ShapePoseCodes`, intrinsic and extrinsic codes of
            `IntrinsicExtrinsicCodes`.
        """
        first, _ = self._n_codes
        codes = self._checked_codes(Z)
        return codes[:, :first], codes[:, first:]

    @property
    def _n_codes(self) -> tuple[int, int]:
        first, second = self.code_names
        return getattr(self, f"n_{first}"), getattr(self, f"n_{second}")

    def _checked_codes(self, Z: Any) -> ndarray:
        return np.asarray(real_array(Z, "Z", ("n", sum(self._n_codes)), batched=False))


def checked_template(template: object) -> Template:
    """Return the argument if it is a template.

    Parameters
    ----------
    template : object
        The argument.

    Returns
    -------
    Template

    Raises
    ------
    ArgumentTypeError
        If it is not a template.
    """
    if not isinstance(template, Template):
        raise ArgumentTypeError(f"template must be a Template; found {type(template).__name__}")
    return template
