"""Pictures and interactive views of bodies, paths, motions and results."""

from riemhuman.geometry.contributions import Contributions, contributions
from riemhuman.plots.body_plots import per_area, plot_body, plot_path
from riemhuman.plots.embedding import embed
from riemhuman.plots.motion_page import AlignedMotions
from riemhuman.plots.result_plots import (
    plot_confusion,
    plot_embedding,
    plot_energy,
    plot_precision_recall,
    plot_sweep,
)
from riemhuman.plots.tape_plots import plot_tapes
from riemhuman.plots.viewer import Viewer, view_bodies, view_path
from riemhuman.surfaces.rendering import View, render

__all__ = [
    "AlignedMotions",
    "Contributions",
    "View",
    "Viewer",
    "contributions",
    "embed",
    "per_area",
    "plot_body",
    "plot_confusion",
    "plot_embedding",
    "plot_energy",
    "plot_path",
    "plot_precision_recall",
    "plot_sweep",
    "plot_tapes",
    "render",
    "view_bodies",
    "view_path",
]


def __dir__() -> list[str]:
    return sorted(__all__)
