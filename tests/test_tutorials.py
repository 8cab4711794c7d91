"""Tutorials run unedited in fresh processes, show pictures, warn of nothing, use public names."""

import ast
import re
from functools import cache
from pathlib import Path

import nbclient
import nbformat
import pytest
from matplotlib import font_manager
from nbclient.exceptions import CellExecutionError

import riemhuman

FOLDER = Path(__file__).parents[1] / "tutorials"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
SECONDS_A_CELL = 120
LONGEST_CELL = 12

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


def python(cell):
    """Return the Python of a cell, its magics made into comments."""
    return re.sub(r"^%", "#", cell.source, flags=re.M)


def execute(notebook, folder, monkeypatch):
    """Return the notebook with its outputs, after running it in a process of its own."""
    monkeypatch.setenv("PYTHONPATH", str(Path(riemhuman.__file__).parents[1]))
    for name in ("MPLBACKEND", "OPENBLAS_NUM_THREADS", "PYTHONWARNINGS"):
        monkeypatch.delenv(name, raising=False)
    notebook = nbformat.from_dict(notebook)
    resources = {"metadata": {"path": str(folder)}}
    client = nbclient.NotebookClient(
        notebook, timeout=SECONDS_A_CELL, kernel_name="python3", resources=resources
    )
    client.execute()
    return notebook


def warnings_of(notebook):
    """Return all that was written to standard error."""
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return "".join(output.text for output in outputs if output.get("name") == "stderr")


def pictures_of(notebook):
    """Return the pictures shown."""
    outputs = [output for cell in code_cells(notebook) for output in cell.outputs]
    return [output.data["image/png"] for output in outputs if "image/png" in output.get("data", {})]


def notebook_of(*cells):
    notebook = nbformat.v4.new_notebook()
    notebook.cells = [nbformat.v4.new_code_cell(source) for source in cells]
    return notebook


def deep_imports(source):
    """Return what is imported of the library other than ``import riemhuman as rh``."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [(alias.name, alias.asname) for alias in node.names]
            found += [name for name, short in names if "riemhuman" in name and short != "rh"]
            found += [name for name, short in names if name.startswith("riemhuman.")]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("riemhuman"):
            found.append(node.module)
    return found


def names_used(source):
    """Return the dotted names that begin with ``rh``, as far as attributes go."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        parts = []
        while isinstance(node, ast.Attribute):
            parts.append(node.attr)
            node = node.value
        if parts and isinstance(node, ast.Name) and node.id == "rh":
            names.add(".".join(reversed(parts)))
    return names


def missing(dotted):
    """Return whether a name of the library does not exist or is private."""
    found = riemhuman
    for name in dotted.split("."):
        if name.startswith("_") or not hasattr(found, name):
            return True
        found = getattr(found, name)
    return False


def test_they_are_numbered():
    numbers = sorted(int(path.stem.split("_")[0]) for path in NOTEBOOKS)
    assert numbers[:8] == list(range(1, 9))
    assert len(set(numbers)) == len(numbers)


@every
def test_runs(path, tmp_path, monkeypatch):
    executed = execute(read(path), tmp_path, monkeypatch)
    assert warnings_of(executed) == ""
    assert pictures_of(executed)


@every
def test_is_kept_without_outputs(path):
    notebook = read(path)
    nbformat.validate(notebook)
    assert (notebook.nbformat, notebook.nbformat_minor) == (4, 5)
    assert notebook.metadata.kernelspec.name == "python3"
    assert set(notebook.metadata) == {"kernelspec", "language_info"}
    for cell in code_cells(notebook):
        assert cell.outputs == []
        assert cell.execution_count is None
    assert all(cell.metadata == {} for cell in notebook.cells)
    identifiers = [cell.id for cell in notebook.cells]
    assert len(set(identifiers)) == len(identifiers)


@every
def test_uses_public_names_that_exist(path):
    for cell in code_cells(read(path)):
        source = python(cell)
        assert deep_imports(source) == []
        assert [name for name in names_used(source) if missing(name)] == []


@every
def test_is_easy_to_read(path):
    cells = read(path).cells
    assert cells[0].cell_type == "markdown"
    assert cells[0].source.startswith(f"# {path.stem.split('_')[0]} · ")
    assert "## Where next" in cells[-1].source
    for cell in code_cells(read(path)):
        assert len(cell.source.splitlines()) <= LONGEST_CELL, cell.source
        assert all(len(line) <= 100 for line in cell.source.splitlines()), cell.source


# The checks above can fail.


def test_an_error_is_seen(tmp_path, monkeypatch):
    with pytest.raises(CellExecutionError, match="ZeroDivisionError"):
        execute(notebook_of("1 / 0"), tmp_path, monkeypatch)


def test_warnings_and_pictures_are_seen(tmp_path, monkeypatch):
    executed = execute(
        notebook_of(
            "import warnings; warnings.warn('look out')",
            "import matplotlib.pyplot as plt\nplt.plot([1, 2]);",
            "import os; assert 'OPENBLAS_NUM_THREADS' not in os.environ",
        ),
        tmp_path,
        monkeypatch,
    )
    assert "look out" in warnings_of(executed)
    assert len(pictures_of(executed)) == 1


def test_private_names_are_seen():
    assert deep_imports("import riemhuman as rh") == []
    assert deep_imports("import riemhuman.kernels as rh") == ["riemhuman.kernels"]
    assert deep_imports("from riemhuman.geometry import metric") == ["riemhuman.geometry"]
    assert names_used("rh.solvers.BasisPath(rh._x).solve") == {"solvers.BasisPath", "_x", "solvers"}
    assert missing("_x")
    assert missing("solvers.NoSuchSolver")
    assert not missing("solvers.BasisPath")
