"""The contracts on imports in setup.cfg are kept, and each of them can be broken."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

FLOORS = "A subpackage imports only from the floors below"
ORDER = "Within a floor, too, imports go one way"
PUBLIC_LINE = "A private module is imported by its own subpackage alone"


pytestmark = pytest.mark.slow  # lint-imports, which these stand for, runs with the style checks


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


@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("checks/arrays.py", "import riemhuman.solvers", FLOORS),
        ("surfaces/template.py", "def f():\n    import riemhuman.datasets", FLOORS),
        ("attic.py", '"""A module that no contract lists."""', FLOORS),
        ("bodies/__init__.py", "import riemhuman.datasets", ORDER),
        ("plots/__init__.py", "import riemhuman.solvers._private", PUBLIC_LINE),
        (
            "checks/arrays.py",
            "from riemhuman import Template",
            "Only commands import the top level",
        ),
        ("geometry/metric.py", "import numba", "imports numba"),
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


def named_modules(node):
    """Return the modules that a statement or a call names: imports, and `import_module`."""
    if isinstance(node, ast.ImportFrom):
        return {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    if isinstance(node, ast.Import):
        return {alias.name for alias in node.names}
    if isinstance(node, ast.Call):
        function = getattr(node.func, "attr", getattr(node.func, "id", ""))
        if function == "import_module":
            name = node.args[0]
            return {name.value if isinstance(name, ast.Constant) else ast.unparse(name)}
    return set()


def files_of(package):
    """Return the files of a package by the names of their modules."""
    modules = {}
    for path in package.rglob("*.py"):
        parts = path.relative_to(package.parent).with_suffix("").parts
        modules[".".join(parts).removesuffix(".__init__")] = path
    return modules


def test_modules_are_imported_by_names_that_checkers_see():
    """Only the top of the library, and what loads other libraries, import by a text."""
    importing = {
        name
        for name, path in files_of(ROOT / "riemhuman").items()
        if "import_module" in (text := path.read_text(encoding="utf-8"))
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and named_modules(node)
    }
    assert importing <= {"riemhuman", "riemhuman.optional"}
