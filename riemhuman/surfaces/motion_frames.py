"""Pairs of frames of motions, a fixed number of frames apart, read one pair at a time."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from riemhuman.checks import check_shape, real_array, whole_number
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.progress import ProgressBar
from riemhuman.units import check_same_scale

_REMEDY = "a basis weighs deformations by their lengths"


def frames_apart(
    motions: Iterable[Any], step: int = 10, *, progress: bool = False
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the frames m_{nτ} and m_{nτ+τ} of every motion m, for n = 0, 1, ….

    Every frame that is read is checked. An array, a list or an iterator is read frame by frame. Of
    any other motion that has a length and can be indexed, such as a data set on disk or a motion
    computed on demand, only every τ-th frame is read.

    Parameters
    ----------
    motions : iterable
        Motions, each an array (n_frames, V, 3) or an iterable of frames (V, 3) or of blocks of
        frames (n, V, 3). Both may be generators.
    step : int
        The number of frames τ from the first to the second frame of a pair.
    progress : bool
        Whether to show a progress bar over motions.

    Yields
    ------
    start, end : array, shape (V, 3)
        A pair of frames, which must not be changed: the end of one pair is the start of the next.

    Raises
    ------
    ArgumentTypeError
        If a motion cannot be iterated over or a frame does not hold real numbers.
    ArgumentError
        If there is no motion, a motion has fewer than τ + 1 frames, a frame does not have shape
        (V, 3), differs from the first in its number of vertices or has entries that are not finite,
        or a motion is evidently in another unit than the first.
    """
    step = whole_number(step, "step", minimum=1)
    if isinstance(motions, np.ndarray) and motions.ndim == 3:
        raise ArgumentError(
            f"motions must hold several motions; found one, of shape {motions.shape}: give it "
            "in a list, [motion]"
        )
    first: np.ndarray | None = None
    n_motions = 0
    listed = _iterate(motions, "motions")
    if progress:
        listed = _with_progress(listed, motions)
    for index, motion in enumerate(listed):
        name = f"motions[{index}]"
        start = None
        for frame in _every(motion, step, name):
            if first is None:
                first = frame
            if len(frame) != len(first):
                raise ArgumentError(
                    f"{name} has {len(frame)} vertices; the motions before it have {len(first)}"
                )
            if start is None:
                check_same_scale(frame, first, name, "the first motion", remedy=_REMEDY)
            if start is not None:
                yield start, frame
            start = frame
        n_motions += 1
    if n_motions == 0:
        raise ArgumentError("motions holds no motion; at least one is needed")


def _every(motion: Any, step: int, name: str) -> Iterator[np.ndarray]:
    """Yield every step-th frame of a motion, or refuse one that is too short."""
    if _is_indexed(motion):
        n_frames = len(motion)
        _check_length(n_frames, step, name)
        for number in range(0, n_frames, step):
            yield _frame(motion[number], number, name)
        return
    n_frames, n_vertices = 0, None
    for run in _iterate(motion, name):
        for found in _frames_of(run, n_frames, name):
            frame = _frame(found, n_frames, name)
            if n_vertices is not None and len(frame) != n_vertices:
                raise ArgumentError(
                    f"frame {n_frames} of {name} has {len(frame)} vertices; the frames before "
                    f"it have {n_vertices}"
                )
            n_vertices = len(frame)
            if n_frames % step == 0:
                # A generator may reuse one array for all frames.
                yield frame.copy()
            n_frames += 1
    _check_length(n_frames, step, name)


def _is_indexed(motion: Any) -> bool:
    return (
        hasattr(motion, "__len__")
        and hasattr(motion, "__getitem__")
        and not isinstance(motion, (np.ndarray, list, tuple))
    )


def _iterate(items: Any, name: str) -> Iterator[Any]:
    try:
        return iter(items)
    except TypeError as error:
        raise ArgumentTypeError(
            f"{name} must be an array or something to iterate over; found {items!r}"
        ) from error


def _with_progress(listed: Iterator[Any], motions: Any) -> Iterator[Any]:
    n_motions = len(motions) if hasattr(motions, "__len__") else None
    return iter(ProgressBar(listed, desc="Motions", total=n_motions, unit="motion"))


def _frames_of(run: Any, number: int, name: str) -> np.ndarray:
    """Return a frame or a block of frames as a block."""
    label = f"frame {number} of {name}"
    values = real_array(run, label, finite=False)
    if values.ndim == 3:
        return values
    check_shape(values, label, ("n_vertices", 3), batched=False)
    return values[np.newaxis]


def _frame(values: Any, number: int, name: str) -> np.ndarray:
    return real_array(values, f"frame {number} of {name}", ("n_vertices", 3), batched=False)


def _check_length(n_frames: int, step: int, name: str) -> None:
    if n_frames <= step:
        raise ArgumentError(
            f"{name} has {n_frames} frames; with step={step} a motion needs at least {step + 1}"
        )
