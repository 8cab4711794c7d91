"""Deformation bases: a few directions in which a surface deforms, from motions or from a mesh."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator, Sized
from itertools import chain
from typing import TypeAlias, TypeGuard

import autograd.numpy as anp
import numpy as np
from numpy.typing import ArrayLike
from tqdm import tqdm

from riemhuman.arrays import Array, PointsOnDemand
from riemhuman.checks import (
    check_same_scale,
    checked,
    flag,
    instance,
    longest_side,
    real_array,
    whole,
)
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.io.arrays import load_arrays, save_arrays
from riemhuman.io.mesh_arrays import read_only
from riemhuman.kernels.projections import with_positive_peaks
from riemhuman.kernels.surface import joined_axes
from riemhuman.surfaces.spectra import harmonics
from riemhuman.surfaces.template import Template

MotionLike: TypeAlias = Iterable[object] | PointsOnDemand

# A deformation lies in a basis if less than this share of its size is outside.
_OUTSIDE = 1e-9
# Largest deviation from orthonormal vectors that is accepted.
_ORTHONORMAL = 1e-8
_FORMAT_VERSION = 1


class DeformationBasis:
    r"""Orthonormal deformations :math:`D_k` of a surface, the search directions of solvers.

    Paths are sought as :math:`f + \sum_k \alpha_k D_k` (section 4 of the paper). The vectors are
    orthonormal: :math:`\sum_v D_k(v) \cdot D_l(v) = \delta_{kl}`.

    Parameters
    ----------
    vectors : array_like, shape (K, V, 3)
    orthonormalize : bool
        Whether to make them orthonormal by the Gram–Schmidt process. By default they are checked
        to be orthonormal within 1e-8.

    Attributes
    ----------
    explained_variance, explained_variance_ratio : array, shape (K,), or None
        Mean square of the coefficients of the motions that the vectors come from, and its share of
        the total.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> basis = rh.DeformationBasis.from_laplacian(bodies.template, n_components=20)
    >>> basis.vectors.shape
    (20, 1202, 3)
    >>> basis.project(bodies[1] - bodies[0]).shape  # the part of a deformation in the basis
    (1202, 3)
    """

    # Read by jobs to recognise a basis: its vectors are orthonormal whatever the argument was.
    _orthonormalize = False

    @checked(orthonormalize=flag)
    def __init__(self, vectors: ArrayLike, *, orthonormalize: bool = False) -> None:
        values = real_array(vectors, "vectors", ("n_components", "n_vertices", 3), batched=False)
        if values.size == 0:
            raise ArgumentError(
                f"vectors must hold at least one deformation; found shape {values.shape}"
            )
        if orthonormalize:
            rows = orthonormal_rows(values.reshape(len(values), -1), "vectors")
            self._vectors = read_only(rows.reshape(values.shape))
        else:
            self._vectors = read_only(np.array(values, order="C"))
            deviation = float(np.abs(self.flat @ self.flat.T - np.eye(len(self))).max())
            if deviation > _ORTHONORMAL:
                raise ArgumentError(
                    f"vectors must be orthonormal within {_ORTHONORMAL:g}; their inner products "
                    f"deviate by up to {deviation:.3g}: pass orthonormalize=True to "
                    "orthonormalize them"
                )
        self.explained_variance: Array | None = None
        self.explained_variance_ratio: Array | None = None

    @classmethod
    @checked(
        n_components=whole(minimum=1),
        step=whole(minimum=1),
        memory=whole(minimum=1),
        progress=flag,
    )
    def from_motions(
        cls,
        motions: Iterable[MotionLike],
        n_components: int = 100,
        step: int = 10,
        *,
        memory: int = 2**28,
        progress: bool = False,
    ) -> DeformationBasis:
        """Return the principal components of the deformations m_{nτ+τ} - m_{nτ} in motions.

        Frames are taken from each motion m at 0, τ, 2τ, … (section 4 of the paper), and need not
        fit in memory. The components are exact if the deformations fit in `memory`; beyond, these
        are merged in their order.

        Parameters
        ----------
        motions : iterable
            Motions, each an array (n_frames, V, 3) or an iterable of frames (V, 3). Both may be
            generators. If a motion has a length and can be indexed, but is not an array, list or
            tuple, only every τ-th frame is read.
        n_components : int
        step : int
            Number of frames τ from the first to the second frame of a deformation.
        memory : int
            Bytes of deformations that are kept at once, by default 256 MiB, but always three for
            each component.
        progress : bool
        """
        pairs = frames_apart(motions, step, progress=progress)
        first_start, first_end = next(pairs)
        n_features, largest = first_start.size, 0.0

        def deformations() -> Iterator[Array]:
            nonlocal largest
            for start, end in chain([(first_start, first_end)], pairs):
                largest = max(largest, float(np.abs(start).max()), float(np.abs(end).max()))
                yield (end - start).ravel()

        values, rows, n_samples, total = singular_rows(
            deformations(), n_components, n_features, memory
        )
        # Frames are rounded, each entry by up to ε times the largest; so are the values.
        epsilon = np.finfo(np.float64).eps
        noise = epsilon * largest * (np.sqrt(n_samples) + np.sqrt(n_features))
        resolution = max(n_samples, n_features) * epsilon
        rank = int(np.sum(values > resolution * values.max() + noise))
        if rank < n_components:
            raise ArgumentError(
                f"n_components={n_components} exceeds the rank {rank} of the {n_samples} "
                "deformations; ask for at most that many"
            )
        values = values[:n_components]
        vectors = with_positive_peaks(rows[:n_components] / values[:, np.newaxis])
        basis = cls(vectors.reshape(-1, *first_start.shape), orthonormalize=True)
        basis._set_statistics(values**2 / n_samples, values**2 / total)
        return basis

    @classmethod
    @checked(template=instance(Template), n_components=whole(minimum=1))
    def from_laplacian(cls, template: Template, n_components: int = 100) -> DeformationBasis:
        """Return mesh harmonics of the template, each along x, then y, then z.

        The harmonics are the ceil(K / 3) lowest eigenfunctions of the cotangent Laplacian,
        orthonormalised in their order. Constant eigenfunctions are left out: they translate the
        body or one of its connected components, and metrics on (g, n) vanish on translations.

        Parameters
        ----------
        template : Template
            The mesh; it may be open or non-manifold.
        n_components : int
            Number of components K. If it is not a multiple of 3, the last harmonic is used only
            along x, or along x and y.
        """
        _, functions = harmonics(template, math.ceil(n_components / 3))
        functions = orthonormal_rows(functions, "harmonics")
        vectors = np.zeros((len(functions), 3, template.n_vertices, 3))
        for axis in range(3):
            vectors[:, axis, :, axis] = functions
        vectors = vectors.reshape(-1, template.n_vertices, 3)[:n_components]
        return cls(vectors)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> DeformationBasis:
        """Read a basis that `save` has written.

        Parameters
        ----------
        path : path_like
        """
        fields = load_arrays(path, ("format_version", "vectors"))
        version = fields["format_version"].tolist()
        if version != _FORMAT_VERSION:
            raise FileFormatError(
                f"{os.fspath(path)} has format version {str(version)[:40]}; "
                f"this release reads version {_FORMAT_VERSION}"
            )
        try:
            basis = cls(fields["vectors"])
            variance = fields.get("explained_variance")
            basis._set_statistics(variance, fields.get("explained_variance_ratio"))
        except (ArgumentError, ArgumentTypeError) as error:
            raise FileFormatError(f"{os.fspath(path)}: {error}") from error
        return basis

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the basis to an .npz file that reads back bit for bit.

        Parameters
        ----------
        path : path_like
            The file, with its suffix; an existing file is replaced.
        """
        fields = {"format_version": np.array(_FORMAT_VERSION), "vectors": self.vectors}
        if self.explained_variance is not None:
            fields["explained_variance"] = self.explained_variance
        if self.explained_variance_ratio is not None:
            fields["explained_variance_ratio"] = self.explained_variance_ratio
        save_arrays(path, fields)

    @property
    def vectors(self) -> Array:
        """The deformations, shape (K, V, 3), read-only, orthonormal."""
        return self._vectors

    @property
    def flat(self) -> Array:
        """The deformations as rows, shape (K, 3V), read-only, C-contiguous, not copied."""
        return self._vectors.reshape(len(self), -1)

    @property
    def n_components(self) -> int:
        """Number of deformations K."""
        return len(self._vectors)

    @property
    def n_vertices(self) -> int:
        """Number of vertices V."""
        return len(self._vectors[0])

    def coefficients(self, deformation: ArrayLike) -> Array:
        """Return the inner products of deformations with the vectors, shape (..., K).

        Parameters
        ----------
        deformation : array_like, shape (..., V, 3)
        """
        deformation = real_array(deformation, "deformation", (self.n_vertices, 3))
        return anp.matmul(joined_axes(deformation, 2), self.flat.T)

    def combine(self, coefficients: ArrayLike) -> Array:
        r"""Return the deformations :math:`\sum_k \alpha_k D_k`, shape (..., V, 3).

        Parameters
        ----------
        coefficients : array_like, shape (..., K)
        """
        coefficients = real_array(coefficients, "coefficients", (len(self),))
        rows = anp.matmul(coefficients, self.flat)
        return anp.reshape(rows, (*coefficients.shape[:-1], self.n_vertices, 3))

    def project(self, deformation: ArrayLike) -> Array:
        """Project deformations onto the span of the vectors, shape (..., V, 3).

        Parameters
        ----------
        deformation : array_like, shape (..., V, 3)
        """
        return self.combine(self.coefficients(deformation))

    def check_fits(self, template: Template | int) -> None:
        """Raise an error unless a template has the same number of vertices as the basis.

        Parameters
        ----------
        template : Template or int
            The template, or its number of vertices.
        """
        expected = template.n_vertices if isinstance(template, Template) else template
        if self.n_vertices != expected:
            raise ArgumentError(
                f"the basis belongs to another template: it has {self.n_vertices} vertices, "
                f"the template has {expected}"
            )

    def __len__(self) -> int:
        return self.n_components

    def __repr__(self) -> str:
        return f"DeformationBasis(n_components={len(self)}, n_vertices={self.n_vertices})"

    @checked(n_components=whole(minimum=1))
    def truncate(self, n_components: int) -> DeformationBasis:
        """Return a basis of the first vectors.

        Parameters
        ----------
        n_components : int
        """
        if n_components > len(self):
            raise ArgumentError(
                f"n_components={n_components} exceeds the {len(self)} vectors of the basis"
            )
        basis = type(self)(self.vectors[:n_components])
        if self.explained_variance is not None:
            basis.explained_variance = self.explained_variance[:n_components]
        if self.explained_variance_ratio is not None:
            basis.explained_variance_ratio = self.explained_variance_ratio[:n_components]
        return basis

    def extend(self, deformations: Array) -> DeformationBasis:
        """Return this basis extended by more deformations.

        Parameters
        ----------
        deformations : array, shape (m, V, 3)
            More deformations; their projections onto the basis are subtracted.
        """
        shape = ("n_deformations", "n_vertices", 3)
        deformations = real_array(deformations, "deformations", shape, batched=False)
        self.check_fits(deformations.shape[1])
        flat = self.flat
        for row in deformations.reshape(len(deformations), flat.shape[1]):
            outside = row - (flat @ row) @ flat
            if np.abs(outside).max() > _OUTSIDE * np.abs(row).max():
                outside /= np.linalg.norm(outside)
                # Of a short remainder, rounding errors left a part inside.
                outside -= (flat @ outside) @ flat
                flat = np.concatenate([flat, [outside / np.linalg.norm(outside)]])
        added = len(flat) > len(self)
        return DeformationBasis(flat.reshape(-1, self.n_vertices, 3)) if added else self

    def _set_statistics(self, variance: Array | None, ratio: Array | None) -> None:
        if variance is not None:
            variance = real_array(variance, "explained_variance", (len(self),), batched=False)
            self.explained_variance = read_only(variance)
        if ratio is not None:
            ratio = real_array(ratio, "explained_variance_ratio", (len(self),), batched=False)
            self.explained_variance_ratio = read_only(ratio)


