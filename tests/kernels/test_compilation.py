"""Where compiled functions cannot be kept, everything works as well, and one warning says so."""

import gc
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
from riemhuman.terms._sums import fill_records
records = np.empty((1, 12, 1))
corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
fill_records(corners[None], np.array([[0, 1, 2]]), np.array([[1.0, 1.0, 0.0]]), 0, 1, records)
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
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == EXPECTED
    return done.stderr


@pytest.mark.everyday("NUMBA_CACHE_DIR")
@pytest.mark.parametrize("named", [False, True], ids=["no home", "NUMBA_CACHE_DIR"])
def test_nowhere_to_keep_compiled_functions(package, named):
    below_a_file = str(package / "riemhuman" / "__init__.py" / "cache")
    said = compute(package, **({"NUMBA_CACHE_DIR": below_a_file} if named else {}))
    assert said.count("UserWarning: compiled functions cannot be stored on disk") == 1
    assert "NUMBA_CACHE_DIR" in said
    assert "Traceback" not in said


INLINED = """
from riemhuman.terms import compiled

@compiled(forceinline=True)
def scaled(x):
    return {factor} * x
"""
CALLER = """
from riemhuman.terms import compiled
from inlined import scaled

@compiled
def value(x):
    return scaled(x)

value(1.0)
print(value(1.0), sum(value.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_what_is_kept_follows_the_files_of_inlined_functions(tmp_path):
    """Numba by itself looks at the file of the caller alone."""
    (tmp_path / "caller.py").write_text(CALLER)
    environment = os.environ | {"PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}

    def run(factor):
        (tmp_path / "inlined.py").write_text(INLINED.replace("{factor}", factor))
        done = subprocess.run(
            [sys.executable, "-B", "-c", "import caller"],
            env=environment | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=True,
            timeout=600,
        )
        return done.stdout.split()

    assert run("2.0") == ["2.0", "0"]
    assert run("3.0") == ["3.0", "0"]
    assert run("2.0") == ["2.0", "1"]


def test_functions_of_no_file_have_no_digest():
    assert compilation._digest({}) is None
    assert compilation._digest({"__file__": "<notebook>"}) is None


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


def test_a_long_compilation_is_told_once(monkeypatch):
    now, told = iter([0.0, 0.5, 1.0, 1.5, 3.0, 4.0, 5.0, 9.0]), []
    monkeypatch.setattr("time.perf_counter", lambda: next(now))
    taken = compilation.CompilationTime()
    taken.tell(lambda: told.append(taken.seconds))
    taken._end()  # begun before anybody listened
    taken._begin()
    taken._end()
    assert (told, taken.seconds) == ([], 0.5)
    taken._begin()
    taken._begin()  # a function that the first one calls
    taken._end()
    assert told == [0.5]  # 0.5 and 2.0 seconds
    assert not gc.isenabled()
    taken._end()
    assert gc.isenabled()
    taken._begin()
    taken._end()
    assert (len(told), taken.seconds) == (1, 7.5)
