"""Tutorials run unedited in fresh processes, show what is stored, and are easy to read.

What they show is compared with what is stored where the documentation is built, in
`python .ci/jobs.py docs`, and among all tests.
"""

import base64
import io
import re
from functools import cache
from pathlib import Path

import matplotlib.image
import nbformat
import numpy as np
import pytest
from matplotlib import font_manager
from store_outputs import VIEWER, executed, small

FOLDER = Path(__file__).parents[1] / "tutorials"
LARGEST = 800 * 2**10
IMPORT = "import riemhuman as rh"


def number(path):
    return int(path.stem.split("_")[0])


NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"), key=number)

every = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


@pytest.fixture(scope="module", autouse=True)
def _known_fonts():
    # Where fonts were never listed, matplotlib does so, and says that it takes a moment.
    font_manager.findfont("DejaVu Sans")


@cache
def read(path):
    return nbformat.read(path, as_version=nbformat.NO_CONVERT)


def code_cells(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def warnings_of(notebook):
    """Return all that was written to standard error."""
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return "".join(output.text for output in outputs if output.get("name") == "stderr")


def pictures_of(notebook):
    """Return the pictures shown."""
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return [output.data["image/png"] for output in outputs if "image/png" in output.get("data", {})]


@pytest.mark.slow
@every
def test_shows_what_is_stored(path):
    fresh = small(executed(path))
    assert warnings_of(fresh) == ""
    assert pictures_of(fresh)
    for stored, shown in zip(code_cells(read(path)), code_cells(fresh), strict=True):
        assert differences(stored, shown) == [], stored.source


def differences(stored, shown):
    """Return how what a cell shows differs from what is stored, but for times and rounding."""
    first, second = map(outputs_of, (stored, shown))
    if [kind for kind, _ in first] != [kind for kind, _ in second]:
        return [f"{[kind for kind, _ in first]} is stored, {[kind for kind, _ in second]} is shown"]
    told_time = any(word in stored.source for word in ("%%time", "perf_counter", ".seconds["))
    found = []
    for (kind, one), (_, other) in zip(first, second, strict=True):
        if kind == "image/png":
            found += picture_differences(one, other)
        elif kind != VIEWER and not told_time:
            found += text_differences(one, other)
    return found


def outputs_of(cell):
    """Return what a cell shows as pairs of a kind and its content."""
    shown = []
    for output in cell.outputs:
        if output.output_type == "stream":
            shown.append((output.name, output.text))
        else:
            shown += sorted(output.get("data", {}).items())
    return shown


def text_differences(one, other):
    number = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
    address = re.compile(r"0x[0-9a-f]+")
    one, other = address.sub("", one), address.sub("", other)
    if number.sub("#", one).split() != number.sub("#", other).split():
        return [f"{one!r} is stored, {other!r} is shown"]
    numbers = [np.array(number.findall(text), dtype=float) for text in (one, other)]
    same = np.isclose(*numbers, rtol=0.05, atol=0.02)
    return [f"{a} is stored, {b} is shown" for a, b in np.stack(numbers, 1)[~same]]


def picture_differences(one, other):
    one, other = (
        matplotlib.image.imread(io.BytesIO(base64.b64decode(text)))[..., :3]
        for text in (one, other)
    )
    if np.abs(np.subtract(one.shape, other.shape)).max() > 4:
        return [f"a picture of {one.shape} is stored, one of {other.shape} is shown"]
    height, width = np.minimum(one.shape, other.shape)[:2]
    difference = np.abs(one[:height, :width] - other[:height, :width]).mean()
    return [] if difference < 0.06 else [f"pictures differ by {difference:.2f}"]


@every
def test_is_small_and_plain(path):
    notebook = read(path)
    nbformat.validate(notebook)
    assert path.stat().st_size <= LARGEST
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert notebook.metadata.kernelspec.name == "python3"
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    assert all(cell.execution_count is None for cell in code_cells(notebook))
    assert all(cell.metadata == {} for cell in notebook.cells)
    text = path.read_text(encoding="utf-8")
    assert "three.js" not in text
    assert set(re.findall(r"(?:from|import) riemhuman.*?(?=[\\\"])", text)) <= {IMPORT}
    identifiers = [cell.id for cell in notebook.cells]
    assert len(set(identifiers)) == len(identifiers)


@every
def test_is_listed_by_its_title(path):
    title = read(path).cells[0].source.splitlines()[0].removeprefix("# ")
    listed = (FOLDER / "gallery.md").read_text(encoding="utf-8")
    assert f"- [{title}]({path.name})\n" in listed
