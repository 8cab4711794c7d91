"""Reports without what takes most of their time: figures."""

import numpy as np


def leave_empty(monkeypatch):
    """Leave figures of a report empty."""
    pixels = np.zeros((2, 2, 4))
    monkeypatch.setattr("riemhuman.plots.body_plots.render", lambda *given, **settings: pixels)
    monkeypatch.setattr(
        "riemhuman.report._body_sections.draw_measurement_lines", lambda *given, **settings: None
    )
    monkeypatch.setattr(
        "riemhuman.report._page.figure_files",
        lambda figure, dots_an_inch: ('<svg viewBox="0 0 4 3"></svg>', b""),
    )
