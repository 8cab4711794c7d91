r"""Velocities of motions, transported to one tangent space.

The fields Φ(f_k) of the frames are joined by geodesics. The velocity at the middle of each is
transported along a geodesic to one fixed point, the fields of a reference surface (Su, Kurtek,
Klassen and Srivastava, "Statistical analysis of trajectories on Riemannian manifolds", Annals of
Applied Statistics 8, 2014). There all velocities of all motions are vectors of one Euclidean space,
in orthonormal coordinates.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import NotDefinedError
from riemhuman.geometry import EbinMetric, FlatMetric, NormalFieldMetric, RotationFieldMetric
from riemhuman.kernels.special_orthogonal import axial, transpose
from riemhuman.motions.frames import Motion, frame_runs
from riemhuman.terms import ebin_tangent


class TransportedVelocities:
    """Velocities of motions at the fields of one reference surface.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on surfaces, pulled back from one with exp, log and parallel transport.
    reference : array, shape (V, 3)
        The reference surface.

    Raises
    ------
    NotDefinedError
        If the metric is of another kind.
    """

    def __init__(self, metric: Any, reference: ndarray) -> None:
        if not metric.has_target_metric:
            raise NotDefinedError(
                f"rate-invariant distances need a metric of fields with log and transport, such as "
                f"ElasticMetric, RotationMetric or SRNFMetric; found {type(metric).__name__}"
            )
        self._metric: Any = metric
        self._fields: Any = metric.target_metric
        self._base = metric.map(reference)
        self._charts = list(_charts(self._fields, self._base))

    def segments(self, motion: Motion, name: str = "motion") -> ndarray:
        """Return log Φ(f_{k+1}) at Φ(f_k), transported, for all k.

        Parameters
        ----------
        motion : array or sequence, shape (n_frames, V, 3)
            Motion of at least two frames.
        name : str
            Name of the motion, for messages.

        Returns
        -------
        array, shape (n_frames - 1, p)
            Orthonormal coordinates.

        Raises
        ------
        OutsideManifoldError
            If the fields of a frame have no unique geodesic to those of the next or of the
            reference.
        """
        rows: list[ndarray] = []
        last = None
        for run in frame_runs(self._metric.space, motion, name):
            fields = self._metric.map(run)
            joined = fields if last is None else np.concatenate([last, fields])
            last = fields[-1:]
            starts = joined[:-1]
            velocities = self._fields.log(joined[1:], starts)
            half = 0.5 * velocities
            middles = self._fields.exp(half, starts)
            velocities = self._fields.parallel_transport(velocities, starts, direction=half)
            carried = self._fields.parallel_transport(
                velocities, middles, end_point=np.broadcast_to(self._base, middles.shape)
            )
            rows.append(self._coordinates(carried))
        return np.concatenate(rows)

    def _coordinates(self, vectors: ndarray) -> ndarray:
        parts: Any = [vectors]
        if self._fields.space.factors:
            parts = self._fields.space.project_from_product(vectors)
        return np.concatenate(
            [chart(part) for chart, part in zip(self._charts, parts, strict=True)],
            axis=1,
        )


def _charts(metric: Any, base: ndarray) -> Any:
    """Yield what takes tangent vectors at a point, factor by factor, to orthonormal coordinates."""
    if not metric.space.factors:
        yield _chart(metric, base, 1.0)
        return
    bases = metric.space.project_from_product(base)
    for factor, part, weight in zip(metric.space.factors, bases, metric.weights, strict=True):
        yield _chart(factor.metric, part, weight)


def _chart(metric: Any, base: ndarray, weight: float) -> Any:
    if isinstance(metric, NormalFieldMetric):
        roots = np.sqrt(weight * metric.space.template.face_areas)[:, None]
        return lambda v: (roots * v).reshape(len(v), -1)
    if isinstance(metric, RotationFieldMetric):
        roots = np.sqrt(weight * metric.space.template.face_areas)[:, None]
        return lambda v: (roots * axial(np.matmul(transpose(base), v))).reshape(len(v), -1)
    if isinstance(metric, FlatMetric):
        roots = np.sqrt(weight * metric.covector(np.ones(metric.space.shape), base))
        return lambda v: (roots * v).reshape(len(v), -1)
    if isinstance(metric, EbinMetric):
        return _ebin_chart(metric, base, weight)
    raise NotDefinedError(
        f"rate-invariant distances need the fields of an elastic metric, of rotations or of flat "
        f"terms; found {type(metric).__name__}"
    )


def _ebin_chart(metric: EbinMetric, base: ndarray, weight: float) -> Any:
    """Return coordinates of h at g: the trace of L⁻¹hL⁻ᵀ, with g = LLᵀ, and what is left of it."""
    scale = np.sqrt(weight * metric.space.template.face_areas * np.sqrt(np.linalg.det(base)))

    def coordinates(h: ndarray) -> ndarray:
        whitened = ebin_tangent.whiten(h, base)
        first, second = whitened[..., 0, 0], whitened[..., 1, 1]
        parts = [
            np.sqrt(metric.lam) * (first + second),
            np.sqrt(0.5) * (first - second),
            np.sqrt(2.0) * whitened[..., 0, 1],
        ]
        return (scale[:, None] * np.stack(parts, axis=-1)).reshape(len(h), -1)

    return coordinates
