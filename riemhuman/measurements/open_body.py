"""The measurements of the open body model, which ship with the package."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from riemhuman.bodies import BodyModel
from riemhuman.datasets import load_open_model
from riemhuman.measurements.measurement_set import MeasurementSet
from riemhuman.surfaces.template import Template

FOLDER = Path(__file__).parent / "data"
RESOLUTIONS = ("full", "coarse")


def open_measurements(model: BodyModel | Template | None = None) -> MeasurementSet | None:
    """Return the measurements of the open body model.

    Parameters
    ----------
    model : BodyModel or Template, optional
        The open model or a template with the same triangles, at full or coarse resolution; by
        default the model at full resolution.

    Returns
    -------
    MeasurementSet or None
        The set of the open model of that resolution; None for other triangles.

    Examples
    --------
    >>> import riemhuman as rh
    >>> model = rh.datasets.load_open_model("coarse")
    >>> rh.measurements.open_measurements(model).names[:2]
    ('stature', 'cervical height')
    """
    if model is None:
        return _load("full")
    surface = model.template if isinstance(model, BodyModel) else model
    for resolution in RESOLUTIONS:
        faces = load_open_model(resolution).faces
        if faces.shape == surface.faces.shape and (faces == surface.faces).all():
            return _load(resolution)
    return None


@lru_cache(maxsize=len(RESOLUTIONS))
def _load(resolution: str) -> MeasurementSet:
    path = FOLDER / f"open_body_{resolution}.json"
    return MeasurementSet.load(path, load_open_model(resolution))
