"""Frames of motions, checked and read in runs, so that no motion needs to fit in memory."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array, values_of
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import Manifold

Motion = Any
"""An array (n_frames, V, 3), or anything with a length whose slices are such arrays."""

RUN = 16
"""Frames looked at together."""


def frame_runs(space: Manifold, motion: Motion, name: str = "motion") -> Iterator[ndarray]:
    """Yield the frames of a motion in runs, each checked.

    Parameters
    ----------
    space : Manifold
        Space of the frames.
    motion : array or sequence, shape (n_frames, V, 3)
        The motion.
    name : str
        Name of the argument, for messages.

    Yields
    ------
    array, shape (at most 16, V, 3)

    Raises
    ------
    ArgumentTypeError
        If the motion has no length or cannot be sliced.
    ArgumentError
        If it has no frame, or a frame is over another template or has an entry that is not finite.
    """
    n_frames = n_frames_of(motion, name)
    for first in range(0, n_frames, RUN):
        last = min(first + RUN, n_frames)
        yield _checked(space, motion[first:last], first, f"frames {first} to {last - 1} of {name}")


def sampled_frames(space: Manifold, motion: Motion, name: str, step: int) -> Iterator[ndarray]:
    """Yield every `step`-th frame of a motion, each checked.

    Parameters
    ----------
    space : Manifold
        Space of the frames.
    motion : array or sequence, shape (n_frames, V, 3)
        The motion.
    name : str
        Name of the argument, for messages.
    step : int
        Distance between the frames.

    Yields
    ------
    array, shape (V, 3)
    """
    for number in range(0, n_frames_of(motion, name), step):
        frame = f"frame {number} of {name}"
        yield _checked(space, motion[number : number + 1], number, frame)[0]


def whole_motion(
    space: Manifold, motion: Motion, name: str = "motion", minimum: int = 1
) -> ndarray:
    """Return all frames of a motion, checked.

    Parameters
    ----------
    space : Manifold
        Space of the frames.
    motion : array or sequence, shape (n_frames, V, 3)
        The motion.
    name : str
        Name of the argument, for messages.
    minimum : int
        Frames that are needed.

    Returns
    -------
    array, shape (n_frames, V, 3)

    Raises
    ------
    ArgumentError
        If a frame is wrong, or there are too few.
    """
    n_frames_of(motion, name, minimum)
    return np.concatenate(list(frame_runs(space, motion, name)))


def n_frames_of(motion: Motion, name: str = "motion", minimum: int = 1) -> int:
    """Return the number of frames of a motion.

    Parameters
    ----------
    motion : array or sequence, shape (n_frames, V, 3)
        The motion.
    name : str
        Name of the argument, for messages.
    minimum : int
        Frames that are needed.

    Returns
    -------
    int

    Raises
    ------
    ArgumentTypeError
        If it has no length.
    ArgumentError
        If there are too few.
    """
    if not hasattr(motion, "__len__") or not hasattr(motion, "__getitem__"):
        raise ArgumentTypeError(
            f"{name} must be an array of frames, or have a length and slices; found "
            f"{type(motion).__name__}"
        )
    if len(motion) == 0:
        raise ArgumentError(f"{name} must have at least one frame; found none")
    if len(motion) < minimum:
        raise ArgumentError(f"{name} must have at least {minimum} frames; found {len(motion)}")
    return len(motion)


def several_motions(motions: Any, name: str = "motions") -> Sequence[Motion]:
    """Return several motions, or refuse a single one.

    Parameters
    ----------
    motions : sequence of motions
        The argument.
    name : str
        Its name, for messages.

    Returns
    -------
    sequence of motions

    Raises
    ------
    ArgumentTypeError
        If it has no length.
    ArgumentError
        If there is none, or one motion was given instead of several.
    """
    if not hasattr(motions, "__len__") or not hasattr(motions, "__getitem__"):
        raise ArgumentTypeError(
            f"{name} must be a list of motions, or have a length and items; found "
            f"{type(motions).__name__}"
        )
    if len(motions) == 0:
        raise ArgumentError(f"{name} must hold at least one motion; found none")
    if isinstance(motions, np.ndarray) and motions.ndim == 3:
        raise ArgumentError(
            f"{name} must hold several motions; found one, of shape {motions.shape}: give it in "
            "a list, [motion]"
        )
    checked: Sequence[Motion] = motions
    return checked


def rising_times(times: Any, name: str, n_times: int | None = None) -> ndarray:
    """Return times as an array, after checking that each is later than the one before.

    Parameters
    ----------
    times : array_like, shape (n,)
        Times.
    name : str
        Name of the argument, for messages.
    n_times : int, optional
        Number of times expected.

    Returns
    -------
    array, shape (n,)

    Raises
    ------
    ArgumentError
        If the number differs, or the times do not increase.
    """
    shape = ("n_times",) if n_times is None else (n_times,)
    values = real_array(times, name, shape, batched=False)
    wrong = np.flatnonzero(np.diff(values) <= 0)
    if len(wrong):
        k = int(wrong[0])
        raise ArgumentError(
            f"{name} must increase; found {values[k + 1]:g} after {values[k]:g}, at index {k + 1}"
        )
    return np.asarray(values)


def _checked(space: Manifold, run: Any, first: int, name: str) -> ndarray:
    values = values_of(run, name)
    if values.ndim != 3:
        raise ArgumentError(f"{name} must have shape (n_frames, V, 3); found {values.shape}")
    if values.dtype.kind == "f" and not np.isfinite(values).all():
        frame = int(np.flatnonzero(~np.isfinite(values).all(axis=(1, 2)))[0])
        motion = name.split(" of ", 1)[1]
        raise ArgumentError(
            f"frame {first + frame} of {motion} holds NaN or infinite entries; every entry must be "
            "finite"
        )
    return np.asarray(space.check_point(values, name))
