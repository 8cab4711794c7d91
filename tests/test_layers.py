"""The contracts on imports in setup.cfg are kept, and each of them can be broken."""

import ast
import importlib
import inspect
import os
import shutil
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from public_names import public_objects

import riemhuman

ROOT = Path(__file__).parents[1]

FLOORS = "A subpackage imports only from the floors below"
ORDER = "Within a floor, too, imports go one way"
PUBLIC_LINE = "A private module is imported by its own subpackage alone"

# Subpackages that all others stand on; their modules are internal to the library, not to one of
# its subpackages. The command line has one public function.
SHARED_INSIDE = ("kernels", "io", "retargeting", "cli")


def lint_imports(folder):
    """Check the package found in `folder` against the contracts of setup.cfg."""
    code = "from importlinter.cli import lint_imports_command; lint_imports_command()"
    return subprocess.run(
        [sys.executable, "-c", code, f"--config={ROOT / 'setup.cfg'}", "--no-cache"],
        cwd=folder,
        capture_output=True,
        encoding="utf-8",
        env={**os.environ, "PYTHONPATH": str(ROOT / ".ci")},
    )


@pytest.fixture
def twin(tmp_path):
    """Return a copy of the package's source, to be broken."""
    ignored = shutil.ignore_patterns("__pycache__", "data")
    return shutil.copytree(ROOT / "riemhuman", tmp_path / "riemhuman", ignore=ignored)


def append(path, line):
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    path.write_text(f"{text}\n{line}\n", encoding="utf-8")


def test_contracts_are_kept():
    result = lint_imports(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.everyday("attic.py")
@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("checks.py", "import riemhuman.solvers", FLOORS),
        ("kernels/__init__.py", "import riemhuman.geometry.metric", FLOORS),
        ("surfaces/template.py", "def f():\n    import riemhuman.datasets", FLOORS),
        ("motions/__init__.py", "import riemhuman.statistics", FLOORS),
        pytest.param("attic.py", '"""A module that no contract lists."""', FLOORS, id="attic.py"),
        ("bodies/__init__.py", "import riemhuman.datasets", ORDER),
        ("terms/__init__.py", "import riemhuman.geometry", ORDER),
        ("plots/__init__.py", "import riemhuman.solvers._private", PUBLIC_LINE),
        ("checks.py", "from riemhuman import Template", "Only commands import the top level"),
        ("geometry/metric.py", "import numba", "imports numba"),
        ("surfaces/template.py", "import trimesh", "imports trimesh"),
        ("datasets/__init__.py", "import h5py", "Optional dependencies come through"),
    ],
)
def test_contracts_can_be_broken(twin, module, line, contract):
    if contract == PUBLIC_LINE:
        (twin / "solvers" / "_private.py").write_text('"""A private module."""\n')
    append(twin / module, line)
    result = lint_imports(twin.parent)
    assert result.returncode == 1, result.stdout + result.stderr
    broken = [text for text in result.stdout.splitlines() if " BROKEN" in text]
    assert any(contract in text for text in broken), result.stdout


def test_modules_without_public_names_are_private():
    public = {
        getattr(value, "__module__", None)
        for value in public_objects().values()
        if inspect.isclass(value) or inspect.isroutine(value)
    }
    unmarked = []
    for path in sorted((ROOT / "riemhuman").glob("*/*.py")):
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        if path.parent.name not in SHARED_INSIDE and not path.name.startswith("_"):
            listed = getattr(importlib.import_module(module), "__all__", ())
            if module not in public and not listed:
                unmarked.append(module)
    assert unmarked == []


def test_every_public_name_is_defined_in_the_library():
    assert [name for name in riemhuman.__all__ if not hasattr(riemhuman, name)] == []


def imported(path, modules):
    """Return the modules of the library that a module imports, for types and in functions too."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            several = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name if name in modules else node.module for name in several}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return names & modules.keys()


def import_cycle(package):
    """Return modules that import each other in a cycle, or an empty list."""
    modules = {}
    for path in package.rglob("*.py"):
        parts = path.relative_to(package.parent).with_suffix("").parts
        modules[".".join(parts).removesuffix(".__init__")] = path
    graph = {name: imported(path, modules) - {name} for name, path in modules.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_no_modules_import_each_other():
    assert import_cycle(ROOT / "riemhuman") == []
