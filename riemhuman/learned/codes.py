"""What all learned codes share: a template, another one in correspondence with it, and files."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Mapping
from copy import copy
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_array, real_number, whole_number
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.estimator import Estimator
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.learned.correspondence import Correspondence
from riemhuman.learned.training import Loss, trained
from riemhuman.learned.weight_files import Weights, save_weights
from riemhuman.surfaces.template import Template
from riemhuman.units import refuse_other_scale

FOLDER = Path(__file__).parent / "data"
"""Where the weights that ship are."""

_REMEDY = "give them in the unit that the network was trained in"


class Codes(Estimator):
    """Vectors that a network finds for bodies registered to a template."""

    # What every network keeps of how it is trained, beside settings of its own.
    n_steps: int
    learning_rate: float
    random_state: int

    _SETTINGS: tuple[str, ...] = ()
    # The files that ship, by what `load_pretrained` calls them.
    _SHIPPED: Mapping[str | None, str] = MappingProxyType({})

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
            What bodies are registered to; by default the coarse open model's template.
        correspondence : array_like of int, pair, or sparse matrix, optional
            Where the vertices of the coarse open template lie on `template`, see `on`.
        which : str, optional
            Which of several networks: "shape" or "pose" of `MetricCodes`, where it must be given.

        Returns
        -------
        Codes
            The network, ready to use: PyTorch is not needed.

        Raises
        ------
        ArgumentError
            If the template is not in correspondence, or there is no such network.
        """
        found = cls.load(FOLDER / cls._SHIPPED[one_of(which, "which", tuple(cls._SHIPPED))])
        return found if template is None else found.on(template, correspondence)

    def on(self, template: Template, correspondence: Any = None) -> Self:
        """Return the same network for bodies over another template.

        Two templates are in correspondence where it is known which point of one is which of the
        other. The other may be of any person in any pose, with any triangles.

        Parameters
        ----------
        template : Template
            The other template.
        correspondence : array_like of int, pair, or sparse matrix, optional
            Where the vertices of the network's template lie on the other: numbers of vertices,
            shape (V,); a pair of numbers of triangles, shape (V,), and barycentric coordinates,
            shape (V, 3); or a matrix, whose rows sum to one. Need not be given where the vertices
            of the network's template are among those of the other, at the same places, as the
            coarse open template's are among the full one's.

        Returns
        -------
        Codes

        Raises
        ------
        ArgumentTypeError
            If it is not a template.
        ArgumentError
            If nothing was fitted, or the template is not in correspondence.
        """
        self._require_fit("parameters_")
        checked_template(template)
        other = copy(self)
        same = template.n_vertices == self._home.n_vertices and np.array_equal(
            template.faces, self._home.faces
        )
        given = same and correspondence is None
        other._carried = None if given else Correspondence(self._home, template, correspondence)
        return other

    @property
    def template_(self) -> Template:
        """What bodies must be registered to."""
        self._require_fit("parameters_")
        return self._home if self._carried is None else self._carried.template

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the network to an .npz file, which `load` reads as data.

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
            The file. Its numbers, shapes and names are checked; nothing in it is run.

        Returns
        -------
        Codes
            Bit for bit the network that was saved.

        Raises
        ------
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If it is no such file.
        """
        weights = Weights(path, cls.__name__, cls._SETTINGS)
        found = cls(**weights.settings)
        found._start_on(weights.template)
        found._read(weights)
        return found

    def _generator(self, *sizes: str) -> np.random.Generator:
        """Refuse settings that cannot be trained with, those sizes too; return the generator."""
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

    def _settings(self) -> dict[str, int]:
        """Return the sizes of what was fitted."""
        return {name: int(getattr(self, name)) for name in self._SETTINGS}

    @abstractmethod
    def _arrays(self) -> dict[str, ndarray]:
        """Return all that was learned, by name."""

    @abstractmethod
    def _read(self, weights: Weights) -> None:
        """Take what was learned from a file."""

    def _start_on(self, template: Template) -> None:
        self._home: Template = template
        self._carried: Correspondence | None = None

    def _home_points(self, X: Any) -> ndarray:
        """Return bodies over the network's own template, all of whose triangles have an area."""
        template = self.template_
        points = template.check_points(X, "X")
        if points.ndim != 3:
            raise ArgumentError(
                f"X must have shape (n, {template.n_vertices}, 3); found {points.shape}"
            )
        if self._carried is not None:
            points = self._carried.forth(points)
        if len(points):
            AlignedSurfaces(self._home, equip=False).check_immersed(points, "X")
            self._check_scale(points, "X")
        return points

    def _check_scale(self, points: ndarray, name: str) -> None:
        refuse_other_scale(
            points, self._home.vertices, name, "the network's template", remedy=_REMEDY
        )

    def _carried_back(self, points: ndarray) -> ndarray:
        return points if self._carried is None else self._carried.back(points)

    @staticmethod
    def _checked_codes(Z: Any, n_numbers: int) -> ndarray:
        return np.asarray(real_array(Z, "Z", ("n", n_numbers), batched=False))


def checked_template(template: object) -> Template:
    """Return a template, or refuse what is none.

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
        If it is no template.
    """
    if not isinstance(template, Template):
        raise ArgumentTypeError(f"template must be a Template; found {type(template).__name__}")
    return template
