"""Build the documentation site: `python tutorials/build_site.py [FOLDER]`, without a connection.

The pages and notebooks of this folder are copied, a page for every public name and the gallery are
written beside them, and Sphinx does the rest; a warning is an error.
"""

from __future__ import annotations

import base64
import json
import re
import shutil
import sys
import tempfile
from pathlib import Path
from types import ModuleType
from typing import Any

import nbformat
from sphinx.cmd.build import main as sphinx

import riemhuman as rh

SOURCES = Path(__file__).parent
WEB = Path(rh.plots.__file__).parent / "web"
_LEAST_HEIGHT = 240  # pixels of a picture on a card
_SHORT_SENTENCE = 50  # letters
VIEWER = "application/vnd.riemhuman.viewer+html"


def main(target: Path) -> int:
    """Build the site in a folder and return Sphinx's exit code."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "source"
        shutil.copytree(SOURCES, source, ignore=shutil.ignore_patterns("__pycache__", "*.py"))
        shutil.copy(SOURCES / "conf.py", source)
        for name in ("three.min.js", "three.LICENSE", "viewer.css"):
            shutil.copy(WEB / name, source / "_static" / name)
        script = rh.plots.viewer.viewer_script()
        (source / "_static" / "viewer.js").write_text(script, encoding="utf-8")
        notebooks = sorted(source.glob("*.ipynb"), key=lambda path: int(path.stem.split("_")[0]))
        (source / "gallery.md").write_text(gallery(notebooks), encoding="utf-8")
        (source / "notebooks").mkdir()
        for path in notebooks:
            shutil.copy(path, source / "notebooks")
            with_viewers(path)
        tour = source / "architecture.md"
        tour.write_text(without_line_links(tour.read_text(encoding="utf-8")), encoding="utf-8")
        (source / "reference.md").write_text(reference(), encoding="utf-8")
        options = ["-W", "--keep-going", "-q", "-j", "auto", "-d", str(Path(folder) / "doctrees")]
        built = Path(folder) / "site"  # notebooks leave pictures beside it, which nothing needs
        code = sphinx([*options, "-b", "html", str(source), str(built)])
        if code == 0:
            shutil.copytree(built, target, dirs_exist_ok=True)
        return code


def without_line_links(text: str) -> str:
    """Return a page without links to lines of source files, which the site does not hold."""
    return re.sub(r"\[(`[^`]+`)\]\(\.\./riemhuman/[^)]+\)", r"\1", text)


def with_viewers(path: Path) -> None:
    """Show stored viewers as elements of the page, each with a name of its own."""
    notebook = nbformat.read(path, as_version=nbformat.NO_CONVERT)
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    viewers = [output["data"] for output in outputs if VIEWER in output.get("data", {})]
    for number, data in enumerate(viewers, start=1):
        live = data.pop(VIEWER)
        data.clear()
        for attribute in ('id="viewer', 'name="viewer', 'for="viewer'):
            live = live.replace(attribute, f"{attribute}-{number}")
        data["text/html"] = live
    download = f"{{download}}`Download this notebook <notebooks/{path.name}>`"
    cell = nbformat.v4.new_markdown_cell(download)
    if "id" not in notebook.cells[0]:
        cell.pop("id", None)
    notebook.cells.insert(1, cell)
    nbformat.write(notebook, path)


def gallery(notebooks: list[Path]) -> str:
    """Return the page of all notebooks: of each a picture, written beside it, and a sentence."""
    text = (SOURCES / "gallery.md").read_text(encoding="utf-8").split("- [")[0]
    cards = []
    for path in notebooks:
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        title = "".join(cells[0]["source"]).splitlines()[0].lstrip("# ")
        pictures = [
            base64.b64decode("".join(output["data"]["image/png"]))
            for cell in cells
            for output in cell.get("outputs", [])
            if "image/png" in output.get("data", {})
        ]
        # A PNG file says its height at bytes 20 to 23; low film strips show bodies too small.
        high = [each for each in pictures if int.from_bytes(each[20:24], "big") >= _LEAST_HEIGHT]
        picture = path.with_name(f"gallery_{path.stem}.png")
        picture.write_bytes((high or pictures)[0])
        cards.append(
            f":::{{grid-item-card}} {title}\n:link: {path.stem}\n:link-type: doc\n"
            f":img-top: {picture.name}\n:class-card: gallery-card\n\n"
            f"{first_sentence(cells[0])}\n:::"
        )
    contents = "\n".join(path.stem for path in notebooks)
    return (
        f"{text}::::{{grid}} 1 2 2 3\n:gutter: 3\n\n"
        + "\n".join(cards)
        + f"\n::::\n\n```{{toctree}}\n:hidden:\n\n{contents}\n```\n"
    )


def first_sentence(cell: dict[str, Any]) -> str:
    """Return the first sentence below the title, and the second if the first is short."""
    paragraph = "".join(cell["source"]).split("\n\n")[1].replace("\n", " ")
    first, *more = re.split(r"(?<=[.?])\s", re.sub(r"[*_]", "", paragraph))
    return f"{first} {more[0]}" if more and len(first) < _SHORT_SENTENCE else first


def reference() -> str:
    """Return the page that lists every public name, and makes Sphinx write a page for each."""
    said = (
        "Every public name; those of `riemhuman` itself as `rh`. Examples assume "
        "`import numpy as np` and `import riemhuman as rh`."
    )
    parts = ["# Reference", said]
    parts.append(section("riemhuman", rh, [name for name in rh.__all__ if not is_module(rh, name)]))
    listed: set[int] = set()
    for subpackage in sorted(name for name in rh.__all__ if is_module(rh, name)):
        module = getattr(rh, subpackage)
        names = getattr(module, "__all__", None)
        if names is None and subpackage in ("errors", "extensions"):
            names = [name for name in vars(module) if defined_in(module, name)]
        names = [n for n in names or [] if n not in rh.__all__ and not is_module(module, n)]
        # A name that two subpackages share has one page.
        names = [name for name in names if id(getattr(module, name)) not in listed]
        listed |= {id(getattr(module, name)) for name in names}
        if names:
            parts.append(section(f"riemhuman.{subpackage}", module, names))
    return "\n\n".join(parts) + "\n"


def section(title: str, module: ModuleType, names: list[str]) -> str:
    """Return the part of the reference about one module."""
    summary = (module.__doc__ or "").split("\n\n")[0].replace("\n", " ")
    listed = "\n".join(f"   ~{module.__name__}.{name}" for name in sorted(names))
    return (
        f"## {title}\n\n{summary}\n\n```{{eval-rst}}\n.. autosummary::\n   :toctree: names\n\n"
        f"{listed}\n```"
    )


def is_module(module: Any, name: str) -> bool:
    """Return whether an attribute is a module."""
    return isinstance(getattr(module, name), ModuleType)


def defined_in(module: ModuleType, name: str) -> bool:
    """Return whether a public class or function is the module's own."""
    found = getattr(module, name)
    return not name.startswith("_") and getattr(found, "__module__", None) == module.__name__


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1] if len(sys.argv) > 1 else "site")))
