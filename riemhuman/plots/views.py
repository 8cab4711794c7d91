"""One function that opens an interactive view of anything."""

from __future__ import annotations

import os
from functools import singledispatch

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.bodies import BodyModel
from riemhuman.datasets import Bodies, load_recording
from riemhuman.errors import ArgumentError
from riemhuman.io.files import file_path
from riemhuman.io.meshes import load_mesh
from riemhuman.mocap.motions import Motion
from riemhuman.mocap.recordings import RECORDING_ENDINGS
from riemhuman.motions import Warp
from riemhuman.plots.component_views import view_components
from riemhuman.plots.motion_views import view_motions
from riemhuman.plots.scan_views import view_scan
from riemhuman.plots.viewer import Viewer, view_bodies, view_path
from riemhuman.registration import RegisteredScan
from riemhuman.solvers import MeanResult, PathResult, TangentPCA
from riemhuman.surfaces.template import Template

# With more, a page would have tens of megabytes.
_MOST_BODIES = 10


@singledispatch
def view(shown: object, faces: ArrayLike | None = None) -> Viewer:
    """Return an interactive view of any object that has surfaces.

    A notebook shows the view; ``.save("x.html")`` writes it as a page, ``.save("x.png")`` as a
    picture. Functions of `riemhuman.plots` such as `view_bodies` and `view_path` have more options.

    Parameters
    ----------
    shown : object
        A body or several: an array of shape (V, 3) or (n, V, 3), a mesh or a sequence of meshes;
        `Bodies`, of which the first ten are shown; a motion, which plays in seconds; two
        motions and the `Warp` that aligns them, as a tuple; the path or mean of a solver; a
        registered scan, over its body; a fitted `TangentPCA`, with a slider for each component; a
        template or body model; or the path of a mesh or recording.
    faces : array_like, shape (F, 3), optional
        Triangles; needed for arrays, paths and means (in metres, with y up). What has its own, such
        as `Bodies`, a motion or a file, is shown with those.

    Raises
    ------
    ArgumentError
        If faces are missing, or `shown` contains no surface.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.view(bodies[:2])
    Viewer('Bodies', choices=['Bodies'])
    """
    if faces is None and isinstance(shown, np.ndarray):
        raise ArgumentError(
            "an array has no triangles; pass faces too, such as rh.view(points, template.faces)"
        )
    return view_bodies(shown, faces)


@view.register
def _(shown: Bodies, faces: ArrayLike | None = None) -> Viewer:
    some = shown[:_MOST_BODIES]
    title = "Bodies" if len(shown) == len(some) else f"{len(some)} of {len(shown)} bodies"
    return view_bodies(
        some.points, shown.template.faces, [str(name) for name in some.ids], title=title
    )


@view.register
def _(shown: Motion, faces: ArrayLike | None = None) -> Viewer:
    title = shown.sequence or "Motion"
    return view_path(shown, title=title, frames_per_second=shown.frames_per_second)


@view.register
def _(shown: tuple, faces: ArrayLike | None = None) -> Viewer:  # type: ignore[type-arg]
    if len(shown) == 3 and isinstance(shown[2], Warp):
        return view_motions(*shown, faces)
    return view_bodies(shown, faces)


@view.register
def _(shown: PathResult, faces: ArrayLike | None = None) -> Viewer:
    _check_faces(faces, "path")
    return view_path(shown.path, faces)


@view.register
def _(shown: MeanResult, faces: ArrayLike | None = None) -> Viewer:
    _check_faces(faces, "mean")
    return view_bodies(shown.point, faces, title="Mean")


@view.register
def _(shown: RegisteredScan, faces: ArrayLike | None = None) -> Viewer:
    return view_scan(shown)


@view.register
def _(shown: TangentPCA, faces: ArrayLike | None = None) -> Viewer:
    return view_components(shown, faces)


@view.register
def _(shown: Template, faces: ArrayLike | None = None) -> Viewer:
    return view_bodies(shown.vertices, shown.faces, title="Template")


@view.register
def _(shown: BodyModel, faces: ArrayLike | None = None) -> Viewer:
    rest = shown(np.zeros(shown.n_betas))
    return view_bodies(rest, shown.faces, title="Body model")


@view.register(str)
@view.register(os.PathLike)
def _(shown: str | os.PathLike[str], faces: ArrayLike | None = None) -> Viewer:
    file = file_path(shown)
    if file.suffix.lower() in RECORDING_ENDINGS:
        return view(load_recording(file))
    return view_bodies(*load_mesh(file), [file.stem], title=file.name)


def _check_faces(faces: ArrayLike | None, name: str) -> None:
    if faces is None:
        raise ArgumentError(
            f"a {name} holds no triangles; pass faces too, such as rh.view(result, template.faces)"
        )
