"""Smooth random displacements of surfaces."""

from __future__ import annotations

import numpy as np

_N_WAVES = 12


def surface_noise(
    points: np.ndarray, size: float, wavelengths: tuple[float, float], rng: np.random.Generator
) -> np.ndarray:
    """Return a sum of random plane waves at every point.

    The two sides of a thin fold (lips, ears, nostrils) move alike, so that they do not intersect.

    Parameters
    ----------
    points : array, shape (V, 3)
        Points, metres.
    size : float
        Root mean square length of the displacement, metres.
    wavelengths : tuple of float
        Shortest and longest wave, metres.
    rng : numpy.random.Generator
        Source of random waves.

    Returns
    -------
    displacement : array, shape (V, 3)
        Metres.
    """
    directions, displacements = rng.standard_normal((2, _N_WAVES, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    displacements /= np.linalg.norm(displacements, axis=1, keepdims=True)
    frequencies = 2 * np.pi / rng.uniform(*wavelengths, (_N_WAVES, 1)) * directions
    phases = rng.uniform(0.0, 2 * np.pi, _N_WAVES)
    waves = np.cos(points @ frequencies.T + phases)
    return size * np.sqrt(2.0 / _N_WAVES) * (waves @ displacements)
