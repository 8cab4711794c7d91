"""Draw the layers of the library and who imports whom, and renew the line links of the tour.

`python tutorials/remake/draw_layers.py` reads the floors in `setup.cfg` and the imports in the
source, writes `tutorials/pictures/layers.png`, and sets the line numbers of links to functions in
`tutorials/architecture.md`.
"""

import ast
import re
from configparser import ConfigParser
from functools import cache
from pathlib import Path

import matplotlib

matplotlib.use("agg")
import matplotlib.pyplot as plt

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "riemhuman"
PICTURE = ROOT / "tutorials" / "pictures" / "layers.png"
PAGE = ROOT / "tutorials" / "architecture.md"
# Names that fit beside each other; and the lowest floor with its rows, which all import.
_MOST_IN_LINE, _LOWEST = 8, 0.5
LINK = re.compile(r"\[`([\w.]+)`\]\(\.\./(riemhuman/[\w/]+\.py)#L\d+\)")


def floors():
    """Return the names on each floor, the highest first."""
    config = ConfigParser(interpolation=None)
    config.read(ROOT / "setup.cfg")
    lines = config["importlinter:contract:floors"]["layers"].split("\n")
    rows = [re.findall(r"\w+", line) for line in lines if line]
    return [[name for name in row if name != "__main__"] for row in rows]


@cache
def imports():
    """Return pairs of an importing and an imported part, with how many modules import."""
    counts = {}
    for file in PACKAGE.rglob("*.py"):
        importer = file.relative_to(PACKAGE).parts[0].removesuffix(".py")
        tree = ast.parse(file.read_text(encoding="utf-8"))
        modules = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
        parts = [(module or "").split(".") for module in modules]
        for imported in {part[1] for part in parts if part[0] == "riemhuman" and len(part) > 1}:
            if imported != importer:
                counts[importer, imported] = counts.get((importer, imported), 0) + 1
    return counts


def draw(path):
    """Draw a box for each part, one row a floor, and lines for imports above the lowest floor."""
    figure, axes = plt.subplots(figsize=(10.0, 6.4))
    places = {}
    for height, row in enumerate(reversed(floors())):
        for number, name in enumerate(row):
            crowded = 0.15 * (-1) ** number if len(row) > _MOST_IN_LINE else 0.0
            place = (number + 0.5) / len(row), height + crowded
            places[name] = place
            box = {"boxstyle": "round,pad=0.35", "facecolor": "white", "edgecolor": "#34618d"}
            axes.text(*place, name, ha="center", va="center", fontsize=9, bbox=box, zorder=2)
    for (importer, imported), count in imports().items():
        if importer in places and imported in places:
            (x, top), (other_x, bottom) = places[importer], places[imported]
            line = {"color": "#34618d", "alpha": 0.45, "lw": 0.3 + 0.08 * min(count, 20)}
            if top == bottom > _LOWEST:
                bent = {"arrowstyle": "-", "connectionstyle": "arc3,rad=0.18", **line}
                axes.annotate("", (other_x, bottom), (x, top), arrowprops=bent)
            elif top > bottom > _LOWEST:  # all import the lowest floor
                axes.plot([x, other_x], [top, bottom], **line)
    axes.set(xlim=(0.0, 1.0), ylim=(-0.5, len(floors()) - 0.5))
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
