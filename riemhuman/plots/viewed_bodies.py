"""Bodies, paths and motions as interactive views and films show them, and as pages store them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, JSONRecord, Points, Triangles
from riemhuman.checks import checked, flag, instance, real, real_array
from riemhuman.checks.labels import text
from riemhuman.errors import ArgumentError
from riemhuman.mocap.motions import ModelMotion
from riemhuman.plots._bones import Extent, bone_record, extent_of
from riemhuman.plots._packing import LEVELS, deflated, packed
from riemhuman.plots.figures import (
    SIGNED_COLORS,
    SKIN,
    VALUE_COLORS,
    colour_limit,
    has_sign,
    hexadecimal,
    value_colors,
)
from riemhuman.plots.rendering import vertex_values
from riemhuman.plots.standing import ground_height

_STEP = 1e-4  # metres, of coordinates
_AS_LARGE_AS_BODIES = 0.2  # metres


@dataclass(frozen=True)
class ComponentChanges:
    """What principal components change about a body, of which the page mixes any amounts.

    `linear` and `quadratic` (K, V, 3) are displacements per standard deviation of each component
    and per its square, metres; `shares` (K,) are those of the variance.
    """

    linear: Array
    quadratic: Array
    shares: Array

    def mixed(self, surface: Points, scores: Array) -> Array:
        """Return the surface, shape (V, 3), changed by scores in standard deviations, (K,)."""
        changed = np.tensordot(scores, self.linear, 1) + np.tensordot(scores**2, self.quadratic, 1)
        return np.asarray(surface + changed)


def _frames(frames: object, name: str) -> Points | ModelMotion:
    """Return checked surfaces, at least one, or a motion of a body model."""
    if isinstance(frames, ModelMotion):
        return frames
    surfaces = real_array(frames, name, ("n_times", "n_vertices", 3), batched=False)
    if surfaces.size == 0:
        raise ArgumentError(f"frames must hold a surface; found shape {surfaces.shape}")
    return surfaces


def _color(color: ArrayLike, name: str) -> ArrayLike:
    channels = real_array(color, name, (3,), batched=False)
    if channels.min() < 0 or channels.max() > 1:
        raise ArgumentError(f"{name} must lie between 0 and 1; found {color!r}")
    return color


def _values(values: ArrayLike, name: str) -> Array:
    return real_array(values, name, ("n",), batched=False, finite=False)


@checked(
    label=text,
    frames=_frames,
    color=_color,
    values=_values,
    value_label=text,
    value_caption=text,
    value_limit=real(minimum=0.0),
    value_signed=flag,
    components=instance(ComponentChanges),
)
@dataclass(frozen=True)
class ViewedBody:
    """A body or a path of bodies in a viewer.

    Parameters
    ----------
    label : str
    frames : array, shape (n_times, V, 3), or motion of a body model
        Surfaces at equally spaced times, metres. The page poses a motion of a body model, such as
        `ArrayMotion`, by its bones, which makes it tens of times smaller.
    color : tuple of float
        Red, green and blue between 0 and 1.
    values : array, shape (F,) or (V,), optional
        Values of the triangles, such as `contributions` per area, or of the vertices, shown as
        colours; 1 % of their sizes exceed that of the last colour. The scale begins at 0 or, if
        some are negative, goes to both sides of it.
    value_label : str
        Unit of the values, at the end of the colour scale.
    value_caption : str
        What the values or their signs mean, below the colour scale.
    value_limit : float, optional
        Value of the last colour, such as one that several bodies share.
    value_signed : bool, optional
        Whether the scale goes to both sides of 0; by default if some values are negative.
    components : ComponentChanges, optional
        What the sliders of `view_components` change about the only surface in `frames`.
    times : array, shape (n,), optional
        Frame numbers, possibly fractional, that are shown at equally spaced times, such as those of
        a motion that is aligned with another; by default each frame once.
    track : array, shape (n_times, 2), optional
        Places x, z on the ground that the view follows, so that the body stays in the middle and
        the ground moves below it; see `track_of`.

    Examples
    --------
    >>> body = rh.plots.ViewedBody("mean", np.zeros((1, 3, 3)), color=(0.93, 0.74, 0.30))
    """

    label: str
    frames: Points | ModelMotion
    color: tuple[float, float, float] = SKIN
    values: Array | None = None
    value_label: str = ""
    value_caption: str = ""
    value_limit: float | None = None
    value_signed: bool | None = None
    components: ComponentChanges | None = None
    times: Array | None = None
    track: Array | None = None

    def __post_init__(self) -> None:
        if self.times is not None:
            real_array(self.times, "times", ("n_shown",), batched=False)
        if self.track is not None:
            real_array(self.track, "track", (len(self.frames), 2), batched=False)

    @property
    def limit(self) -> float:
        """Value of the last colour; 0 without values."""
        if self.value_limit is not None:
            return self.value_limit
        return 0.0 if self.values is None else colour_limit(self.values)

    def colors(self, faces: Triangles) -> Array:
        """Return the colour of the body, shape (3,), or those of its vertices by their values.

        Parameters
        ----------
        faces : array of int, shape (F, 3)
            Its triangles; values may be those of triangles.
        """
        if self.values is None:
            return np.asarray(self.color)
        values = vertex_values(np.asarray(self.values), faces, len(self.frames[0]))
        return value_colors(values, self.limit, signed=self.signed)

    def surface(self, number: int) -> Points:
        """Return the surface of a frame where it is shown, shape (V, 3).

        Parameters
        ----------
        number : int
        """
        surface: Points = np.array(self.frames[number], dtype=np.float64)
        if self.track is None:
            return surface
        x, z = self.track[number]
        surface[:, 0] -= x
        surface[:, 2] -= z
        return surface

    @property
    def translations(self) -> Array:
        """Where a motion of a body model is shown, shape (n_times, 3)."""
        assert isinstance(self.frames, ModelMotion)
        places: Array = np.array(self.frames.translations, dtype=np.float64)
        if self.track is not None:
            places[:, [0, 2]] -= self.track
        return places

    @cached_property
    def extent(self) -> Extent:
        """Box, radius and ground of a motion of a body model."""
        assert isinstance(self.frames, ModelMotion)
        return extent_of(self.frames, self.translations)

    @cached_property
    def ground(self) -> float:
        """Height of the ground on which the body stands, metres."""
        if isinstance(self.frames, ModelMotion):
            return self.extent.ground
        return ground_height(np.asarray(self.frames[..., 1].min(axis=1)))

    @property
    def n_times(self) -> int:
        """Number of moments that are shown at equally spaced times."""
        return len(self.frames) if self.times is None else len(self.times)

    @property
    def signed(self) -> bool:
        """Whether some values are negative; the first colour then belongs to minus the limit."""
        if self.value_signed is not None:
            return self.value_signed
        return self.values is not None and has_sign(self.values)


def body_record(body: ViewedBody, faces: Triangles) -> JSONRecord:
    """Return the data of a body in types that JSON can hold."""
    record: JSONRecord = {
        "label": body.label,
        "n_frames": len(body.frames),
        "color": hexadecimal(body.color),
        "ground": body.ground,
    }
    if isinstance(body.frames, ModelMotion):
        record["bones"] = bone_record(body.frames, body.translations, body.extent)
    else:
        frames = np.stack([body.surface(number) for number in range(len(body.frames))])
        record |= _coordinates(frames)
    if body.track is not None:
        record["track"] = np.round(body.track, 4).tolist()
    if body.times is not None:
        record["times"] = np.round(body.times, 3).tolist()
    if body.values is not None:
        colors = body.colors(faces)
        record["colors"] = deflated(np.round(255 * colors).astype(np.uint8))
        record["values"] = deflated(body.values.astype("<f4"))
        record["largest"] = body.limit
        record["signed"] = body.signed
        record["scale"] = SIGNED_COLORS if body.signed else VALUE_COLORS
        record["value_label"] = body.value_label
        record["value_caption"] = body.value_caption
    if body.components is not None:
        components = zip(body.components.linear, body.components.quadratic, strict=True)
        record["components"] = [
            {"linear": _packed_changes(linear), "quadratic": _packed_changes(quadratic)}
            for linear, quadratic in components
        ]
    return record


def _coordinates(frames: Points) -> JSONRecord:
    """Return the coordinates of all frames as whole numbers of 16 bits."""
    low = frames.min(axis=(0, 1))
    size = frames.max(axis=(0, 1)) - low
    step = np.maximum(size, 1e-9) / LEVELS
    # Things as large as a body are stored to 0.1 mm, which compresses better.
    step = np.where(size > _AS_LARGE_AS_BODIES, np.maximum(step, _STEP), step)
    integers = np.round((frames - low) / step).astype("<u2")
    # Differences in time, or along the surface of a single frame, are small.
    rows = integers.reshape(len(integers), -1) if len(integers) > 1 else integers[0]
    return {"frames": packed(rows), "low": low.tolist(), "step": step.tolist()}


def _packed_changes(changes: Array) -> JSONRecord:
    """Return displacements, shape (V, 3), as signed whole numbers of 16 bits, and their step."""
    step = max(float(np.abs(changes).max()), 1e-9) / (LEVELS // 2)
    integers = np.round(changes / step).astype("<i2")
    return {"step": step, "changes": packed(integers.view("<u2"))}
