"""The style and files of figures: SVG for light and dark themes, PNG on white."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from riemhuman.optional import import_optional

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK = "#1d2025"  # of report.mplstyle; the colour of the theme replaces it
_THEME = (
    "<style>:root{color:#1d2025}@media(prefers-color-scheme:dark){:root{color:#e7e8ea}}</style>"
)
_DPI = 150


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the style of the report, without changing the style of the session.

    Examples
    --------
    >>> with rh.plots.figure_style():
    ...     ax = rh.plots.plot_energy([3.0, 2.0, 1.9])
    """
    style = import_optional("matplotlib.style", "plot")
    with style.context(str(files("riemhuman.plots") / "web" / "report.mplstyle")):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches that opens no window."""
    module: Any = import_optional("matplotlib.figure", "plot")
    return module.Figure(figsize=(width, height), layout="constrained")


def new_axes(ax: Axes | None, width: float, height: float) -> Axes:
    """Return the given axes, or the axes of a new figure of a size in inches."""
    if ax is not None:
        return ax
    pyplot = import_optional("matplotlib.pyplot", "plot")
    return pyplot.subplots(figsize=(width, height), layout="constrained")[1]


def figure_files(figure: Figure) -> tuple[str, bytes]:
    """Return a figure as an SVG file without background, in the ink of the theme, and as a PNG."""
    content = io.BytesIO()
    nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
    figure.savefig(content, format="svg", dpi=_DPI, metadata=nothing)
    figure.set_layout_engine("none")  # the layout is done; doing it again would take long
    svg = content.getvalue().decode("utf-8")
    end = svg.index(">", svg.index("<svg")) + 1
    # Ink has the colour of the theme; text without a colour would stay black.
    head = svg[svg.index("<svg") : end].replace("<svg", '<svg fill="currentColor"', 1)
    svg = head + _THEME + svg[end:].replace(_INK, "currentColor")
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_DPI, facecolor="white", metadata={"Software": None})
    return svg, content.getvalue()
