"""Base class of codes that networks compute: files and templates."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from copy import copy
from pathlib import Path
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array
from riemhuman.checks import check_same_scale, longest_side, real_array, refuse_type
from riemhuman.io.arrays import save_arrays
from riemhuman.io.files import file_path, format_errors
from riemhuman.learned._weight_files import Weights
from riemhuman.surfaces import Template

FOLDER = Path(__file__).parent / "data"

_REMEDY = "give them in the unit that the network was trained in"


class PairedCodes(ABC):
    """Two codes of a body, one after the other, and bodies from both, by trained networks."""

    n_hidden: int
    code_names: ClassVar[tuple[str, str]]
    parameters_: dict[str, Array]
    template_: Template  # that bodies must be registered to

    # Other whole numbers in files, which `_read` keeps; the file that ships.
    _SETTINGS: ClassVar[tuple[str, ...]]
    _SHIPPED: ClassVar[str]

    def __init__(self, path: str | os.PathLike[str]) -> None:
        with format_errors(file_path(path), "a trained network"):
            weights = Weights(path, type(self).__name__, (*self._SETTINGS, "n_hidden"))
            self._fields = weights.fields
            self.n_hidden = weights.settings["n_hidden"]
            # The template that the network was trained on, and that of the bodies it is given.
            self._home = self.template_ = weights.template
            self._read(weights)

    @classmethod
    def load_pretrained(cls, template: Template | None = None) -> Self:
        """Return the network that ships, trained on the open body model.

        Parameters
        ----------
        template : Template, optional
            As for `on`; by default the template of the coarse open model.
        """
        codes = cls(FOLDER / cls._SHIPPED)
        return codes if template is None else codes.on(template)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the network to an .npz file.

        Parameters
        ----------
        path : path_like
            The file; an existing file is replaced.
        """
        save_arrays(path, self._fields, compressed=True)

    def on(self, template: Template) -> Self:
        """Return the same network for bodies over another template.

        Parameters
        ----------
        template : Template
            A template with the triangles of the network's, or one that has vertices at the same
            places, as the full open template has; for codes of point clouds, any template. Other
            bodies are brought to the open model first, see `rh.topologies.TopologyMap`.
        """
        if not isinstance(template, Template):
            refuse_type(template, "template", "a Template")
        codes = copy(self)
        codes.template_ = template
        return codes

    @abstractmethod
    def transform(self, X: ArrayLike) -> Array:
        """Return the codes of bodies, one after the other; `split` separates them.

        Parameters
        ----------
        X : array_like, shape (n, V, 3)
            Bodies over the template `template_`, metres; `IntrinsicExtrinsicCodes` needs them
            upright, facing forward.
        """

    @abstractmethod
    def inverse_transform(self, Z: ArrayLike) -> Array:
        """Return the bodies with given codes, their mean vertex at the origin, metres.

        They are over the template that the network was trained on.

        Parameters
        ----------
        Z : array_like, shape (n, n_codes)
            Both codes of each body; they may come from different bodies.
        """

    def split(self, Z: ArrayLike) -> tuple[Array, Array]:
        """Return the two codes of each body.

        Parameters
        ----------
        Z : array_like, shape (n, n_codes)
            Codes, as `transform` returns them.
        """
        codes = self._check_codes(Z)
        return codes[:, : self._n_codes[0]], codes[:, self._n_codes[0] :]

    @property
    @abstractmethod
    def _n_codes(self) -> tuple[int, int]:
        """Numbers of entries of both codes."""

    @abstractmethod
    def _read(self, weights: Weights) -> None:
        """Read the settings and the learned arrays from a file."""

    def _check_points(self, X: ArrayLike) -> Array:
        points = self.template_.check_points(X, "X")
        shape = ("n", self.template_.n_vertices, 3)
        return np.asarray(real_array(points, "X", shape, batched=False))

    def _check_scale(self, points: Array, name: str) -> None:
        reference = self._home.vertices
        check_same_scale(
            points, longest_side(reference), name, "the network's template", remedy=_REMEDY
        )

    def _check_codes(self, Z: ArrayLike) -> Array:
        return np.asarray(real_array(Z, "Z", ("n", sum(self._n_codes)), batched=False))
