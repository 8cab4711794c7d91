"""Files of networks: named arrays in .npz files, checked when they are read."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np
from numpy import ndarray

from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError, RiemhumanError
from riemhuman.geometry import AlignedSurfaces
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.surfaces.template import Template

_VERSION = 1
_TEMPLATE = ("template_vertices", "template_faces")


def save_weights(
    path: str | os.PathLike[str],
    kind: str,
    settings: Mapping[str, int],
    template: Template,
    arrays: Mapping[str, ndarray],
) -> None:
    """Write a network; the file appears whole or not at all.

    Parameters
    ----------
    path : path_like
        The file, with its ending; an existing file is replaced.
    kind : str
        Name of the class.
    settings : mapping of str to int
        Sizes of the network.
    template : Template
        Template that the network was trained on.
    arrays : mapping of str to array
        Learned arrays.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    vertices = template.vertices.astype(np.float32)
    if not np.array_equal(vertices, template.vertices):
        vertices = template.vertices
    fields = {
        "format_version": np.array(_VERSION),
        "kind": np.array(kind),
        **{name: np.array(value) for name, value in settings.items()},
        "template_vertices": vertices,
        "template_faces": template.faces.astype(np.int32),
    }
    save_arrays(path, {**fields, **arrays}, compressed=True)


class Weights:
    """The content of a network's file; each array is checked when it is requested.

    Parameters
    ----------
    path : path_like
        The file.
    kind : str
        Name of the class.
    settings : sequence of str
        Names of the sizes that the file must hold.

    Raises
    ------
    FileError
        If the file is missing or cannot be read.
    FileFormatError
        If it does not hold a network of this class, or has another format version.
    """

    def __init__(self, path: str | os.PathLike[str], kind: str, settings: Sequence[str]) -> None:
        self._path = os.fspath(path)
        required = ["format_version", "kind", *settings, *_TEMPLATE]
        self._fields = load_arrays(path, required)
        if self._fields["format_version"].tolist() != _VERSION:
            raise self.refused(
                f"its format version is {str(self._fields['format_version'].tolist())[:40]}; this "
                f"release reads version {_VERSION}"
            )
        if self._fields["kind"].tolist() != kind:
            raise self.refused(
                f"it holds {str(self._fields['kind'].tolist())[:60]!r}; expected {kind!r}"
            )
        self.settings = {name: self._whole_number(name) for name in settings}
        try:
            self.template = Template(*(self._fields[name] for name in _TEMPLATE))
        except RiemhumanError as error:
            raise self.refused(str(error)) from error

    def refused(self, reason: str) -> FileFormatError:
        """Return the error that refuses the file.

        Parameters
        ----------
        reason : str
            What is wrong.

        Returns
        -------
        FileFormatError
        """
        return FileFormatError(f"{self._path}: {reason}")

    def numbers(self, name: str, shape: Sequence[int], *, positive: bool = False) -> ndarray:
        """Return an array of finite real numbers.

        Parameters
        ----------
        name : str
            Name of the array.
        shape : sequence of int
            Required shape.
        positive : bool
            Whether all numbers must be positive.

        Returns
        -------
        array
            In double precision.

        Raises
        ------
        FileFormatError
            If the array is missing, or has another shape or type, or wrong entries.
        """
        array = self._array(name, shape, "f").astype(np.float64)
        if not np.isfinite(array).all():
            raise self.refused(f"{name} holds numbers that are not finite")
        if positive and (array <= 0).any():
            raise self.refused(f"{name} must be positive; found {array.min():.3g}")
        return array

    def indices(self, name: str, shape: Sequence[int], least: int, end: int) -> ndarray:
        """Return an array of whole numbers.

        Parameters
        ----------
        name : str
            Name of the array.
        shape : sequence of int
            Required shape.
        least, end : int
            Least entry, and one more than the largest entry.

        Returns
        -------
        array of int

        Raises
        ------
        FileFormatError
            If the array is missing, or has another shape or type, or wrong entries.
        """
        array = self._array(name, shape, "iu").astype(np.int64)
        if array.size and (array.min() < least or array.max() >= end):
            raise self.refused(
                f"{name} must hold whole numbers from {least} to {end - 1}; found "
                f"{array.min()} to {array.max()}"
            )
        return array

    def text(self, name: str) -> str:
        """Return a string.

        Parameters
        ----------
        name : str
            Name of the field.

        Returns
        -------
        str

        Raises
        ------
        FileFormatError
            If the field is missing or not a string.
        """
        return str(self._array(name, (), "U"))

    def _array(self, name: str, shape: Sequence[int], kinds: str) -> ndarray:
        if name not in self._fields:
            raise self.refused(f"it lacks the field {name}")
        array = self._fields[name]
        if array.shape != tuple(shape) or array.dtype.kind not in kinds:
            expected = {"f": "real numbers", "iu": "whole numbers", "U": "text"}[kinds]
            raise self.refused(
                f"{name} must be {expected} of shape {tuple(shape)}; found {array.dtype} "
                f"of shape {array.shape}"
            )
        return array

    def _whole_number(self, name: str) -> int:
        value = self._array(name, (), "iu").item()
        # Sizes of arrays that the file holds itself.
        if not 1 <= value <= 2**20:
            raise self.refused(f"{name} must be at least 1 and at most {2**20}; found {value}")
        return int(value)


def check_training_bodies(
    template: Template | None, X: object, name: str = "X"
) -> tuple[Template, ndarray]:
    """Return the template and the surfaces for training after checking them.

    Parameters
    ----------
    template : Template
        Template of the surfaces.
    X : array_like, shape (n, V, 3)
        Surfaces, metres.
    name : str
        Name of the argument, for messages.

    Returns
    -------
    template : Template
    points : array, shape (n, V, 3)

    Raises
    ------
    ArgumentTypeError
        If there is no template, or the surfaces are not numbers.
    ArgumentError
        If the surfaces do not fit the template, or there are fewer than two.
    DegenerateSurfaceError
        If a triangle has no area.
    """
    if not isinstance(template, Template):
        raise ArgumentTypeError(
            f"template must be a Template for training; found {type(template).__name__}"
        )
    points: ndarray = template.check_points(X, name)
    if points.ndim != 3 or len(points) < 2:
        raise ArgumentError(
            f"{name} must hold at least two surfaces, of shape (n, {template.n_vertices}, 3); "
            f"found shape {points.shape}"
        )
    AlignedSurfaces(template, equip=False).check_immersed(points, name)
    return template, points
