"""Seeded sabotage: how many small mistakes in a room do its own tests notice?

``python tests/trust/sabotage.py --room kernels --n 60 --seed 0`` changes one operator, constant,
comparison or condition at a time in a copy of the package, and runs tests of that room alone until
one fails: those that run the changed function, the quickest first. Which they are is recorded once,
in a run of the room without any change. Files of compiled functions are tested interpreted first,
which compiles nothing and shows who runs which function; an error that compiled functions do not
raise counts for nothing there, and whoever survives is tested compiled, by all tests of the room.
It prints the share of changes that were noticed, and those that were not. A change that makes the
tests hang counts as noticed. What no test can notice is not changed: see `harmless_changes`.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import hashlib
import importlib
import itertools
import json
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, NoReturn

import numba
import pytest
from random_changes import changed_at, is_marked, lost, places_in
from ways_to_test import Chosen, Interpreted, Recorder

# What most tests import: loaded once.
for _module in (
    *("autograd.numpy", "mpmath", "scipy.interpolate", "scipy.linalg", "scipy.optimize"),
    *("scipy.sparse.linalg", "scipy.spatial.transform", "trimesh.creation"),
):
    importlib.import_module(_module)

ROOT = Path(__file__).parents[2]

# Tests of files whose own name no file of tests bears.
_MIRRORS = {
    "geometry/geodesic_quantities.py": "geometry/test_metric.py",
    "geometry/metric_of_terms.py": "geometry/test_surface_metric.py",
    "geometry/samples.py": "geometry/test_manifold.py",
    "geometry/space.py": "geometry/test_manifold.py",
    "geometry/bulk.py": "geometry/test_pairwise.py",
    "geometry/general_elastic_metric.py": "geometry/test_aligned_surfaces.py",
    "geometry/term_fields.py": "geometry/test_pullback.py",
    "kernels/tiles.py": "terms/test_pairs.py",
    "terms/ebin_matrices.py": "terms/test_ebin.py",
    "terms/flat.py": "terms",
    "terms/normals.py": "terms",
    "terms/root_normals.py": "terms",
    "terms/sum.py": "terms",
    "terms/term.py": "terms",
    "geometry/elastic_metric.py": "geometry/test_aligned_surfaces.py",
    "solvers/basis_mean.py": "solvers/test_means.py",
    "solvers/dispersion.py": "solvers/test_means.py",
    "statistics/frechet_mean.py": "solvers/test_means.py",
    "solvers/gradient_descent_mean.py": "solvers/test_means.py",
}

# Tests that are asked first, by themselves.
_FIRST = 40

# Errors of Python where compiled functions read what stands there, or compute infinity or NaN.
_OF_PYTHON_ALONE = (
    *("IndexError", "OverflowError", "ZeroDivisionError", "RuntimeWarning", "math domain error"),
    "TimeoutError",
)


class _Copy:
    """A copy of the package and its tests, in which a room is tested."""

    def __init__(self, folder: Path, room: str) -> None:
        self.folder, self.room = folder, room
        for name in ("riemhuman", "tests"):
            ignored = shutil.ignore_patterns("__pycache__")
            shutil.copytree(ROOT / name, folder / name, ignore=ignored, dirs_exist_ok=True)
        for name in ("setup.cfg", "README.md"):
            shutil.copy(ROOT / name, folder)
        self._compiled = folder / "compiled"
        self._compiled.mkdir(exist_ok=True)
        self._output = ""
        self._sources = {
            ".".join(source.relative_to(folder).with_suffix("").parts): source.read_text("utf-8")
            for room in ("kernels", "terms")
            for source in (folder / "riemhuman" / room).glob("*.py")
        }
        # By test: seconds, and the functions that it runs.
        self._tests: dict[str, Any] = {}
        self._interpreted: dict[str, Any] = {}

    def check_tests(self, seconds: float) -> tuple[int, int]:
        """Run the tests of the room without any change, and keep what they compile and run.

        Returns how many there are, and how many run interpreted.
        """
        kept = self.folder / "recorded.json"
        if not kept.exists():
            kept.write_text(json.dumps(self._both_recorded(seconds)), encoding="utf-8")
        recorded = self._tests, self._interpreted = json.loads(kept.read_text(encoding="utf-8"))
        n_tests, n_interpreted = (sum("::" in test for test in tests) for tests in recorded)
        return n_tests, n_interpreted

    def _both_recorded(self, seconds: float) -> tuple[dict[str, Any], dict[str, Any]]:
        tests, end = self._recorded([], self._compiled, seconds)
        if end != "survived":
            sys.exit(f"{self._output}\nthe tests of the room fail without any change")
        interpreted: dict[str, Any] = {}
        if any(
            self.is_compiled(file) for file in (self.folder / "riemhuman" / self.room).iterdir()
        ):
            # What passes compiled alone, or is slow, is not asked interpreted.
            interpreted, _ = self._recorded([Interpreted()], None, seconds)
        return tests, interpreted

    def _recorded(
        self, plugins: list[Any], compiled: Path | None, seconds: float
    ) -> tuple[dict[str, Any], str]:
        path = self.folder / "tests.json"
        plugins = [Recorder(self.folder / "riemhuman", path), *plugins]
        path.unlink(missing_ok=True)
        end = self._run([f"tests/{self.room}"], plugins, compiled, seconds)
        return (json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}), end

    def is_compiled(self, file: Path) -> bool:
        """Tell whether compiled functions are in a file, or may hold constants of it."""
        return any(
            "riemhuman.kernels.compiled import" in self._sources[name]
            for name in self._importing(file)
        )

    def _importing(self, file: Path) -> set[str]:
        """Return the names of a module and of all that import from it, and from these."""
        found: set[str] = set()
        waiting = {f"riemhuman.{self.room}.{file.stem}"} & set(self._sources)
        while waiting:
            name = waiting.pop()
            found.add(name)
            lines = f"from {name} import"
            waiting |= {other for other, text in self._sources.items() if lines in text} - found
        return found

    def tests_of(self, file: Path, line: int) -> tuple[list[str], list[str]]:
        """Return the tests that run a line of a file, interpreted and as they are.

        As far as is known; those of the file's own tests first, and the quickest.
        """
        name = f"{self.room}/{file.name}"
        tree = ast.parse(file.read_text(encoding="utf-8"))
        around = [
            node
            for node in ast.walk(tree)
            if isinstance(node, ast.FunctionDef) and node.lineno <= line <= (node.end_lineno or 0)
        ]
        starts = {min([n.lineno, *(d.lineno for d in n.decorator_list)]) for n in around}
        mirror = _MIRRORS.get(name, f"{self.room}/test_{file.name}")

        def run(test: str, recorded: dict[str, Any]) -> bool:
            ran = [*recorded[test][1], *recorded.get(test.split("::")[0], (0, []))[1]]
            return any(where == name and at in starts for where, at in ran)

        def chosen(recorded: dict[str, Any], *, known: bool = True) -> list[str]:
            """Return the tests that run the line; where that is not known or of a module, all."""
            seconds = {test: taken for test, (taken, _) in recorded.items() if "::" in test}
            found = [test for test in seconds if known and starts and run(test, recorded)]
            found = found or list(seconds)
            return sorted(found, key=lambda t: (not t.startswith(f"tests/{mirror}"), seconds[t]))

        interpreted = chosen(self._interpreted) if self.is_compiled(file) else []
        if not any(is_marked(node, "compiled") for node in around):
            return interpreted, chosen(self._tests)
        # Who runs a compiled function is known of what runs interpreted; as they are, tests show
        # nothing of it but the calls that pass the compiler by.
        spared = set(self._interpreted) - set(interpreted)
        left = {test: r for test, r in self._tests.items() if test not in spared}
        return interpreted, chosen(left, known=False)

    def try_change(
        self, file: Path, changed: str, tests: tuple[list[str], list[str]], seconds: float
    ) -> str:
        """Return "survived", "killed" or "timed out", for a file of other text."""
        source, times = file.read_text(encoding="utf-8"), file.stat()
        interpreted, compiled = tests
        with tempfile.TemporaryDirectory(dir=self.folder) as scratch:
            file.write_text(changed, encoding="utf-8")
            try:
                end = self._ask(interpreted, [Interpreted()], None, seconds)
                if end == "timed out" or any(error in self._output for error in _OF_PYTHON_ALONE):
                    end = "survived"
                if end == "survived":
                    # What is kept on disk does not notice constants that it imports.
                    stale = {name.split(".")[-1] for name in self._importing(file)}
                    kept = Path(scratch, "compiled")
                    ignored = shutil.ignore_patterns(*(f"{stem}.*.nb?" for stem in stale))
                    shutil.copytree(self._compiled, kept, copy_function=os.link, ignore=ignored)
                    end = self._ask(compiled, [], kept, seconds)
            finally:
                file.write_text(source, encoding="utf-8")
                os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
        return end

    def _ask(
        self, tests: list[str], plugins: list[Any], compiled: Path | None, seconds: float
    ) -> str:
        """Run some tests first, then the others, until one fails."""
        self._output, end = "", "survived"
        for some in (tests[:_FIRST], tests[_FIRST:]):
            if end == "survived" and some:
                files = sorted({test.split("::")[0] for test in some})
                end = self._run(["-x", *files], [Chosen(some), *plugins], compiled, seconds)
                seconds *= 3
        return end

    def _run(
        self, tests: list[str], plugins: list[Any], compiled: Path | None, seconds: float
    ) -> str:
        """Run tests in a copy of this process, which has loaded what they import.

        With functions from a folder of compiled ones, or interpreted.
        """
        arguments = ["-q", "-p", "no:cacheprovider", *tests]
        with tempfile.TemporaryFile(mode="w+", encoding="utf-8") as output:
            child = os.fork()
            if child == 0:
                self._test_and_exit(arguments, plugins, compiled, output.fileno())
            code = _exit_code(child, seconds)
            output.seek(0)
            self._output = output.read()
        if code is None:
            return "timed out"
        # pytest's own: passed, and none collected. It was called wrongly with 4.
        if code in (0, 5):
            return "survived"
        if code == 4 and "ImportError while loading conftest" not in self._output:
            sys.exit(self._output)
        return "killed"

    def _test_and_exit(
        self, arguments: list[str], plugins: list[Any], compiled: Path | None, output: int
    ) -> NoReturn:
        # Its own group, so that what the tests start ends with them.
        os.setsid()
        os.dup2(output, 1)
        os.dup2(output, 2)
        os.chdir(self.folder)
        os.environ |= {
            **({"NUMBA_CACHE_DIR": str(compiled)} if compiled else {"NUMBA_DISABLE_JIT": "1"}),
            "PYTHONDONTWRITEBYTECODE": "1",
            "PYTHONPATH": str(self.folder),
        }
        sys.dont_write_bytecode = True
        sys.path[0] = str(self.folder)
        numba.config.reload_config()
        code = int(pytest.main(arguments, plugins=plugins))
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _digest(room: str) -> str:
    """Return what changes with the package, or with the tests of a room."""
    folders = ROOT.glob("riemhuman/**/*.py"), ROOT.glob("tests/*.py")
    digest = hashlib.sha256()
    for file in sorted({*itertools.chain(*folders, ROOT.glob(f"tests/{room}/**/*.py"))}):
        # Compiled functions on disk are known by the time of their source.
        digest.update(f"{file.relative_to(ROOT)} {file.stat().st_mtime_ns}".encode())
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


def _exit_code(child: int, seconds: float) -> int | None:
    """Return how a process ends, or None where it runs for too long; nothing of it is left."""
    deadline = time.monotonic() + seconds
    ended, status = os.waitpid(child, os.WNOHANG)
    while not ended and time.monotonic() < deadline:
        time.sleep(0.05)
        ended, status = os.waitpid(child, os.WNOHANG)
    with contextlib.suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    if not ended:
        os.waitpid(child, 0)
        return None
    return os.waitstatus_to_exitcode(status)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--room", default="kernels")
    parser.add_argument("--n", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--files", nargs="*", default=[], help="of the room, these files alone")
    parser.add_argument("--only", nargs="*", default=[], help="numbers of the changes to try")
    parser.add_argument(
        "--timeout", type=float, default=120.0, help="seconds for one file of tests"
    )
    parser.add_argument(
        "--minutes",
        type=float,
        default=1e9,
        help="begin no change after so long; the order is random",
    )
    parser.add_argument("--least", type=float, default=0.0, help="per cent, else the run fails")
    parser.add_argument(
        "--keep",
        type=Path,
        help="folder for what is recorded, which the next run of the same files finds there",
    )
    options = parser.parse_args()
    if gone := lost(ROOT / "riemhuman"):
        sys.exit("listed in harmless_changes.py, and no longer in the package: " + "; ".join(gone))
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if options.keep:
            folder = options.keep.absolute() / options.room / _digest(options.room)
            folder.mkdir(parents=True, exist_ok=True)
        copy = _Copy(folder, options.room)
        places, n_passed_over = places_in(copy.folder / "riemhuman" / options.room, options.files)
        chosen = random.Random(options.seed).sample(places, min(options.n, len(places)))
        start = time.monotonic()
        n_tests, n_interpreted = copy.check_tests(20 * options.timeout)
        sys.stdout.write(
            f"{n_tests} tests, {n_interpreted} of them interpreted as well, recorded in "
            f"{time.monotonic() - start:.0f} s\n"
        )
        ends, start = [], time.monotonic()
        for number, (file, target) in enumerate(chosen, start=1):
            if options.only and str(number) not in options.only:
                continue
            if time.monotonic() - start > 60 * options.minutes:
                break
            saboteur, changed = changed_at(file, target)
            began = time.monotonic()
            tests = copy.tests_of(file, saboteur.line)
            ends.append(copy.try_change(file, changed, tests, options.timeout))
            seconds = time.monotonic() - began
            text = file.read_text(encoding="utf-8").splitlines()[saboteur.line - 1].strip()
            sys.stdout.write(
                f"{number:3} {ends[-1]:9} {seconds:5.0f} s  {file.name}:{saboteur.line} "
                f"{saboteur.what}: {text}\n"
            )
            sys.stdout.flush()
    noticed = len(ends) - ends.count("survived")
    share = 100 * noticed / len(ends)
    sys.stdout.write(
        f"{noticed} of {len(ends)} noticed by tests/{options.room}, {share:.0f} % "
        f"({ends.count('timed out')} by hanging; {len(places)} places, and {n_passed_over} known "
        "to change nothing were passed over)\n"
    )
    if share < options.least:
        sys.exit(f"at least {options.least:g} % were asked for")


if __name__ == "__main__":
    main()
