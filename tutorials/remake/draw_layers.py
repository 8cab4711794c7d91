"""Draw the layers of the library, and renew the line links of the tour.

`python tutorials/remake/draw_layers.py` reads the floors in `setup.cfg`, writes
`tutorials/pictures/layers.png`, and sets the line numbers of links to functions in
`tutorials/architecture.md`.
"""

import ast
import re
from configparser import ConfigParser
from pathlib import Path
from textwrap import fill

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyBboxPatch

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "riemhuman"
PICTURE = ROOT / "tutorials" / "pictures" / "layers.png"
PAGE = ROOT / "tutorials" / "architecture.md"
# What each floor gives to those above it, and what one call does there: the highest floor first.
FLOORS = (
    ("what people see", "riemhuman dist anna.ply ben.ply", "0.106"),
    ("answers about many bodies", "", ""),
    ("answers about bodies", "", ""),
    ("paths, means, bodies, data", "reads two meshes", ""),
    ("spaces and metrics", "a sum of terms in g and n", "its root"),
    ("arrays, files, compiled loops", "g and n of each triangle", "sums"),
)
INK, LINE, PALE = "#1d2025", "#34618d", "#eef3f8"
LINK = re.compile(r"\[`([\w.]+)`\]\(\.\./(riemhuman/[\w/]+\.py)#L\d+\)")


def floors():
    """Return the names on each floor, the highest first."""
    config = ConfigParser(interpolation=None)
    config.read(ROOT / "setup.cfg")
    lines = config["importlinter:contract:floors"]["layers"].split("\n")
    rows = [re.findall(r"\w+", line) for line in lines if line]
    return [[name for name in row if name != "__main__"] for row in rows]


def draw(path):
    """Draw the floors as a stack, and one call that goes down through them and comes back."""
    figure, axes = plt.subplots(figsize=(10.0, 5.6))
    rows = floors()
    down, up = 6.25, 9.75
    for number, (row, (gives, call, back)) in enumerate(zip(rows, FLOORS, strict=True)):
        height = len(rows) - number
        box = {"boxstyle": "round,pad=0.02", "facecolor": PALE, "edgecolor": LINE, "lw": 0.8}
        axes.add_patch(FancyBboxPatch((0.1, height - 0.36), 5.6, 0.72, **box))
        axes.text(0.25, height + 0.17, gives, fontsize=11, color=INK, weight="bold", va="center")
        names = fill(", ".join(row), 72)
        axes.text(0.25, height - 0.14, names, fontsize=8, color=INK, va="center", linespacing=1.1)
        for x, text, align in ((down, call, "left"), (up, back, "right")):
            if text:
                axes.plot(x, height, "o", color=LINE, ms=6, zorder=3)
                shift = 0.15 if align == "left" else -0.15
                words = fill(text, 26)
                axes.text(x + shift, height, words, fontsize=9, color=INK, ha=align, va="center")
    arrow = {"arrowstyle": "-|>", "color": LINE, "lw": 1.4}
    axes.annotate("", (down, 1.1), (down, len(rows)), arrowprops=arrow)
    axes.annotate("", (up, len(rows) - 0.1), (up, 1), arrowprops=arrow)
    axes.plot([down, up], [0.7, 0.7], color=LINE, lw=1.4)
    axes.plot([down, down], [1.1, 0.7], color=LINE, lw=1.4)
    axes.plot([up, up], [1.0, 0.7], color=LINE, lw=1.4)
    title = "One call goes down the floors, and its answer comes back"
    axes.text((down + up) / 2, len(rows) + 0.62, title, fontsize=9, color=INK, ha="center")
    title = "Each floor imports only from those below"
    axes.text(2.9, len(rows) + 0.62, title, fontsize=9, color=INK, ha="center")
    axes.set(xlim=(0.0, 10.0), ylim=(0.5, len(rows) + 0.8))
    axes.axis("off")
    figure.savefig(path, dpi=110, bbox_inches="tight", metadata={"Software": None})


def line_of(file, dotted):
    """Return the line on which a function or class of a file is defined."""
    nodes = ast.parse(file.read_text(encoding="utf-8")).body
    for name in dotted.split("."):
        node = next(node for node in nodes if getattr(node, "name", None) == name)
        nodes = getattr(node, "body", [])
    return node.lineno


def with_lines(text):
    """Return the page with the lines of all linked functions."""
    return LINK.sub(
        lambda link: f"[`{link[1]}`](../{link[2]}#L{line_of(ROOT / link[2], link[1])})", text
    )


if __name__ == "__main__":
    draw(PICTURE)
    PAGE.write_text(with_lines(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
