"""Everything at full length, in pieces: python tests/support/nightly.py [PART [NAME ...]].

The parts are fuzz (names of readers), tests and benchmarks (what pytest takes) and mutations (names
of subpackages). Without names, all pieces of a part run one after the other, and without a part all
parts. Each piece says when it starts, how it ended and how many minutes it took, and those that
failed are named at the end. `python .ci/jobs.py nightly` does this in a fresh environment.

Files are damaged, and the code is changed, in other ways on another day: the commands are printed.
"""

import re
import subprocess
import sys
import time
from datetime import date
from pathlib import Path

# As a program, it tests the installed library, and with `python -m` the one in this folder.
PYTEST = (str(Path(sys.executable).with_name("pytest")), "-q", "-p", "no:cacheprovider")
PYTEST += ("-m", "", "-s")
DAY = date.today().toordinal()
NUMBERS = {
    "fuzz": ("--count", "15000", "--first", str(DAY * 15000)),
    "mutations": ("100", str(DAY)),
}


def folders():
    """Return the folders and files of tests, without benchmarks."""
    files = Path("tests").rglob("test_*.py")
    return sorted({Path(*file.parts[:2]) for file in files} - {Path("tests/benchmarks")})


def benchmarks():
    """Return every benchmark."""
    return [
        f"{file}::{name}"
        for file in sorted(Path("tests/benchmarks").glob("test_*.py"))
        for name in re.findall(r"^def (test_\w+)", file.read_text(encoding="utf-8"), re.MULTILINE)
    ]


def pieces(part, names):
    """Return the titles of the pieces of a part, and their commands."""
    if part == "fuzz":
        asked = [[name] for name in names or ["all"]]
        command, last = (sys.executable, "tests/support/fuzz.py"), NUMBERS[part]
    elif part == "mutations":
        asked = [[name] for name in names or ("kernels", "terms", "geometry", "solvers")]
        command, last = (sys.executable, "tests/support/mutations.py"), NUMBERS[part]
    elif part == "tests":
        asked = [names] if names else [[str(folder)] for folder in folders()]
        command, last = (*PYTEST, "--durations", "10"), ()
    elif part == "benchmarks":
        asked = [names] if names else [[name] for name in benchmarks()]
        command, last = (*PYTEST, "--benchmark-enable"), ()
    else:
        sys.exit(f"nightly has no part {part!r}")
    return [(" ".join([part, *given]), [*command, *given, *last]) for given in asked]


def main():
    part, *names = sys.argv[1:] or ["all"]
    parts = ("fuzz", "tests", "benchmarks", "mutations") if part == "all" else (part,)
    waiting = [piece for part in parts for piece in pieces(part, names)]
    failed = []
    for number, (title, command) in enumerate(waiting, 1):
        print(f"== {number} of {len(waiting)}: nightly {title}", flush=True)
        print(*command[1:], flush=True)
        start = time.monotonic()
        code = subprocess.run(command, check=False).returncode
        minutes = (time.monotonic() - start) / 60
        ending = "passed" if code == 0 else f"failed with code {code}"
        print(f"== nightly {title} {ending} after {minutes:.1f} min", flush=True)
        if code != 0:
            failed.append(title)
    sys.exit("\n".join(["failed:", *failed]) if failed else 0)


if __name__ == "__main__":
    main()
