"""The style, colours and files of figures: SVG for light and dark themes, PNG on white."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from colorsys import hls_to_rgb
from contextlib import contextmanager
from importlib.resources import files
from importlib.util import find_spec
from typing import TYPE_CHECKING
from warnings import catch_warnings, simplefilter

import numpy as np
import PIL.Image
from PIL import ImageDraw, ImageFont

from riemhuman.arrays import Array, ArrayLike, Image
from riemhuman.checks import check_instance
from riemhuman.errors import warn
from riemhuman.io.files import atomic_file, file_path
from riemhuman.optional import import_matplotlib

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_INK = "#1d2025"  # of report.mplstyle; the colour of the theme replaces it
_QUIET_INK = "#3c424a"  # of names below bodies
_THEME = (
    "<style>:root{color:#1d2025}@media(prefers-color-scheme:dark){:root{color:#e7e8ea}}</style>"
)
FIGURE_DPI = 300
"""Dots an inch of bodies in figures: sharp on screens with two pixels to a point, and on paper."""
# Backends that write files.
_CANVASES = {"png": "agg", "svg": "svg", "pdf": "pdf"}

# Ten hues of similar lightness; successive hues differ strongly.
_CLASSES = (
    *("4e82b4", "e08a33", "cf5152", "52a39c", "5b9e4d"),
    *("c3a02b", "a674a8", "d97693", "97765f", "77858f"),
)

# Share of values beyond the end of a colour scale.
_OUTLIERS = 0.01

# Red, green and blue of a plain body, and of a mean.
SKIN = (0.80, 0.73, 0.66)
MEAN = (0.93, 0.74, 0.30)
UNKNOWN = (0.60, 0.63, 0.66)  # where a value is not known

# From the colour of skin, for 0, to the colour of the largest value.
VALUE_COLORS = ("#d4c8bb", "#ecb169", "#d95f30", "#8c1d3f")
# From the colour of the most negative value over that of skin, for 0, to that of the largest; blue
# and orange are told apart by all common kinds of colour vision.
SIGNED_COLORS = ("#173f7a", "#3f7fbf", "#97bad6", *VALUE_COLORS)


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the style of the report, without changing the style of the session.

    Examples
    --------
    >>> with rh.plots.figure_style():
    ...     ax = rh.plots.plot_energy([3.0, 2.0, 1.9])
    """
    style = import_matplotlib("style")
    with style.context(str(files("riemhuman.plots") / "web" / "report.mplstyle")):
        yield


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a size in inches that opens no window."""
    module = import_matplotlib("figure")
    return module.Figure(figsize=(width, height), layout="constrained")


def new_axes(ax: Axes | None, width: float, height: float) -> Axes:
    """Return the given axes, or the axes of a new figure of a size in inches.

    Notebooks and windows show the figure, unless the backend that would do so is not installed.
    """
    if ax is not None:
        check_instance(ax, "ax", import_matplotlib("axes").Axes, "axes of matplotlib")
        return ax
    try:
        pyplot = import_matplotlib("pyplot")
        return pyplot.subplots(figsize=(width, height), layout="constrained")[1]
    except ImportError:
        return new_figure(width, height).subplots()


def plain(text: str) -> str:
    """Return a text that matplotlib writes as it is, without formulas between dollar signs."""
    return text.replace("$", r"\$")


def strip_figure(ax: Axes) -> Figure:
    """Return the figure of a film strip's axes, cut to the width of the strip."""
    figure = ax.figure
    (_, right), (_, top) = ax.get_xlim(), ax.get_ylim()
    width, height = figure.get_size_inches()
    figure.set_size_inches(min(width, height * right / top), height)
    return figure


def use_fonts_of_names(figure: Figure) -> None:
    """Draw characters that the font of a text lacks in other installed fonts; warn of the rest."""
    manager, text = import_matplotlib("font_manager"), import_matplotlib("text")
    texts = [item for item in figure.findobj(text.Text) if not item.get_text().isascii()]
    lacking: dict[str, set[str]] = {}
    for item in texts:
        family = item.get_fontname()
        if family not in lacking:
            known = manager.get_font(manager.findfont(family)).get_charmap()
            written = "".join(t.get_text() for t in texts if t.get_fontname() == family)
            lacking[family] = {c for c in written if c.isprintable() and ord(c) not in known}
    missing = set().union(*lacking.values())
    others = []
    for entry in manager.fontManager.ttflist if missing else ():
        # One of them draws boxes for all characters.
        if "Last Resort" not in entry.name and entry.style == "normal" and missing:
            known = manager.get_font(entry.fname).get_charmap()
            found = {c for c in missing if ord(c) in known}
            if found:
                others.append(entry.name)
                missing -= found
    for item in texts:
        if others and lacking[item.get_fontname()] & set(item.get_text()):
            item.set_fontfamily([*item.get_fontfamily(), *others])
    if missing:
        warn(
            f"no installed font has the characters {''.join(sorted(missing))[:40]}; install one, "
            "such as Noto Sans CJK for Chinese, Japanese and Korean names",
            UserWarning,
        )


