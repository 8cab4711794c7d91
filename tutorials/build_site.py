"""Build the documentation site: `python tutorials/build_site.py [FOLDER]`, without a connection.

The pages and notebooks of this folder are copied, the gallery and a page for every public name are
written beside them, and Sphinx does the rest; a warning is an error. The folder is `site` unless
given.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import nbformat
from sphinx.cmd.build import main as sphinx

import riemhuman as rh
from riemhuman.plots.viewer import viewer_script

SOURCES = Path(__file__).parent
WEB = Path(rh.plots.__file__).parent / "web"
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
        script = viewer_script()
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
        built = Path(folder) / "site"  # notebooks leave unneeded pictures beside it
        code = sphinx([*options, "-b", "html", str(source), str(built)])
        if code == 0:
            shutil.copytree(built, target, dirs_exist_ok=True)
        return code


def without_line_links(text: str) -> str:
    """Return a page without links to lines of source files, which the site does not include."""
    return re.sub(r"\[(`[^`]+`)\]\(\.\./riemhuman/[^)]+\)", r"\1", text)


def with_viewers(path: Path) -> None:
    """Embed stored viewers in the page, each with its own identifier."""
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
    """Return the page of all notebooks: a picture (`thumbnails.py`) and a sentence for each."""
    text = (SOURCES / "gallery.md").read_text(encoding="utf-8").split("- [")[0]
    cards = []
    for number, path in enumerate(notebooks, start=1):
        cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
        title = "".join(cells[0]["source"]).splitlines()[0].lstrip("# ")
        cards.append(
            f":::{{grid-item-card}} {title}\n:link: {path.stem}\n:link-type: doc\n"
            f":img-top: pictures/gallery/{number}.png\n:class-card: gallery-card\n\n"
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
    without_emphasis = re.sub(r"[*_]", "", paragraph)
    sentences = re.split(r"(?<=[.?])\s", without_emphasis)  # at spaces behind a stop
    count = 2 if len(sentences[0]) < _SHORT_SENTENCE else 1
    return " ".join(sentences[:count])


class Task(NamedTuple):
    """A part of the reference: what its names are for, and the subpackages that define them."""

    title: str
    sentence: str
    subpackages: tuple[str, ...]


TASKS = (
    Task(
        "Spaces and metrics",
        "Spaces of surfaces and fields, the metrics on them, and the distances, energies, "
        "geodesics and exponentials that every metric has.",
        ("geometry", "surfaces"),
    ),
    Task(
        "Paths, means and transfer",
        "Solvers that find geodesics, exponentials, logarithms, parallel transport, means and "
        "principal components; a metric runs the ones it is given.",
        ("solvers",),
    ),
    Task(
        "Retrieval and statistics",
        "Scores, nearest neighbours, jobs larger than memory, clusters, tests, and metrics learned "
        "from labels.",
        ("retrieval", "statistics"),
    ),
    Task(
        "Bodies and data sets",
        "The open bodies and motions, body models, and readers of FAUST, AMASS, SMPL and others.",
        ("datasets", "bodies"),
    ),
    Task("Files", "Meshes, points, arrays and models, read and written.", ("io",)),
    Task(
        "Scans and other topologies",
        "Raw scans registered with a body model or a template, and maps between topologies.",
        ("registration", "topologies"),
    ),
    Task(
        "Measurements",
        "Girths, lengths, heights, breadths and volumes, their percentiles, and bodies that have "
        "given measurements.",
        ("measurements",),
    ),
    Task(
        "Motions",
        "Recordings compared, aligned and averaged at any speed, and moved between skeletons.",
        ("motions", "mocap"),
    ),
    Task(
        "Pictures and reports",
        "Figures, interactive pages and reports.",
        ("plots", "report"),
    ),
    Task(
        "Other representations",
        "Descriptors and learned codes, to compare the metrics with.",
        ("descriptors", "learned"),
    ),
    Task(
        "Your own extensions",
        "Base classes of terms, checks of what you wrote, and registration of it for other users.",
        ("terms", "testing", "extensions"),
    ),
    Task("Errors and warnings", "All errors derive from `RiemhumanError`.", ("errors",)),
)


def reference() -> str:
    """Return the page of all public names by task, from which Sphinx writes a page for each."""
    introduction = (
        "Every public name, grouped by task; names without a subpackage are those of `riemhuman` "
        "itself, as `rh`. Examples assume `import numpy as np` and `import riemhuman as rh`."
    )
    parts = ["# Reference", introduction]
    addresses = public_addresses()
    for task in TASKS:
        names = [name for subpackage in task.subpackages for name in addresses.pop(subpackage, [])]
        parts.append(section(task, names))
    if addresses:
        raise ValueError(f"no task of the reference lists {sorted(addresses)}: add them to TASKS")
    return "\n\n".join(parts) + "\n"


def public_addresses() -> dict[str, list[str]]:
    """Return the addresses of all public names, by the subpackage that defines them."""
    addresses: dict[str, list[str]] = defaultdict(list)
    listed: set[int] = set()
    modules = [rh, *(getattr(rh, name) for name in rh.__all__ if is_module(rh, name))]
    for module in modules:
        for name in sorted(public_names(module)):
            value = getattr(module, name)
            if id(value) not in listed:  # a name that two subpackages share has one page
                listed.add(id(value))
                home = value.__module__ if module is rh else module.__name__
                addresses[home.split(".")[1]].append(f"{module.__name__}.{name}")
    return addresses


def public_names(module: ModuleType) -> list[str]:
    """Return the names of a module that are not modules themselves."""
    if module is rh.kernels:  # its functions are documented with the metrics that use them
        return []
    names = getattr(module, "__all__", None)
    if names is None:
        names = [name for name in vars(module) if defined_in(module, name)]
    return [name for name in names if not is_module(module, name)]


def section(task: Task, addresses: list[str]) -> str:
    """Return the part of the reference about one task."""
    listed = "\n".join(f"   ~{address}" for address in addresses)
    return (
        f"## {task.title}\n\n{task.sentence}\n\n```{{eval-rst}}\n.. autosummary::\n"
        f"   :toctree: names\n\n{listed}\n```"
    )


def is_module(module: Any, name: str) -> bool:
    """Return whether an attribute is a module."""
    return isinstance(getattr(module, name), ModuleType)


def defined_in(module: ModuleType, name: str) -> bool:
    """Return whether a public class or function is the module's own."""
    value = getattr(module, name)
    return not name.startswith("_") and getattr(value, "__module__", None) == module.__name__


def from_command_line() -> int:
    """Build the site in the folder named on the command line, and say where it is."""
    parser = argparse.ArgumentParser(description="Build the documentation site, in about a minute.")
    parser.add_argument("folder", nargs="?", default="site", type=Path, help="default: site")
    target = parser.parse_args().folder
    print(f"Building the site in {target}: about a minute.", flush=True)
    code = main(target)
    if code == 0:
        print(f"Done: open {target / 'index.html'} in a browser.")
    return code


if __name__ == "__main__":
    sys.exit(from_command_line())
