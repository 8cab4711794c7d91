r"""Gram-Hankel matrices: sequences compared by the dynamics of their frames.

Frames are currents, in a Hilbert space with a Gaussian kernel of width σ:

.. math:: \langle f, h\rangle = \sum_{t, s} \langle a_t, b_s\rangle\, e^{-|x_t - y_s|^2/\sigma^2}

over triangles with centres x, y and area vectors a, b. Of a sequence f_1, …, f_N, H is the Hankel
matrix of r rows, and G = H Hᵀ has the entries :math:`\sum_k \langle f_{i+k}, f_{j+k}\rangle`;
sequences are as far apart as their matrices G, each over its norm, after Pierson, Daoudi and
Arguillère, "3D shape sequence of human comparison and classification using current and varifolds"
(arXiv 2111.13985). The kernel is the mean over random Fourier features here (Rahimi and Recht,
2007): frames become vectors, and no sum over pairs of triangles is needed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray
from scipy.spatial.distance import pdist, squareform

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.motions.frames import Motion, frame_runs, several_motions

if TYPE_CHECKING:
    from riemhuman.geometry import AlignedSurfaces


@dataclass(frozen=True)
class GramHankel:
    """Distances of sequences by normalised products of Hankel matrices.

    They do not change when all frames turn together. They change with the speed.

    Parameters
    ----------
    space : AlignedSurfaces
        Space of the frames.
    width : float
        Width σ of the kernel, metres.
    n_rows : int
        Rows r of the Hankel matrix; a sequence needs at least r frames.
    n_features : int
        Number of random Fourier features.
    seed : int
        Seed of the random features.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> hankel = rh.motions.GramHankel(rh.AlignedSurfaces(knees[0].template))
    >>> hankel.dist_pairwise([m[:60:3] for m in knees]).shape
    (2, 2)
    """

    space: AlignedSurfaces
    width: float = 0.2
    n_rows: int = 8
    n_features: int = 64
    seed: int = 0

    def __post_init__(self) -> None:
        real_number(self.width, "width", minimum=0.0, strict=True)
        whole_number(self.n_rows, "n_rows", minimum=1)
        whole_number(self.n_features, "n_features", minimum=1)
        whole_number(self.seed, "seed", minimum=0)

    def describe(self, motion: Motion, name: str = "motion") -> ndarray:
        """Return G divided by its norm.

        Parameters
        ----------
        motion : array or sequence, shape (n_frames, V, 3)
            Motion of at least r frames.
        name : str
            Name of the motion, for messages.

        Returns
        -------
        array, shape (r, r)

        Raises
        ------
        ArgumentError
            If a frame is wrong, or there are too few.
        """
        rows = np.concatenate([self._currents(run) for run in frame_runs(self.space, motion, name)])
        if len(rows) < self.n_rows:
            raise ArgumentError(
                f"{name} must have at least n_rows={self.n_rows} frames; found {len(rows)}"
            )
        gram = rows @ rows.T
        n_columns = len(rows) - self.n_rows + 1
        hankel = sum(gram[k : k + self.n_rows, k : k + self.n_rows] for k in range(n_columns))
        return np.asarray(hankel / np.linalg.norm(hankel))

    def dist(self, m1: Motion, m2: Motion) -> float:
        """Return the distance of two motions.

        Parameters
        ----------
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions.

        Returns
        -------
        float
        """
        return float(np.linalg.norm(self.describe(m1, "m1") - self.describe(m2, "m2")))

    def dist_pairwise(self, motions: Sequence[Motion]) -> ndarray:
        """Return all distances within a set of motions.

        Parameters
        ----------
        motions : sequence of motions
            Motions.

        Returns
        -------
        array, shape (n, n)
        """
        several_motions(motions)
        rows = [self.describe(m, f"motions[{k}]").ravel() for k, m in enumerate(motions)]
        return squareform(pdist(np.stack(rows)))

    def _currents(self, run: ndarray) -> ndarray:
        """Return frames as vectors: area vectors times Fourier features at the centres."""
        rng = np.random.default_rng(self.seed)
        # The Fourier transform of exp(−|x|²/σ²) is a normal density of deviation √2/σ.
        waves = rng.normal(0.0, np.sqrt(2.0) / self.width, (3, self.n_features))
        faces = self.space.template.faces
        # Where the body is does not count.
        centred = run - run.mean(axis=1, keepdims=True)
        phases = centred[:, faces].mean(axis=2) @ waves
        vectors = np.swapaxes(np.asarray(self.space.normals(run)), 1, 2)
        parts = [vectors @ np.cos(phases), vectors @ np.sin(phases)]
        rows = np.stack(parts, axis=1) / np.sqrt(self.n_features)
        return np.asarray(rows.reshape(len(run), -1))
