"""The rooms import only from the floors below, and the contracts of setup.cfg can see it."""

import ast
import shutil
import subprocess
import sys
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]

ROOMS = "A room imports only from the floors below"
ABSTRACT = "The abstract classes know nothing of the spaces built on them"


def lint_imports(folder, config=ROOT / "setup.cfg", *options):
    """Check the package found in `folder` against the contracts of setup.cfg."""
    return subprocess.run(
        [
            sys.executable,
            "-c",
            "from importlinter.cli import lint_imports_command; lint_imports_command()",
            f"--config={config}",
            "--no-cache",
            *options,
        ],
        cwd=folder,
        capture_output=True,
        encoding="utf-8",
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


@pytest.mark.parametrize("line", ["", "if TYPE_CHECKING:\n    import riemhuman.solvers"])
def test_imports_for_types_reach_up_from_no_room(twin, line):
    append(twin / "geometry/metric.py", line)
    text = (ROOT / "setup.cfg").read_text(encoding="utf-8")
    for old, new in (
        ("exclude_type_checking_imports = true", "exclude_type_checking_imports = false"),
        # For types alone, spaces know the template; protocols are types of every room's objects.
        ("    (geometry) | (surfaces)\n", "    (geometry)\n    (surfaces)\n"),
        ("ignore_imports =\n", "ignore_imports =\n    riemhuman.protocols.* -> riemhuman.**\n"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    config = twin.parent / "setup.cfg"
    config.write_text(text, encoding="utf-8")
    result = lint_imports(twin.parent, config, "--contract", "rooms")
    assert f"{ROOMS} {'BROKEN' if line else 'KEPT'}" in result.stdout, result.stdout


@pytest.mark.sampled(5)
@pytest.mark.parametrize(
    ("module", "line", "contract"),
    [
        ("checks.py", "import riemhuman.kernels", ROOMS),
        ("kernels/__init__.py", "import riemhuman.geometry.metric", ROOMS),
        ("geometry/metric.py", "import riemhuman.surfaces.template", ROOMS),
        ("surfaces/template.py", "def f():\n    import riemhuman.geometry", ROOMS),
        ("bodies/__init__.py", "import riemhuman.datasets", ROOMS),
        ("attic.py", '"""A room that is not on the map."""', ROOMS),
        ("geometry/manifold.py", "import riemhuman.geometry.metric_fields", ABSTRACT),
        ("geometry/attic.py", '"""A space that is not on the map."""', ABSTRACT),
        ("checks.py", "from riemhuman import Template", "No room goes through the front door"),
        (
            "surfaces/template.py",
            "import trimesh",
            "Only riemhuman.io.meshes imports trimesh",
        ),
        ("geometry/metric.py", "import numba", "Only riemhuman.kernels.compilation imports numba"),
        (
            "datasets/__init__.py",
            "import h5py",
            "Optional dependencies come through riemhuman.optional",
        ),
    ],
)
def test_contracts_can_be_broken(twin, module, line, contract):
    append(twin / module, line)
    result = lint_imports(twin.parent)
    assert result.returncode == 1, result.stdout + result.stderr
    assert f"{contract} BROKEN" in result.stdout


@pytest.mark.parametrize(
    ("module", "line"),
    [
        ("datasets/__init__.py", "import riemhuman.bodies"),
        ("io/meshes.py", "import trimesh"),
        (
            "geometry/metric.py",
            "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import riemhuman.solvers",
        ),
    ],
)
def test_contracts_allow(twin, module, line):
    append(twin / module, line)
    result = lint_imports(twin.parent)
    assert result.returncode == 0, result.stdout + result.stderr


def imported(path, modules):
    """Return the modules that one imports, those for types and those within functions included."""
    names = set()
    for one in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(one, ast.ImportFrom):
            several = {f"{one.module}.{alias.name}" for alias in one.names}
            names |= {name if name in modules else one.module for name in several}
        elif isinstance(one, ast.Import):
            names |= {alias.name for alias in one.names}
    return names & modules.keys()


def circle(package):
    """Return modules that import each other in a circle, or none."""
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
    assert circle(ROOT / "riemhuman") == []


@pytest.mark.parametrize("where", ["if TYPE_CHECKING:", "def f():"])
def test_circles_of_imports_are_seen(twin, where):
    line = f"from typing import TYPE_CHECKING\n{where}\n    "
    append(twin / "geometry/metric.py", line + "from riemhuman.geometry.manifold import Manifold")
    assert {"riemhuman.geometry.metric", "riemhuman.geometry.manifold"} <= set(circle(twin))
