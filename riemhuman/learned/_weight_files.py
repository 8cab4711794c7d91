"""Files of networks: named arrays in .npz files, checked when they are read."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence

import numpy as np

from riemhuman.arrays import Array, Integers, Values
from riemhuman.checks import index_array, real_array
from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import check_fields, load_arrays
from riemhuman.surfaces import Template

VERSION = 1
_TEMPLATE = ("template_vertices", "template_faces")

# Largest size of a layer: files may come from anywhere.
_LARGEST = 2**20


class Weights:
    """The content of a network's file; each array is checked when it is requested."""

    def __init__(self, path: str | os.PathLike[str], kind: str, settings: Sequence[str]) -> None:
        self.fields = load_arrays(path, ["format_version", "kind", *settings, *_TEMPLATE])
        for name, expected in {"format_version": VERSION, "kind": kind}.items():
            stored = self.fields[name].tolist()
            if stored != expected:
                raise FileFormatError(f"its {name} must be {expected!r}; found {stored!r:.60}")
        self.settings = {name: int(self.indices(name, (), 1, _LARGEST)) for name in settings}
        self.template = Template(*(self.fields[name] for name in _TEMPLATE))

    def numbers(self, name: str, shape: Sequence[int], *, positive: bool = False) -> Array:
        """Return finite real numbers in double precision."""
        array = np.asarray(real_array(self._field(name), name, shape, batched=False))
        if positive and (array <= 0).any():
            raise FileFormatError(f"{name} must be positive; found {array.min():.3g}")
        return array

    def arrays(self, shapes: Mapping[str, Sequence[int]]) -> dict[str, Array]:
        """Return finite real numbers by name."""
        return {name: self.numbers(name, shape) for name, shape in shapes.items()}

    def indices(self, name: str, shape: Sequence[int], least: int, end: int) -> Integers:
        """Return whole numbers from `least` to `end` - 1."""
        return index_array(self._field(name), name, shape, end, least)

    def _field(self, name: str) -> Values:
        check_fields(self.fields, [name])
        return self.fields[name]
