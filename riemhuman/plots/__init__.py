"""Pictures and interactive views of bodies, paths, motions and results."""

from riemhuman.plots.body_plots import (
    Contributions,
    contributions,
    per_area,
    plot_body,
    plot_path,
)
from riemhuman.plots.component_views import view_components
from riemhuman.plots.difference_views import plot_difference, view_difference
from riemhuman.plots.figures import figure_style
from riemhuman.plots.map_views import view_map
from riemhuman.plots.maps import describe_stress, embed, plot_embedding, stress
from riemhuman.plots.match_plots import plot_match
from riemhuman.plots.measurement_views import plot_measurements, view_measurements
from riemhuman.plots.motion_views import view_motions
from riemhuman.plots.rendering import render, surfaces_html
from riemhuman.plots.result_plots import (
    plot_confusion,
    plot_energy,
    plot_precision_recall,
    plot_sweep,
)
from riemhuman.plots.scan_views import plot_scan, view_scan
from riemhuman.plots.standing import on_the_ground
from riemhuman.plots.viewed_bodies import ViewedBody
from riemhuman.plots.viewer import Viewer, view_bodies, view_path
from riemhuman.plots.views import view
from riemhuman.plots.windows import View

__all__ = [
    "Contributions",
    "View",
    "ViewedBody",
    "Viewer",
    "contributions",
    "describe_stress",
    "embed",
    "figure_style",
    "on_the_ground",
    "per_area",
    "plot_body",
    "plot_confusion",
    "plot_difference",
    "plot_embedding",
    "plot_energy",
    "plot_match",
    "plot_measurements",
    "plot_path",
    "plot_precision_recall",
    "plot_scan",
    "plot_sweep",
    "render",
    "stress",
    "surfaces_html",
    "view",
    "view_bodies",
    "view_components",
    "view_difference",
    "view_map",
    "view_measurements",
    "view_motions",
    "view_path",
    "view_scan",
]


def __dir__() -> list[str]:
    return sorted(__all__)
