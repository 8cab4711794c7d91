"""Files of networks: named arrays in .npz files, checked when they are read."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import load_arrays
from riemhuman.surfaces import Template

VERSION = 1
_TEMPLATE = ("template_vertices", "template_faces")

# Largest size of a layer: files may come from anywhere.
_LARGEST = 2**20


class Weights:
    """The content of a network's file; each array is checked when it is requested."""

    def __init__(self, path: str | os.PathLike[str], kind: str, settings: Sequence[str]) -> None:
        self.fields = load_arrays(path, ["format_version", "kind", *settings, *_TEMPLATE])
        if self.fields["format_version"].tolist() != VERSION:
            raise FileFormatError(
                f"its format version is {str(self.fields['format_version'].tolist())[:40]}; this "
                f"release reads version {VERSION}"
            )
        if self.fields["kind"].tolist() != kind:
            raise FileFormatError(
                f"it holds {str(self.fields['kind'].tolist())[:60]!r}; expected {kind!r}"
            )
        self.settings = {name: self._whole_number(name) for name in settings}
        self.template = Template(*(self.fields[name] for name in _TEMPLATE))

    def numbers(self, name: str, shape: Sequence[int], *, positive: bool = False) -> ndarray:
        """Return finite real numbers in double precision."""
        array = self._array(name, shape, "f").astype(np.float64)
        if not np.isfinite(array).all():
            raise FileFormatError(f"{name} holds numbers that are not finite")
        if positive and (array <= 0).any():
            raise FileFormatError(f"{name} must be positive; found {array.min():.3g}")
        return array

    def indices(self, name: str, shape: Sequence[int], least: int, end: int) -> ndarray:
        """Return whole numbers from `least` to `end` - 1."""
        array = self._array(name, shape, "iu").astype(np.int64)
        if array.size and (array.min() < least or array.max() >= end):
            raise FileFormatError(
                f"{name} must hold whole numbers from {least} to {end - 1}; found "
                f"{array.min()} to {array.max()}"
            )
        return array

    def _array(self, name: str, shape: Sequence[int], kinds: str) -> ndarray:
        if name not in self.fields:
            raise FileFormatError(f"it lacks the field {name}")
        array = self.fields[name]
        if array.shape != tuple(shape) or array.dtype.kind not in kinds:
            expected = {"f": "real numbers", "iu": "whole numbers"}[kinds]
            raise FileFormatError(
                f"{name} must be {expected} of shape {tuple(shape)}; found {array.dtype} "
                f"of shape {array.shape}"
            )
        return array

    def _whole_number(self, name: str) -> int:
        value = self._array(name, (), "iu").item()
        if not 1 <= value <= _LARGEST:
            raise FileFormatError(
                f"{name} must be at least 1 and at most {_LARGEST}; found {value}"
            )
        return int(value)
