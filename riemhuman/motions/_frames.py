"""Motions read in runs of frames, so that none needs to fit in memory, and distances of frames."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from riemhuman.arrays import Array, PointsByNumber, PointsLike, PointsOnDemand
from riemhuman.checks import length_of, values_of
from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, RiemannianMetric
from riemhuman.geometry.pairwise import Features, squared_dist_rectangle
from riemhuman.geometry.point_space import PointSpace
from riemhuman.kernels.projections import Projection
from riemhuman.motions._travel import ground_places, surface_space

Motion: TypeAlias = Array | PointsOnDemand
"""An array (n_frames, V, 3), or anything with a length whose slices are such arrays."""

# Frames that are read together.
_RUN = 16

# Principal components are computed from about this many frames: with more, their covariance
# hardly changes, and the cost grows with the cube of the number.
_MOST_SAMPLED = 600

# Squared distances of frames below this share of their squared norms are rounding.
_ROUNDING = 1e-13


TravelChannel: TypeAlias = Callable[[AlignedSurfaces, Motion, Array, str], Array]
"""Returns one number per frame, shape (n_frames,), for a motion, its places and its name."""


def frame_runs(
    space: PointSpace, motion: Motion, name: str = "motion", heading: bool = True
) -> Iterator[Array]:
    """Yield the frames of a motion in checked arrays of at most 16; see `face_forward`."""
    n_frames = frame_count(motion, name)
    for first in range(0, n_frames, _RUN):
        last = min(first + _RUN, n_frames)
        run = _checked_frames(space, motion, first, last, name)
        yield run if heading else face_forward(space, run)


def face_forward(space: PointSpace, frames: Array) -> Array:
    """Rotate each frame about the vertical axis, y, to its best fit with the template."""
    if not isinstance(space, AlignedSurfaces):
        return frames
    return rotate_upright(frames, angles_to(space, frames, space.template.vertices))


def angles_to(space: AlignedSurfaces, frames: Array, others: Array) -> Array:
    """Return the angles about the vertical axis, y, that rotate frames to best fit others."""
    weights = space.template.vertex_areas[:, None]
    level = others[..., [0, 2]]  # x and z, without the height
    centres = np.average(level, axis=-2, weights=weights[:, 0], keepdims=True)
    x, z = frames[..., 0], frames[..., 2]
    to_x, to_z = np.moveaxis(weights * (level - centres), -1, 0)
    along, across = x * to_x + z * to_z, x * to_z - z * to_x
    angles: Array = np.arctan2(across.sum(axis=-1), along.sum(axis=-1))
    return angles


def rotate_upright(frames: Array, angles: Array) -> Array:
    """Rotate each frame about the vertical axis, y, through the origin."""
    x, z = frames[..., 0], frames[..., 2]
    cosines, sines = np.cos(angles)[..., None], np.sin(angles)[..., None]
    return np.stack([cosines * x - sines * z, frames[..., 1], sines * x + cosines * z], axis=-1)


def surfaces_between(space: AlignedSurfaces, start: Array, end: Array, times: Array) -> Array:
    """Return the surfaces between two at times in [0, 1]; limbs keep their length."""
    surfaces = np.empty((len(times), *space.shape))
    surfaces[times == 0.0] = start
    surfaces[times == 1.0] = end
    inside = (times > 0.0) & (times < 1.0)
    if inside.any():
        space.check_immersed(np.stack([start, end]), "frames")
        interpolator = space.template.interpolator
        rotations = interpolator.unwrap(interpolator.rotations(start, end))
        surfaces[inside] = interpolator.interpolate(start, end, times[inside], rotations)
    return surfaces


def read_motion(space: PointSpace, motion: Motion, name: str = "motion") -> Array:
    """Return all frames of a motion as one checked array, shape (n_frames, V, 3)."""
    return np.concatenate(list(frame_runs(space, motion, name)))


def frame_count(motion: Motion, name: str = "motion", minimum: int = 1) -> int:
    """Return the number of frames; raise an error if there are fewer than `minimum`."""
    n_frames = length_of(motion, name)
    if n_frames < minimum:
        raise ArgumentError(f"{name} must have at least {minimum} frames; found {n_frames}")
    return n_frames


def check_motions(motions: object, name: str = "motions") -> None:
    """Raise an error if there is no motion, or a single one instead of a list."""
    if isinstance(motions, np.ndarray) and motions.ndim == 3:
        raise ArgumentError(
            f"{name} must contain several motions; found a single one, of shape {motions.shape}: "
            "pass it in a list, [motion]"
        )
    if length_of(motions, name) == 0:
        raise ArgumentError(f"{name} must contain at least one motion; found none")


def _checked_frames(space: PointSpace, motion: Motion, first: int, last: int, name: str) -> Array:
    """Return the frames from `first` up to, but without, `last`."""
    label = f"frames {first} to {last - 1} of {name}"
    values = values_of(motion[first:last], label)
    if values.ndim != 3:
        raise ArgumentError(f"{label} must have shape (n_frames, V, 3); found {values.shape}")
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        number = int(np.flatnonzero(~np.isfinite(values).all(axis=(1, 2)))[0])
        raise ArgumentError(
            f"frame {first + number} of {name} holds NaN or infinite entries; every entry must "
            "be finite"
        )
    return np.asarray(space.check_point(values, label))


def sampled_rows(
    motions: Sequence[Motion], rows_of: Callable[[Motion, str], Array], n_frames: int = 1
) -> Array:
    """Return rows that a function computes from evenly spaced runs of `n_frames` of the motions."""
    counts = [frame_count(m, f"motions[{k}]", n_frames) for k, m in enumerate(motions)]
    step = math.ceil(sum(counts) / _MOST_SAMPLED)
    rows = []
    for number, motion in enumerate(motions):
        for first in range(0, counts[number] - n_frames + 1, step):
            last = first + n_frames
            rows.append(rows_of(motion[first:last], f"motions[{number}][{first}:{last}]"))
    return np.concatenate(rows)


class _FramesOnDemand:
    """Single frames of a motion, read again where two are too close for single precision."""

    def __init__(self, space: PointSpace, motion: Motion, name: str, heading: bool) -> None:
        self._space = space
        self._motion = motion
        self._name = name
        self._heading = heading

    def __getitem__(self, number: int) -> Array:
        frames = _checked_frames(self._space, self._motion, number, number + 1, self._name)
        frame: Array = (frames if self._heading else face_forward(self._space, frames))[0]
        return frame


@dataclass(frozen=True)
class Frames:
    """What distances of frames need: features, the frames themselves, and travel."""

    features: Features
    points: PointsLike | PointsByNumber
    travel: Array | None = None


class FrameDistances:
    """Squared distances of frames by a metric, its lower-bound coordinates or their components.

    Features of exact distances are in single precision, and those of close pairs are computed again
    in double; if distances are subtracted from each other, all need double precision. With
    `travel`, which returns one number per frame, squared differences of these numbers are added.
    """

    def __init__(
        self,
        metric: RiemannianMetric,
        n_components: int | None = None,
        motions: Sequence[Motion] = (),
        *,
        heading: bool = False,
        flat: bool = False,
        travel: TravelChannel | None = None,
        precision: str = "single",
    ) -> None:
        self._metric = metric
        self._heading = heading
        self._travel = travel
        self._precision = precision
        self._flat = n_components is not None or (flat and metric.has_lower_bound_coordinates)
        self._projection: Projection | None = None
        if n_components is not None:
            rows = sampled_rows(motions, self._rows)
            self._projection = Projection.fit(rows, n_components)

    def _rows(self, motion: Motion, name: str) -> Array:
        """Return the lower-bound coordinates of a motion's frames."""
        runs = frame_runs(self._metric.space, motion, name, self._heading)
        return np.concatenate([self._metric.lower_bound_coordinates(run) for run in runs])

    def frames(self, motion: Motion, name: str) -> Frames:
        """Return what distances need of all frames of a motion."""
        space = self._metric.space
        features_of_runs: list[Features] = []
        places: list[Array] = []
        for run in frame_runs(space, motion, name):
            if self._travel is not None:
                places.append(ground_places(surface_space(space), run))
            turned = run if self._heading else face_forward(space, run)
            features_of_runs.append(self._features(turned))
        features = tuple(
            np.concatenate([run_features[part] for run_features in features_of_runs])
            for part in range(len(features_of_runs[0]))
        )
        travel = None
        if self._travel is not None:
            travel = self._travel(surface_space(space), motion, np.concatenate(places), name)
        return Frames(features, _FramesOnDemand(space, motion, name, self._heading), travel)

    def of_run(self, run: Array) -> Frames:
        """Return what distances need of checked frames that face forward."""
        return Frames(self._features(run), run)

    def _features(self, run: Array) -> Features:
        if not self._flat:
            features: Features = self._metric.features(run, self._precision)
            return features
        rows = self._metric.lower_bound_coordinates(run)
        return (rows if self._projection is None else self._projection(rows),)

    def squared(self, a: Frames, b: Frames) -> Array:
        """Return the squared distances between n and m frames, shape (n, m)."""
        if self._flat:
            squares = _squared_differences(a.features[0], b.features[0])
        else:
            squares = squared_dist_rectangle(
                self._metric, a.features, b.features, a.points, b.points
            )
        if a.travel is not None and b.travel is not None:
            squares = squares + (a.travel[:, None] - b.travel) ** 2
        return squares


def _squared_differences(x: Array, y: Array) -> Array:
    """Return the squared distances of rows."""
    sums = np.einsum("ij,ij->i", x, x)[:, None] + np.einsum("ij,ij->i", y, y)
    squares = sums - 2.0 * x @ y.T
    return np.where(squares > _ROUNDING * sums, squares, 0.0)
