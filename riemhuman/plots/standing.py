"""Where bodies stand: the height of the ground, and paths whose standing foot stays in place."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from riemhuman.arrays import Array, Points, PointsLike
from riemhuman.checks import checked, real_array
from riemhuman.mocap.motions import ModelMotion

# Share of the frames in which a recorded body may be below its ground, by errors of tracking.
_BELOW_GROUND = 0.1
# Heights at which a vertex carries a third of what it carries on the ground, of the body's height.
_CARRYING = 0.004

# Seconds over which the places of a body are averaged.
_SWAY = 0.2
_USUAL_RATE = 30.0  # frames a second, of motions that do not say theirs


def _surfaces(path: PointsLike, name: str) -> Array:
    return real_array(path, name, ("n_times", "n_vertices", 3), batched=False)


@checked(path=_surfaces)
def on_the_ground(path: PointsLike, like: PointsLike | None = None) -> Points:
    """Return a path each of whose surfaces stands on the ground, on a foot that does not slide.

    Most metrics do not see translations, so that the places of the surfaces of a geodesic mean
    nothing. The first surface stays where it is. Each of the others is moved to the same height,
    and sideways so that what carries it on the ground stays in place.

    Parameters
    ----------
    path : array_like, shape (n_times, V, 3)
        Surfaces, metres, y up.
    like : array_like, shape (n_times, V, 3), optional
        A recorded motion of the same vertices, such as the one that was transferred: surfaces are
        as high above the ground as its frames, and its feet say what carries the body.

    Returns
    -------
    array, shape (n_times, V, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> path = rh.plots.on_the_ground(bodies.points[:3] + [[[0, 0, 0]], [[0, 1, 0]], [[1, 0, 0]]])
    >>> bool(np.ptp(path[..., 1].min(axis=1)) < 1e-12)
    True
    """
    surfaces: Array = np.array(path)
    if not surfaces.size:
        return surfaces
    recorded = None if like is None else real_array(like, "like", surfaces.shape, batched=False)
    lowest = surfaces[..., 1].min(axis=1)
    shifts = np.zeros((len(surfaces), 3))
    shifts[:, 1] = lowest[0] - lowest
    feet = surfaces[..., 1] - lowest[:, np.newaxis]
    decay = max(_CARRYING * float(feet[0].max()), 1e-12)
    slides = np.diff(surfaces, axis=0)
    if recorded is not None:
        lowest = recorded[..., 1].min(axis=1)
        shifts[:, 1] += lowest - lowest[0]
        feet = recorded[..., 1] - lowest[:, np.newaxis]
        slides -= np.diff(recorded, axis=0)
    above = feet[:-1] + feet[1:]
    carried = np.exp((above.min(axis=1, keepdims=True) - above) / decay)
    carried /= carried.sum(axis=1, keepdims=True)
    slid = np.cumsum(np.einsum("tv,tvx->tx", carried, slides), axis=0)
    shifts[1:, [0, 2]] = -slid[:, [0, 2]]
    return surfaces + shifts[:, np.newaxis]


def track_of(frames: Points | ModelMotion, frames_per_second: float | None) -> Array:
    """Return the places x, z that a view of a travelling body follows, shape (n_times, 2).

    They are those of the body, without its sway within a step.
    """
    if isinstance(frames, ModelMotion):
        places = np.asarray(frames.translations, dtype=np.float64)[:, [0, 2]]
    else:
        places = frames[..., [0, 2]].mean(axis=1)
    reach = _SWAY * (_USUAL_RATE if frames_per_second is None else frames_per_second)
    smooth: Array = gaussian_filter1d(places, reach, axis=0, mode="nearest")
    return smooth


def ground_height(lowest: Array) -> float:
    """Return the height of a recorded body's ground, from the lowest vertex of each frame."""
    return float(np.quantile(lowest, _BELOW_GROUND, method="lower"))
