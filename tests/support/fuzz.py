"""Runs readers on damaged files in a process with bounded memory.

Called by the tests, or by hand: ``PYTHONPATH=. python tests/support/fuzz.py "ply text" --first 17
--count 1`` repeats one case, ``all --count 2000`` looks for more. The last line printed says in
JSON how the cases ended; if any ended badly, standard error names it and the process fails.
"""

import argparse
import json
import os
import resource
import sys
import tempfile
import traceback
import warnings
from pathlib import Path

import numpy as np
from fuzzed_readers import READERS
from fuzzing import one_of

from riemhuman.errors import RiemhumanError

MEMORY = 2**30  # bytes of address space beyond what the process has before the first case


def run_case(reader, files, rng, folder):
    """Return how a case ended, "read" or "refused", what was done, and what is wrong, if any."""
    target = one_of(rng, list(files))
    mutation = one_of(rng, reader.mutations)
    put(folder, files | {target: mutation(rng, files[target])})
    end, problem = "refused", None
    try:
        for array in reader.read(folder):
            assert np.isfinite(array).all(), "not finite"
        end = "read"
    except (RiemhumanError, MemoryError):
        return end, f"{target}: {mutation.__name__}", None
    except Exception as error:  # noqa: BLE001
        where = traceback.extract_tb(error.__traceback__)
        place = "; ".join(f"{Path(f.filename).name}:{f.lineno}" for f in where[-4:])
        problem = f"{error!r} at {place}"
    return end, f"{target}: {mutation.__name__}", problem and problem[:600]


def put(folder, files):
    """Make a folder with these files alone."""
    for file in sorted(folder.rglob("*"), reverse=True):
        file.rmdir() if file.is_dir() else file.unlink()
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True, parents=True)
        (folder / name).write_bytes(content)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("readers", nargs="+", choices=[*READERS, "all"])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--verbose", action="store_true", help="print each case before it runs")
    options = parser.parse_args()
    names = list(READERS) if options.readers == ["all"] else options.readers
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", UserWarning)  # of the library: it may doubt a file
    with tempfile.TemporaryDirectory(prefix="fuzz") as home:
        os.chdir(home)
        folder = Path(home) / "folder"
        files = {}
        for name in names:
            # A valid file first: it must be read, and what loads at first use is loaded.
            files[name] = READERS[name].files()
            put(folder, files[name])
            READERS[name].read(folder)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + MEMORY
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        ends, problems = {name: {"read": 0, "refused": 0} for name in names}, []
        for name in names:
            for seed in range(options.first, options.first + options.count):
                if options.verbose:
                    sys.stdout.write(f"{name!r} --first {seed}\n")
                    sys.stdout.flush()
                rng = np.random.default_rng([seed, *name.encode()])
                end, done, problem = run_case(READERS[name], files[name], rng, folder)
                ends[name][end] += 1
                if problem:
                    problems.append(f"{name!r} --first {seed} ({done}): {problem}")
        os.chdir("/")
    sys.stdout.write(json.dumps({"ends": ends}) + "\n")
    sys.exit("\n".join(problems) or None)


if __name__ == "__main__":
    main()