def written(text: str, pixels: int) -> Image:
    """Return one line of text in grey, by its height in pixels.

    With matplotlib, it is in fonts that have its letters, otherwise in Pillow's, which has Latin
    ones.
    """
    if find_spec("matplotlib") is None:
        font = ImageFont.load_default(0.8 * pixels)
        picture = PIL.Image.new("RGBA", (round(font.getlength(text)) + 2, pixels))
        ImageDraw.Draw(picture).text((1, 0), text, _QUIET_INK, font)
        return np.array(picture)
    figure = import_matplotlib("figure").Figure(dpi=72, facecolor="none")
    line = figure.text(0, 0, text, fontsize=0.8 * pixels, color=_QUIET_INK, parse_math=False)
    use_fonts_of_names(figure)
    canvas = import_matplotlib("backends.backend_agg").FigureCanvasAgg(figure)
    with catch_warnings():
        simplefilter("ignore", UserWarning)  # of each missing character
        box = line.get_window_extent(canvas.get_renderer())
        figure.set_size_inches(np.ceil(box.width + 2) / 72, pixels / 72)
        line.set_position((-box.x0 / (box.width + 2), 0.25))  # the baseline of all texts
        canvas.draw()
    return np.array(canvas.buffer_rgba())


def save_figure(figure: Figure, path: str | os.PathLike[str]) -> None:
    """Write a figure on white to a file, in the format of its ending, by a canvas for files.

    Letters of PDF files are TrueType, and pictures within them have 300 dots an inch.
    """
    file = file_path(path)
    use_fonts_of_names(figure)
    fonts = import_matplotlib("style").context({"pdf.fonttype": 42, "ps.fonttype": 42})
    with atomic_file(file) as temporary, fonts, catch_warnings():
        simplefilter("ignore", UserWarning)  # of each missing character
        ending = file.suffix[1:].lower()
        canvas = _CANVASES.get(ending)
        figure.savefig(temporary, dpi=FIGURE_DPI, facecolor="white", format=ending, backend=canvas)


def figure_files(figure: Figure, dots_an_inch: int = FIGURE_DPI) -> tuple[str, bytes]:
    """Return a figure as an SVG file without background, in the ink of the theme, and as a PNG."""
    use_fonts_of_names(figure)
    engine = figure.get_layout_engine()
    if engine is not None:
        # Laid out once for both files; at this resolution, text is as wide as in the SVG.
        figure.set_dpi(200)
        engine.execute(figure)
        figure.set_layout_engine(None)
    content = io.BytesIO()
    nothing = {"Date": None, "Creator": None, "Format": None, "Type": None}
    figure.savefig(content, format="svg", dpi=dots_an_inch, metadata=nothing)
    svg = content.getvalue().decode("utf-8")
    end = svg.index(">", svg.index("<svg")) + 1
    # Ink has the colour of the theme; text without a colour would stay black.
    head = svg[svg.index("<svg") : end].replace("<svg", '<svg fill="currentColor"', 1)
    svg = head + _THEME + svg[end:].replace(_INK, "currentColor")
    content = io.BytesIO()
    figure.savefig(
        content, format="png", dpi=dots_an_inch, facecolor="white", metadata={"Software": None}
    )
    return svg, content.getvalue()


def hexadecimal(color: ArrayLike) -> str:
    """Return red, green and blue between 0 and 1 as style sheets write them."""
    red, green, blue = np.round(255 * np.asarray(color)).astype(int).tolist()
    return f"#{red:02x}{green:02x}{blue:02x}"


def rgb(hexadecimal: str) -> tuple[float, float, float]:
    """Return red, green and blue between 0 and 1, from six hexadecimal digits."""
    red, green, blue = bytes.fromhex(hexadecimal.removeprefix("#"))
    return red / 255, green / 255, blue / 255


def class_colors(n_classes: int) -> Array:
    """Return distinct colours for classes, shape (n_classes, 3)."""
    if n_classes <= len(_CLASSES):
        return np.array([rgb(color) for color in _CLASSES[:n_classes]])
    hues = np.arange(n_classes) / n_classes
    return np.array([hls_to_rgb(h, 0.42 + 0.16 * (i % 2), 0.5) for i, h in enumerate(hues)])


def has_sign(values: Array) -> bool:
    """Return whether some values are negative by more than rounding."""
    known = values[np.isfinite(values)]
    return bool(known.min(initial=0.0) < -1e-12 * np.abs(known).max(initial=0.0))


def colour_limit(values: Array) -> float:
    """Return the end of the colour scale, which the sizes of 1 % of the values exceed."""
    # A single extreme triangle must not set the scale.
    sizes = np.abs(values[np.isfinite(values)])
    if not len(sizes):
        return 0.0
    return float(np.quantile(sizes, 1.0 - _OUTLIERS)) or float(sizes.max(initial=0.0))


def scale_ends(values: Array, limit: float | None = None) -> tuple[float, float]:
    """Return both ends of the colour scale: from 0, or if values are negative, about 0."""
    top = colour_limit(values) if limit is None else limit
    return (-top if has_sign(values) else 0.0), top


def value_colors(
    values: Array, largest: float | None = None, *, signed: bool | None = None
) -> Array:
    """Return colours of values, from 0 or, if some are negative, about 0; the scale has an end.

    Unknown values, which are NaN, are grey. The last colour is that of `largest` and of larger
    values, by default of the largest size; its negative has the first colour of a signed scale.
    """
    values = np.asarray(values, dtype=np.float64)
    known = np.isfinite(values)
    top = float(np.abs(values[known]).max(initial=0.0)) if largest is None else largest
    share = values / (top if top > 0 else 1.0)
    is_signed = has_sign(values) if signed is None else signed
    colors = SIGNED_COLORS if is_signed else VALUE_COLORS
    stops = np.array([rgb(color) for color in colors])
    places = np.linspace(-1.0 if is_signed else 0.0, 1.0, len(stops))
    shown = [np.interp(share, places, stops[:, channel]) for channel in range(3)]
    return np.where(known[..., np.newaxis], np.stack(shown, axis=-1), UNKNOWN)
