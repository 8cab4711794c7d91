"""Looks of the open body model in pages and pictures, which are no part of its data.

Its own surface ends in empty sockets, into which eyeballs are set. A socket is nearly a sphere. Its
centre and half axes are stored as affine combinations of some of its vertices, so that eyes follow
any body and pose; `tutorials/remake/build_eyes.py` computes them.

Lights cast no shadows; folds and sockets are darker instead. How much of its surroundings each
vertex sees in the rest pose is stored; `tutorials/remake/build_occlusion.py` computes it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import as_file, files
from zlib import crc32

import numpy as np

from riemhuman.arrays import Array, Points, Triangles, Values
from riemhuman.io.arrays import load_arrays
from riemhuman.plots._packing import deflated

# Rings of an eyeball: degrees from the direction of gaze, and the share of light that they
# reflect. Pupil and iris end between two rings that nearly coincide.
_RINGS = (
    *((8.6, 0.14), (8.8, 0.40), (15.0, 0.46), (22.6, 0.34), (23.4, 0.92)),
    *((31.0, 1.0), (40.0, 1.0), (50.0, 1.0), (60.0, 0.9), (70.0, 0.8)),
)
_AROUND = 20  # vertices of a ring
_DARKEST = 0.2  # share of the light in the deepest folds


def topology_name(faces: Triangles) -> str:
    """Return a short name for triangles, computed from their indices."""
    return f"shares_{crc32(np.ascontiguousarray(faces, dtype='<i4').tobytes()):08x}"


def _stored(name: str) -> dict[str, Values]:
    with as_file(files("riemhuman.plots") / "web" / name) as file:
        return load_arrays(file, ())


def shade_of(faces: Triangles) -> Array | None:
    """Return the share of light that reaches vertices of the open body model, shape (V,).

    None for other triangles, whose rest pose is not known.
    """
    return shades().get(topology_name(faces))


@cache
def shades() -> dict[str, Array]:
    """Return the shares of light by the names of triangles."""
    stored = _stored("occlusion.npz")
    return {name: _DARKEST + (1 - _DARKEST) * shares / 255 for name, shares in stored.items()}


@dataclass(frozen=True, eq=False)
class Eyes:
    """Both eyes of bodies with certain triangles.

    `sockets` (2, n) are vertices of the body in both sockets; `weights` (2, 4, n) give the centre
    and three half axes of each eye as combinations of those vertices.
    """

    sockets: Array
    weights: Array

    def points(self, vertices: Points) -> Array:
        """Return the vertices of both eyes of a body, shape (n_points, 3)."""
        ball, _, _ = eyeball()
        frames = self.weights @ vertices[self.sockets]
        return np.concatenate([centre + ball @ axes for centre, *axes in frames])

    def faces(self, n_vertices: int) -> Triangles:
        """Return the triangles of both eyes, whose vertices follow those of the body."""
        ball, triangles, _ = eyeball()
        return np.concatenate([triangles, triangles + len(ball)]) + n_vertices

    def shares(self) -> Array:
        """Return the share of light that each vertex reflects, shape (n_points,)."""
        return np.tile(eyeball()[2], 2)

    def socket_colors(self, corners: Array, faces: Triangles) -> Array:
        """Return the mean colours of the sockets for the triangles of both eyes, (F, 3, 3).

        `corners` (n_faces, 3, 3) are the colours of the corners of the body's triangles.
        """
        means = [corners[np.isin(faces, socket)].mean(axis=0) for socket in self.sockets]
        socket_means = np.repeat(means, len(eyeball()[1]), axis=0)
        return np.repeat(socket_means[:, np.newaxis], 3, axis=1)

    def record(self) -> dict[str, object]:
        """Return what the page needs, in types that JSON can hold."""
        ball, triangles, shares = eyeball()
        return {
            "sockets": self.sockets.tolist(),
            "weights": deflated(self.weights.astype("<f4")),
            "ball": deflated(ball.astype("<f4")),
            "faces": deflated(triangles.astype("<u4")),
            "shares": deflated(np.round(255 * shares).astype(np.uint8)),
        }


def eyes_of(faces: Triangles) -> Eyes | None:
    """Return the eyes of bodies with these triangles; None unless they are the open model's."""
    return _eyes().get(topology_name(faces))


@cache
def eyeball() -> tuple[Array, Array, Array]:
    """Return the front of an eyeball looking along z: vertices, triangles, shares of light."""
    angles, shares = np.array(_RINGS).T
    angles = np.radians(angles)[:, np.newaxis]
    around = 2 * np.pi * np.arange(_AROUND) / _AROUND
    rings = np.stack(
        [
            np.sin(angles) * np.cos(around),
            np.sin(angles) * np.sin(around),
            np.repeat(np.cos(angles), _AROUND, axis=1),
        ],
        axis=-1,
    )
    vertices = np.concatenate([[[0.0, 0.0, 1.0]], rings.reshape(-1, 3)])
    numbers = 1 + np.arange(len(_RINGS) * _AROUND).reshape(len(_RINGS), _AROUND)
    beside = np.roll(numbers, -1, axis=1)
    middle = np.stack([np.zeros(_AROUND, dtype=int), numbers[0], beside[0]], axis=1)
    inner, outer = (numbers[:-1], beside[:-1]), (numbers[1:], beside[1:])
    bands = [(inner[0], outer[0], outer[1]), (inner[0], outer[1], inner[1])]
    triangles = [np.stack([part.ravel() for part in band], axis=1) for band in bands]
    lightness = np.concatenate([shares[:1], np.repeat(shares, _AROUND)])
    return vertices, np.concatenate([middle, *triangles]), lightness


@cache
def _eyes() -> dict[str, Eyes]:
    stored = _stored("eyes.npz")
    names = {name.removeprefix("sockets_") for name in stored if name.startswith("sockets_")}
    return {
        name: Eyes(stored[f"sockets_{name}"].astype(np.int64), stored[f"weights_{name}"])
        for name in names
    }