_REMEDY = "a basis needs lengths to weight deformations"


def frames_apart(
    motions: Iterable[MotionLike], step: int = 10, *, progress: bool = False
) -> Iterator[tuple[Array, Array]]:
    """Yield the frames m_{nτ} and m_{nτ+τ} of every motion m, for n = 0, 1, …."""
    if isinstance(motions, np.ndarray) and motions.ndim == 3:
        raise ArgumentError(
            f"motions must hold several motions; found one, of shape {motions.shape}: pass it in "
            "a list, [motion]"
        )
    reference: Array | None = None
    n_motions = len(motions) if isinstance(motions, Sized) else None
    bar = tqdm(motions, desc="Motions", total=n_motions, unit="motion", disable=not progress)
    for index, motion in enumerate(bar):
        name, start = f"motions[{index}]", None
        for frame in _every_step(motion, step, name):
            if reference is None:
                reference = frame
            if len(frame) != len(reference):
                raise ArgumentError(
                    f"{name} has {len(frame)} vertices; the motions before it have {len(reference)}"
                )
            if start is None:
                side = longest_side(reference)
                check_same_scale(frame, side, name, "the first motion", remedy=_REMEDY)
            else:
                yield start, frame
            start = frame
    if reference is None:
        raise ArgumentError("motions must hold at least one motion; found none")


