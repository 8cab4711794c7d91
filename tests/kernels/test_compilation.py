"""Where compiled functions cannot be kept, everything works as well, and one warning says so."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from riemhuman.kernels import compilation

ROOT = Path(__file__).parents[2]

COMPUTE = """
import numpy as np
from riemhuman.terms._sum import fill_records
records = np.empty((1, 12, 1))
corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
fill_records(corners[:, None], np.array([[0, 1, 2]]), np.array([[1.0, 1.0, 0.0]]), 0, 1, records)
print(records[0, 6:, 0].tolist())
"""
EXPECTED = "[0.0, 0.0, 1.0, 1.0, 1.0, 0.0]"


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """Return a folder with a copy of the package, in which nothing can be kept: root may write
    to folders that are read-only, but not below a file."""
    folder = tmp_path_factory.mktemp("read-only")
    ignored = shutil.ignore_patterns("__pycache__", "data", "web")
    shutil.copytree(ROOT / "riemhuman", folder / "riemhuman", ignore=ignored)
    for subpackage in ("kernels", "terms"):
        (folder / "riemhuman" / subpackage / "__pycache__").write_text("not a folder")
    return folder


def compute(package, **environment):
    """Return what a process with a copy of the package complains of."""
    nowhere = str(package / "riemhuman" / "__init__.py" / "home")
    places = {"HOME": nowhere, "XDG_CACHE_HOME": nowhere, "PYTHONPATH": str(package)}
    # Whoever runs the tests may have named a folder.
    inherited = {name: text for name, text in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-B", "-c", COMPUTE],
        env=inherited | places | environment,
        cwd=package,
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == EXPECTED
    return done.stderr


@pytest.mark.everyday("NUMBA_CACHE_DIR")
@pytest.mark.parametrize("named", [False, True], ids=["no home", "NUMBA_CACHE_DIR"])
def test_nowhere_to_keep_compiled_functions(package, named):
    below_a_file = str(package / "riemhuman" / "__init__.py" / "cache")
    said = compute(package, **({"NUMBA_CACHE_DIR": below_a_file} if named else {}))
    assert said.count("UserWarning: compiled functions cannot be kept on disk") == 1
    assert "NUMBA_CACHE_DIR" in said
    assert "Traceback" not in said


def test_stamps_change_with_the_files_of_a_module(tmp_path):
    file = tmp_path / "some.py"
    assert compilation._stamp({}) is None
    assert compilation._stamp({"__file__": str(file)}) is None
    file.write_text("x = 1")
    status = file.stat()
    assert (status.st_mtime, status.st_size) in compilation._stamp({"__file__": str(file)})


@compilation.compiled
def rounding_error(a, b, product):
    return a * b - product


@compilation.compiled(fastmath=compilation.FUSED)
def fused_error(a, b, product):
    return rounding_error(a, b, product)


def test_functions_compute_alike_whoever_called_them_first():
    """numba gives what a fast function calls first its fast ways, and keeps this on disk."""
    a, b = 1.0 + 2.0**-30, 1.0 + 2.0**-29
    assert fused_error(a, b, a * b) == 0.0
    assert rounding_error(a, b, a * b) == 0.0


@compilation.compiled(forceinline=True)
def twice(x):
    return 2.0 * x


@compilation.compiled
def four_times(x):
    return twice(twice(x))


def test_inlined_functions_run_in_python_too():
    """Without what numba needs to call them from there, they would end the interpreter."""
    assert four_times(3.0) == 12.0
    assert twice(3.0) == 6.0
