"""Interactive views of two motions that are aligned in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from markupsafe import Markup
from numpy.typing import ArrayLike

from riemhuman.arrays import Array
from riemhuman.checks import checked, instance, real_array, values_of
from riemhuman.checks.labels import names_of, text
from riemhuman.errors import ArgumentError
from riemhuman.mocap.motions import ModelMotion, Motion
from riemhuman.motions import Warp
from riemhuman.plots._panels import Panel
from riemhuman.plots._web_files import fill
from riemhuman.plots.standing import track_of
from riemhuman.plots.viewed_bodies import ViewedBody
from riemhuman.plots.viewer import Viewer

_MOST_POINTS = 400  # of the drawn curve


@dataclass(frozen=True)
class WarpPanel(Panel):
    """Which times of two motions correspond, as a curve with the moment that is shown.

    `first` and `second` (n,) are corresponding times in frames from 0, `lasts` the last frames.
    """

    first: Array
    second: Array
    lasts: tuple[int, int]
    names: tuple[str, ...]
    frames_per_second: float | None
    name: str = "warp"

    def data(self) -> dict[str, object]:
        """Return the curve in frames."""
        chosen = np.linspace(0, len(self.first) - 1, min(len(self.first), _MOST_POINTS))
        numbers = chosen.round().astype(int)
        return {
            "first": np.round(self.first[numbers], 3).tolist(),
            "second": np.round(self.second[numbers], 3).tolist(),
            "lasts": list(self.lasts),
            "names": list(self.names),
            "rate": self.frames_per_second,
        }

    def html(self, identifier: str) -> Markup:
        """Return an empty diagram, which the script fills."""
        return fill("warp.html", names=self.names)


@checked(warp=instance(Warp, "a Warp, such as DynamicTimeWarping(...).warp returns"), note=text)
def view_motions(
    first: Motion | ArrayLike,
    second: Motion | ArrayLike,
    warp: Warp,
    faces: ArrayLike | None = None,
    names: Sequence[str] | None = None,
    note: str = "",
) -> Viewer:
    """Return an interactive view of two motions side by side, aligned in time or as recorded.

    The first motion plays at its own pace, the second at the corresponding times; a diagram shows
    which times correspond, and the current moment. The view follows both bodies, and the ground
    moves below them.

    Parameters
    ----------
    first, second : Motion or array_like, shape (n, V, 3) and (m, V, 3)
        Motions, metres, y up.
    warp : Warp
        The matched times of both, such as `DynamicTimeWarping.warp` returns.
    faces : array_like, shape (F, 3), optional
        Triangles; none for motions.
    names : sequence of str, optional
        By default the names of the people, or "first" and "second".
    note : str
        What the distance means, such as which distances are usual.

    Raises
    ------
    ArgumentError
        If faces are missing, if the motions have different rates, or if the warp does not belong to
        motions of these lengths.

    Examples
    --------
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> space = rh.motions.MotionSpace(rh.AlignedSurfaces(knees.template), 5)
    >>> measure = rh.motions.DynamicTimeWarping(space.frames.metric)
    >>> warp = measure.warp(knees[:20], other[:30])
    >>> viewer = rh.plots.view_motions(knees[:20], other[:30], warp, knees.faces)
    """
    motions = [_frames(first, "first"), _frames(second, "second")]
    rate = _rate(first, second)
    if faces is None:
        if not isinstance(first, Motion):
            raise ArgumentError("arrays have no triangles; pass faces too")
        faces = first.faces
    lasts = (len(motions[0]) - 1, len(motions[1]) - 1)
    _check_warp(warp, lasts)
    given_names = _names(first, second) if names is None else names
    labels = names_of(given_names, "names", 2, "motions")
    moments = np.linspace(warp.first[0], warp.first[-1], len(motions[0]))
    retimed = [moments, warp(moments)]
    bodies = [
        ViewedBody(label, frames, track=track_of(frames, rate))
        for label, frames in zip(labels, motions, strict=True)
    ]
    aligned = [replace(body, times=t) for body, t in zip(bodies, retimed, strict=True)]
    return Viewer(
        values_of(faces, "faces"),
        {"aligned": aligned, "as recorded": bodies},
        "Timing",
        f"{labels[0]} and {labels[1]}, aligned in time",
        " ".join([f"Distance after the best re-timing: {warp.dist:.2g}.", note]).strip(),
        frames_per_second=rate,
        panel=WarpPanel(warp.first, warp.second, lasts, labels, rate),
    )


def _frames(motion: Motion | ArrayLike, name: str) -> Array | ModelMotion:
    if isinstance(motion, ModelMotion):
        return motion
    frames = motion[:] if isinstance(motion, Motion) else motion
    return real_array(frames, name, ("n_times", "n_vertices", 3), batched=False)


def _rate(first: Motion | ArrayLike, second: Motion | ArrayLike) -> float | None:
    """Return the frames per second of both motions; arrays have none."""
    rates = {motion.frames_per_second for motion in (first, second) if isinstance(motion, Motion)}
    if len(rates) > 1:
        raise ArgumentError(
            f"motions must have the same frames per second; found {sorted(rates)}: resample one"
        )
    return rates.pop() if rates else None


def _check_warp(warp: Warp, lasts: tuple[int, int]) -> None:
    pairs = zip(("first", "second"), lasts, (warp.first, warp.second), strict=True)
    for name, last, times in pairs:
        if not 0 <= np.min(times) <= np.max(times) <= last + 1e-6:
            raise ArgumentError(
                f"warp must hold times of the {name} motion from 0 to {last}; "
                f"found {np.min(times):g} to {np.max(times):g}"
            )


def _names(first: Motion | ArrayLike, second: Motion | ArrayLike) -> tuple[str, str]:
    if isinstance(first, Motion) and isinstance(second, Motion):
        if first.subject and second.subject and first.subject != second.subject:
            return first.subject, second.subject
        if first.sequence and second.sequence and first.sequence != second.sequence:
            return first.sequence, second.sequence
    return "first", "second"
