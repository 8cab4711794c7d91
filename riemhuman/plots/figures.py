"""The style and files of figures: SVG for light and dark themes, PNG on white."""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from riemhuman.optional import import_optional

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# No other element has this colour, so that the colour of the theme can replace it.
_INK = "#1d2025"
_THEME = (
    "<style>:root{color:#1d2025}@media(prefers-color-scheme:dark){:root{color:#e7e8ea}}</style>"
)
_STYLE = {
    "figure.facecolor": "none",
    "axes.facecolor": "none",
    "savefig.facecolor": "none",
    "text.color": _INK,
    "axes.labelcolor": _INK,
    "axes.edgecolor": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "axes.linewidth": 0.6,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "font.size": 8.0,
    "axes.titlesize": "medium",
    "font.family": "DejaVu Sans",
    "lines.linewidth": 1.3,
    "lines.markersize": 4.0,
    "svg.fonttype": "path",
    # Labels are names, not formulas.
    "text.parse_math": False,
    "svg.hashsalt": "riemhuman",
}
_DPI = 150


@dataclass(frozen=True)
class Picture:
    """A figure of the report.

    Attributes
    ----------
    name : str
        Name of the files, without ending.
    alt : str
        Description for readers who cannot see it.
    svg : str
        The figure, with dark ink on a light page and light ink on a dark page.
    """

    name: str
    alt: str
    svg: str


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the style of the report, without changing the style of the session.

    Raises
    ------
    MissingDependencyError
        If matplotlib is not installed.
    """
    matplotlib = import_optional("matplotlib", "plot")
    with matplotlib.rc_context(_STYLE):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure that does not open a window.

    Parameters
    ----------
    width, height : float
        Size, inches.

    Returns
    -------
    matplotlib.figure.Figure
    """
    module: Any = import_optional("matplotlib.figure", "plot")
    return module.Figure(figsize=(width, height), layout="constrained")


def drawn(figure: Figure) -> tuple[str, bytes]:
    """Return a figure as the contents of an SVG file and of a PNG file.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure, drawn in `figure_style`.

    Returns
    -------
    svg : str
        Without background, with ink in the colour of the theme.
    png : bytes
        On a white background.
    """
    content = io.BytesIO()
    nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
    figure.savefig(content, format="svg", dpi=_DPI, metadata=nothing)
    figure.set_layout_engine("none")  # the layout is done; doing it again would take long
    svg = themed(content.getvalue().decode("utf-8"))
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=_DPI, facecolor="white", metadata={"Software": None})
    return svg, content.getvalue()


def themed(svg: str) -> str:
    """Return an SVG figure whose ink follows the reader's theme.

    Parameters
    ----------
    svg : str
        The figure, with ink in the colour of `figure_style`.

    Returns
    -------
    str
    """
    end = svg.index(">", svg.index("<svg")) + 1
    inked = svg[end:].replace(_INK, "currentColor")
    # Text without a colour would stay black.
    head = svg[:end].replace("<svg", '<svg fill="currentColor"', 1)
    return head[head.index("<svg") :] + _THEME + inked