def _every_step(motion: MotionLike, step: int, name: str) -> Iterator[Array]:
    """Yield every step-th frame of a motion; of one on disk, or on demand, no others are read."""
    if _is_on_demand(motion):
        n_frames = len(motion)
        _check_length(n_frames, step, name)
        n_vertices = None
        for number in range(0, n_frames, step):
            frame = _checked_frame(motion[number], number, name, n_vertices)
            n_vertices = len(frame)
            # What makes frames on demand may reuse one array for all of them.
            yield frame.copy()
        return
    n_frames, n_vertices = 0, None
    for number, vertices in enumerate(motion):  # type: ignore[arg-type]  # not on demand
        frame = _checked_frame(vertices, number, name, n_vertices)
        n_frames, n_vertices = number + 1, len(frame)
        if number % step == 0:
            yield frame.copy()
    _check_length(n_frames, step, name)


def _checked_frame(vertices: object, number: int, name: str, n_vertices: int | None) -> Array:
    """Return a frame of a motion that has so many vertices, if they are known."""
    label = f"frame {number} of {name}"
    frame = real_array(vertices, label, ("n_vertices", 3), batched=False)
    if n_vertices is not None and len(frame) != n_vertices:
        raise ArgumentError(
            f"{label} has {len(frame)} vertices; the frames before it have {n_vertices}"
        )
    return frame


