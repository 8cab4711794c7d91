"""How much of its surroundings each vertex of a template sees: folds and sockets are darker.

Lights of pages and pictures cast no shadows. What the open body model sees in its rest pose is
stored; `tutorials/remake/build_occlusion.py` computes it.
"""

from __future__ import annotations

from functools import cache
from importlib.resources import as_file, files
from zlib import crc32

import numpy as np

from riemhuman.arrays import Array, Triangles
from riemhuman.io.arrays import load_arrays

_DARKEST = 0.2  # share of the light in the deepest folds


def shade_of(faces: Triangles) -> Array | None:
    """Return the share of light that reaches vertices of the open body model, shape (V,).

    None for other triangles, whose rest pose is not known.
    """
    return _stored().get(topology_name(faces))


def topology_name(faces: Triangles) -> str:
    """Return a short name for triangles, computed from their indices."""
    return f"shares_{crc32(np.ascontiguousarray(faces, dtype='<i4').tobytes()):08x}"


@cache
def _stored() -> dict[str, Array]:
    with as_file(files("riemhuman.plots") / "web" / "occlusion.npz") as file:
        stored = load_arrays(file, ())
    return {name: _DARKEST + (1 - _DARKEST) * shares / 255 for name, shares in stored.items()}
