"""What judges of files share: numbers as formats spell them, and what makes arrays a mesh."""

import re

import numpy as np

REAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?")
WHOLE = re.compile(r"[+-]?[0-9]+")


class RefusedError(Exception):
    """A judge finds that a file must not be accepted."""


def expect(condition, what):
    if not condition:
        raise RefusedError(what)


def real(word):
    expect(REAL.fullmatch(word), f"{word!r} is no number")
    return float(word)


def real_or_none(word):
    """Return a number that need not be finite, as colours, which nobody reads."""
    return 0.0 if re.fullmatch("[+-]?(nan|inf|infinity)", word.lower()) else real(word)


def whole(word):
    expect(WHOLE.fullmatch(word), f"{word!r} is no whole number")
    return int(word)


def mesh(vertices, faces):
    """Check that arrays are those of a mesh."""
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces)
    expect(faces.ndim == 2 and faces.shape[1] == 3 and len(faces), "no triangles")
    expect(vertices.ndim == 2 and vertices.shape[1] == 3, "no positions")
    expect(np.isfinite(vertices).all(), "positions are not finite")
    expect(all(0 <= int(k) < len(vertices) for k in faces.ravel().tolist()), "beyond the vertices")
    return {"vertices": vertices, "faces": faces}