def _check_length(n_frames: int, step: int, name: str) -> None:
    if n_frames <= step:
        raise ArgumentError(
            f"{name} has {n_frames} frames; with step={step} a motion needs at least {step + 1}"
        )


def _is_on_demand(motion: MotionLike) -> TypeGuard[PointsOnDemand]:
    is_in_memory = isinstance(motion, (np.ndarray, list, tuple, str))
    return hasattr(motion, "__getitem__") and not is_in_memory


def singular_rows(
    rows: Iterable[Array], n_components: int, n_features: int, memory: int = 2**28
) -> tuple[Array, Array, int, float]:
    """Return the strongest singular values S and S Vᵀ of rows, their number and sum of squares.

    Rows are collected up to `memory` bytes. The rows A = U S Vᵀ of a full buffer are replaced by
    half as many, the strongest rows of S Vᵀ. Each such merge lowers AᵀA, in the spectral norm, by
    the square of the largest singular value that it drops, and keeps at least 1.5 K larger ones.
    """
    n_buffered = max(3 * n_components, min(memory // (8 * n_features), 2 * n_features))
    buffer = np.empty((n_buffered, n_features))
    n_filled = n_rows = 0
    sum_of_squares = 0.0
    for row in rows:
        if n_filled == len(buffer):
            values = _merge(buffer, max(len(buffer) // 2, n_components))
            n_filled = len(values)
        buffer[n_filled] = row
        n_filled += 1
        n_rows += 1
        sum_of_squares += float(row @ row)
    values = _merge(buffer[:n_filled], n_filled)
    return values, buffer[: len(values)], n_rows, sum_of_squares


def _merge(rows: Array, most: int) -> Array:
    """Overwrite the first rows by the strongest rows of S Vᵀ; return their singular values."""
    # With Aᵀ = Q R, A and Rᵀ have the same left singular vectors. Unlike A Aᵀ, R keeps small
    # singular values to full precision.
    triangle: Array = np.linalg.qr(rows.T, mode="r")  # type: ignore[assignment]  # not a pair
    left, values, _ = np.linalg.svd(triangle.T, full_matrices=False)
    values = values[:most]
    rows[: len(values)] = left[:, : len(values)].T @ rows
    return values


def orthonormal_rows(rows: Array, name: str) -> Array:
    """Orthonormalise rows by the Gram–Schmidt process."""
    sizes = np.linalg.norm(rows, axis=1)
    sizes[sizes == 0] = 1.0
    columns, triangle = np.linalg.qr((rows / sizes[:, np.newaxis]).T)
    values = np.linalg.svd(triangle, compute_uv=False)
    rank = int(np.sum(values > max(rows.shape) * np.finfo(np.float64).eps * values.max()))
    if rank < len(rows):
        raise ArgumentError(
            f"{name} must be linearly independent; the rank of these {len(rows)} is {rank}"
        )
    return np.ascontiguousarray((columns * np.sign(triangle.diagonal())).T)
