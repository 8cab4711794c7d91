"""Print a benchmark beside what it prints of another commit, both run in turns.

    python tests/benchmarks/beside.py HEAD~1 tests/benchmarks/test_distances.py -k pose

Both run the benchmarks of this working tree: the library is that of the tree and that of the
commit, which is checked out in a temporary folder. Every number that differs is followed by the
other one and their ratio; numbers are medians over the rounds.
"""

import argparse
import contextlib
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
# Rounds shorter than this, in seconds, are of benchmarks that print what they measure.
_SHORTEST = 1e-5


@contextlib.contextmanager
def checked_out(repository, commit):
    """Check a commit out in a temporary folder, with the tests of the repository's own tree."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        git = ["git", "-C", str(repository), "worktree"]
        subprocess.run([*git, "add", "--quiet", "--detach", str(tree), commit], check=True)
        try:
            if (repository / "tests").is_dir():
                shutil.rmtree(tree / "tests", ignore_errors=True)
                ignored = shutil.ignore_patterns("__pycache__")
                shutil.copytree(repository / "tests", tree / "tests", ignore=ignored)
            yield tree
        finally:
            subprocess.run([*git, "remove", "--force", str(tree)], check=True)


def run(tree, command):
    """Return what a command prints in a tree; stop if it fails."""
    environment = os.environ | {"PYTHONPATH": str(tree)}
    result = subprocess.run(command, cwd=tree, env=environment, capture_output=True, text=True)
    if result.returncode:
        sys.exit(f"{' '.join(command)}\nfailed in {tree}:\n{result.stdout}{result.stderr}")
    return result.stdout


def benchmark(tree, arguments):
    """Return the lines that pytest prints of benchmarks in a tree, with their shortest rounds."""
    with tempfile.TemporaryDirectory() as folder:
        times = Path(folder) / "times.json"
        options = ["--benchmark-enable", "-s", "-q", "-p", "no:cacheprovider", "--no-header"]
        options += ["--benchmark-columns=min", f"--benchmark-json={times}"]
        printed = run(tree, [sys.executable, "-m", "pytest", *options, *arguments])
        lines = printed.partition("\n-------")[0].splitlines()
        for one in json.loads(times.read_text())["benchmarks"]:
            if one["stats"]["min"] >= _SHORTEST:
                lines.append(f"{one['name']}: {1e3 * one['stats']['min']:.4g} ms, shortest round")
        return lines


def beside(here, there):
    """Return the lines of one tree, with the numbers of the other where they differ.

    Parameters
    ----------
    here, there : list of list of str
        Lines that each round printed. Lines belong together that differ in their numbers alone.
    """
    found = []
    others = _numbers(there)
    for key, rounds in _numbers(here).items():
        ours = [statistics.median(values) for values in zip(*rounds, strict=True)]
        theirs = [statistics.median(values) for values in zip(*others.get(key, []), strict=True)]
        numbers = iter(_with_other(ours, theirs))
        found.append(re.sub("\0", lambda _: next(numbers), key[0]))  # noqa: B023
    return found


def _numbers(rounds):
    """Return the numbers of every line in every round, by the line without them and its turn."""
    found = {}
    for lines in rounds:
        seen = {}
        for line in lines:
            values = [float(text.replace(",", "")) for text in NUMBER.findall(line)]
            if values:
                text = NUMBER.sub("\0", line)
                seen[text] = seen.get(text, -1) + 1
                found.setdefault((text, seen[text]), []).append(values)
    return found


def _with_other(ours, theirs):
    for one, other in zip(ours, theirs or ours, strict=True):
        if one == other:
            yield f"{one:g}"
        else:
            ratio = f", {one / other:.2f} times" if other else ""
            yield f"{one:g} [{other:g}{ratio}]"


def main(arguments=None):
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commit", help="the commit to compare with")
    parser.add_argument("--rounds", type=int, default=3, help="runs of each (default: 3)")
    options, of_pytest = parser.parse_known_args(arguments)
    repository = Path(__file__).parents[2]
    here, there = [], []
    with checked_out(repository, options.commit) as tree:
        for _ in range(options.rounds):
            there.append(benchmark(tree, of_pytest))
            here.append(benchmark(repository, of_pytest))
    print(f"this tree [{options.commit}, ratio]")
    print("\n".join(beside(here, there)))


if __name__ == "__main__":
    main()
