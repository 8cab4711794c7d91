"""Pictures, interactive views and the report of the paper's experiments."""

from riemhuman.report.body_plots import per_area, plot_body, plot_path
from riemhuman.report.contributions import Contributions, contributions
from riemhuman.report.embedding import embed
from riemhuman.report.make import make_report
from riemhuman.report.motion_page import AlignedMotions
from riemhuman.report.rankings import confusion, precision_recall
from riemhuman.report.registered_scans import scan_page
from riemhuman.report.result_plots import (
    plot_confusion,
    plot_embedding,
    plot_energy,
    plot_precision_recall,
    plot_sweep,
)
from riemhuman.report.tape_plots import plot_tapes
from riemhuman.report.viewer import Viewer, view_bodies, view_path
from riemhuman.surfaces.rendering import View, render

__all__ = [
    "AlignedMotions",
    "Contributions",
    "View",
    "Viewer",
    "confusion",
    "contributions",
    "embed",
    "make_report",
    "per_area",
    "plot_body",
    "plot_confusion",
    "plot_embedding",
    "plot_energy",
    "plot_path",
    "plot_precision_recall",
    "plot_sweep",
    "plot_tapes",
    "precision_recall",
    "render",
    "scan_page",
    "view_bodies",
    "view_path",
]


def __dir__() -> list[str]:
    return sorted(__all__)
