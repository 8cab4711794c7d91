"""Deformation bases: a few directions in which a surface deforms, from motions or from a mesh."""

from __future__ import annotations

import os
from collections.abc import Iterable
from itertools import chain
from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy.typing import ArrayLike

from riemhuman.checks import real_array, whole_number
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.mesh_arrays import read_only
from riemhuman.surfaces.laplacian import harmonics
from riemhuman.surfaces.motion_frames import frames_apart
from riemhuman.surfaces.orthonormal_deformations import OrthonormalDeformations
from riemhuman.surfaces.streaming_pca import StreamingPCA
from riemhuman.surfaces.template import Template
from riemhuman.surfaces.vertex_weights import (
    normalized_weights,
    orthonormal_rows,
    vectors_of_rows,
    weighted_rows,
)

# A deformation lies in a basis if less than this share of its size is outside.
_OUTSIDE = 1e-9
_FORMAT_VERSION = 1
_STATISTICS = ("explained_variance", "explained_variance_ratio", "mean")


class DeformationBasis(OrthonormalDeformations):
    r"""Orthonormal deformations :math:`D_k` of a surface, the search directions of solvers.

    Paths are sought as :math:`f + \sum_k \alpha_k D_k` [1]_, section 4. The vectors are
    orthonormal with respect to :math:`\langle d, e \rangle = \sum_v \omega_v\, d_v \cdot e_v`,
    where the vertex weights :math:`\omega_v` are 1 or given.

    Parameters
    ----------
    vectors : array_like, shape (K, V, 3)
        The deformations; they are copied.
    orthonormalize : bool
        Whether to make them orthonormal by the Gram–Schmidt process. By default they are checked
        to be orthonormal within 1e-8.
    vertex_weights : array_like, shape (V,), optional
        Positive weights of the inner product, such as `Template.vertex_areas`; they are scaled to
        mean 1, so that coefficients keep their magnitude.

    Raises
    ------
    ArgumentTypeError
        If an array does not hold real numbers.
    ArgumentError
        If a shape is wrong, an entry is not finite, a weight is not positive, or the vectors are
        not orthonormal; with `orthonormalize`, if they are not linearly independent.

    References
    ----------
    .. [1] Pierson, Daoudi, Tumpach, "A Riemannian Framework for Analysis of Human Body Surface",
       WACV 2022.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> basis.vectors.shape
    (20, 1202, 3)
    >>> closest = basis.project(bodies[1] - bodies[0])  # the part of a deformation in the basis
    >>> closest.shape
    (1202, 3)
    """

    def __init__(
        self,
        vectors: ArrayLike,
        *,
        orthonormalize: bool = False,
        vertex_weights: ArrayLike | None = None,
    ) -> None:
        super().__init__(vectors, orthonormalize=orthonormalize, vertex_weights=vertex_weights)
        self._explained_variance: onp.ndarray | None = None
        self._explained_variance_ratio: onp.ndarray | None = None
        self._mean: onp.ndarray | None = None

    @classmethod
    def from_motions(
        cls,
        motions: Iterable[Any],
        n_components: int = 100,
        step: int = 10,
        *,
        remove_mean: bool = False,
        vertex_weights: ArrayLike | None = None,
        progress: bool = False,
    ) -> DeformationBasis:
        """Return the principal components of the deformations m_{nτ+τ} - m_{nτ} seen in motions.

        Frames are taken from each motion m at 0, τ, 2τ, … ([1]_, section 4). Motions are streamed:
        neither they nor their deformations need fit in memory. The components are exact up to
        256 MiB of deformations (some 800 of a body with 13,348 vertices); beyond, deformations
        are merged in their order, see `riemhuman.surfaces.streaming_pca`.

        Parameters
        ----------
        motions : iterable
            Motions, each an array (n_frames, V, 3) or an iterable of frames (V, 3) or of blocks of
            frames (n, V, 3). Both may be generators. Of a motion that has a length and can be
            indexed, but is not an array, list or tuple, only every τ-th frame is read.
        n_components : int
            Number of components K.
        step : int
            Number of frames τ from the first to the second frame of a deformation.
        remove_mean : bool
            Whether the mean deformation is removed first and kept as `mean`.
        vertex_weights : array_like, shape (V,), optional
            Weights of the inner product, as in the constructor.
        progress : bool
            Whether to show a progress bar over motions.

        Returns
        -------
        basis : DeformationBasis
            The K strongest components, with their explained variance.

        Raises
        ------
        ArgumentTypeError
            If a motion cannot be iterated over or a frame does not hold real numbers.
        ArgumentError
            If there is no motion, one is shorter than τ + 1 frames, vertex counts disagree, a
            frame is not finite, or the deformations have a rank below K.

        References
        ----------
        .. [1] Pierson, Daoudi, Tumpach, "A Riemannian Framework for Analysis of Human Body
           Surface", WACV 2022.
        """
        n_components = whole_number(n_components, "n_components", minimum=1)
        pairs = frames_apart(motions, step, progress=progress)
        first = next(pairs)
        weights = normalized_weights(vertex_weights, len(first[0]))
        pca = StreamingPCA(n_components, first[0].size, remove_mean=remove_mean)
        largest = 0.0
        for start, end in chain([first], pairs):
            pca.add(weighted_rows((end - start)[onp.newaxis], weights)[0])
            largest = max(largest, float(onp.abs(start).max()), float(onp.abs(end).max()))
        scale = 1.0 if weights is None else float(onp.sqrt(weights.max()))
        found = pca.components(rounding=onp.finfo(onp.float64).eps * scale * largest)
        if found.rank < n_components:
            centred = " less their mean" if remove_mean else ""
            raise ArgumentError(
                f"n_components={n_components} exceeds the rank {found.rank} of the "
                f"{found.n_samples} deformations{centred}; ask for at most that many"
            )
        basis = cls(
            vectors_of_rows(found.vectors, weights),
            orthonormalize=True,
            vertex_weights=vertex_weights,
        )
        mean = None if found.mean is None else vectors_of_rows(found.mean[onp.newaxis], weights)[0]
        return basis._described(found.variance, found.variance_ratio, mean)

    @classmethod
    def from_laplacian(
        cls, template: Template, n_components: int = 100, *, vertex_weights: ArrayLike | None = None
    ) -> DeformationBasis:
        """Return mesh harmonics of the template, each along x, then y, then z.

        The harmonics are the ceil(K / 3) lowest eigenfunctions of the cotangent Laplacian,
        orthonormalised in their order. Constant eigenfunctions are left out: they translate the
        body or one of its connected components, and metrics on (g, n) vanish on translations.

        Parameters
        ----------
        template : Template
            The mesh; open and non-manifold meshes are legal.
        n_components : int
            Number of components K. If it is not a multiple of 3, the last harmonic is used only
            along x, or along x and y.
        vertex_weights : array_like, shape (V,), optional
            Weights of the inner product, as in the constructor.

        Returns
        -------
        basis : DeformationBasis

        Raises
        ------
        ArgumentTypeError
            If the weights are not real numbers.
        ArgumentError
            If the mesh has too few harmonics, or the weights do not fit it.
        """
        n_components = whole_number(n_components, "n_components", minimum=1)
        weights = normalized_weights(vertex_weights, template.n_vertices)
        _, functions = harmonics(template, -(-n_components // 3))
        roots = 1.0 if weights is None else onp.sqrt(weights)
        functions = orthonormal_rows(functions * roots, "harmonics") / roots
        vectors = onp.zeros((len(functions), 3, template.n_vertices, 3))
        for axis in range(3):
            vectors[:, axis, :, axis] = functions
        vectors = vectors.reshape(-1, template.n_vertices, 3)[:n_components]
        return cls(vectors, vertex_weights=vertex_weights)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> DeformationBasis:
        """Read a basis that `save` has written.

        Parameters
        ----------
        path : path_like
            The .npz file. Pickled objects in it are refused.

        Returns
        -------
        basis : DeformationBasis

        Raises
        ------
        FileError
            If the file is missing or cannot be read.
        FileFormatError
            If it is not such a file, comes from a later version, lacks a field, or does not hold an
            orthonormal basis.
        """
        fields = load_arrays(path, ("format_version", "vectors"))
        version = fields["format_version"].tolist()
        if version != _FORMAT_VERSION:
            raise FileFormatError(
                f"{os.fspath(path)} has format version {str(version)[:40]}; "
                f"this release reads version {_FORMAT_VERSION}"
            )
        try:
            basis = cls(fields["vectors"], vertex_weights=fields.get("vertex_weights"))
            shapes = ((len(basis),), (len(basis),), (basis.n_vertices, 3))
            statistics = [
                real_array(fields[name], name, shape, batched=False) if name in fields else None
                for name, shape in zip(_STATISTICS, shapes, strict=True)
            ]
        except (ArgumentError, ArgumentTypeError) as error:
            raise FileFormatError(f"{os.fspath(path)}: {error}") from error
        return basis._described(*statistics)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the basis to an .npz file that reads back bit for bit.

        The file appears whole or not at all.

        Parameters
        ----------
        path : path_like
            The file, with its suffix; an existing file is replaced.

        Raises
        ------
        FileError
            If the file cannot be written.
        """
        fields = {"format_version": onp.array(_FORMAT_VERSION), "vectors": self.vectors}
        for name in ("vertex_weights", *_STATISTICS):
            if getattr(self, name) is not None:
                fields[name] = getattr(self, name)
        save_arrays(path, fields)

    @property
    def explained_variance(self) -> onp.ndarray | None:
        """Variance of motions along each vector, shape (K,), or None for another basis.

        It is the mean square of the coefficients of all deformations, or their sample variance if
        the mean was removed.
        """
        return self._explained_variance

    @property
    def explained_variance_ratio(self) -> onp.ndarray | None:
        """Variance along each vector as a share of the total, shape (K,), or None."""
        return self._explained_variance_ratio

    @property
    def mean(self) -> onp.ndarray | None:
        """The mean deformation, shape (V, 3), if it was removed, otherwise None."""
        return self._mean

    def truncated(self, n_components: int) -> DeformationBasis:
        """Return a basis of the first vectors.

        Parameters
        ----------
        n_components : int
            Number of vectors to keep.

        Returns
        -------
        basis : DeformationBasis

        Raises
        ------
        ArgumentError
            If there are fewer vectors.
        """
        kept = whole_number(n_components, "n_components", minimum=1)
        if kept > len(self):
            raise ArgumentError(f"n_components={kept} exceeds the {len(self)} vectors of the basis")
        basis = type(self)(self.vectors[:kept], vertex_weights=self.vertex_weights)
        variance, ratio = self.explained_variance, self.explained_variance_ratio
        return basis._described(
            None if variance is None else variance[:kept],
            None if ratio is None else ratio[:kept],
            self.mean,
        )

    def joined(self, deformations: np.ndarray) -> DeformationBasis:
        """Return this basis extended by more deformations.

        Parameters
        ----------
        deformations : array, shape (m, V, 3)
            More deformations; their projections onto the basis are subtracted.

        Returns
        -------
        basis : DeformationBasis
            At most m vectors more: deformations in the span of the basis and of those before them
            add none.
        """
        basis = self
        for deformation in deformations:
            basis.check_fits(len(deformation))
            outside = deformation - basis.project(deformation)
            if np.abs(outside).max() > _OUTSIDE * np.abs(deformation).max():
                basis = DeformationBasis(
                    np.concatenate([basis.vectors, outside[None]]),
                    orthonormalize=True,
                    vertex_weights=basis.vertex_weights,
                )
        return basis

    def _described(
        self, variance: onp.ndarray | None, ratio: onp.ndarray | None, mean: onp.ndarray | None
    ) -> DeformationBasis:
        """Set the statistics of the motions that the vectors come from."""
        self._explained_variance = None if variance is None else read_only(variance)
        self._explained_variance_ratio = None if ratio is None else read_only(ratio)
        self._mean = None if mean is None else read_only(mean)
        return self
