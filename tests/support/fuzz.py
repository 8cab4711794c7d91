"""Runs readers on damaged files in a process with bounded memory, and watches them.

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
from fuzzing import CANARY, one_of

from riemhuman.errors import RiemhumanError

MEMORY = 2**30  # bytes of address space beyond what the process has before the first case

# Nothing of this is any reader's business.
_FORBIDDEN = (
    *("os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "subprocess.Popen"),
    *("pickle.find_class", "socket.connect", "socket.bind", "ctypes.dlopen", "code.__new__"),
    *("shutil.rmtree", "shutil.move", "os.kill"),
)
_CHANGES = ("os.remove", "os.mkdir", "os.rmdir", "os.truncate", "os.rename", "os.link", "os.chmod")
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class Watchman:
    """Notes what a reader does that it should not, told by Python's audit events."""

    def __init__(self, folder):
        self.folder, self.seen, self.awake = f"{folder}{os.sep}", [], False
        sys.addaudithook(self._look)

    def _look(self, event, arguments):
        if not self.awake or (event == "pickle.find_class" and _compiler_at_work()):
            return
        if event in _FORBIDDEN:
            self.seen.append(f"{event} {arguments!r}"[:200])
        elif event in _CHANGES or (event == "open" and arguments[2] & _WRITING):
            paths = arguments[: 2 if event in ("os.rename", "os.link") else 1]
            for path in paths:
                if isinstance(path, (str, bytes)):
                    where = os.path.abspath(os.fsdecode(path))
                    if not where.startswith(self.folder):
                        self.seen.append(f"{event} {path!r}")


def _compiler_at_work():
    """Return whether Numba is reading its own cache of compiled functions."""
    frame = sys._getframe(2)
    while frame is not None and f"{os.sep}numba{os.sep}" not in frame.f_code.co_filename:
        frame = frame.f_back
    return frame is not None


def chain(error):
    """Return the names of an error and of those it came from."""
    names = []
    while error is not None:
        names.append(type(error).__name__)
        error = error.__cause__ or error.__context__
    return names


def run_case(reader, files, rng, folder, watchman):
    """Return how a case ended, "read" or "refused", what was done, and what is wrong, if any."""
    target = one_of(rng, list(files))
    mutation = one_of(rng, reader.mutations)
    put(folder, files | {target: mutation(rng, files[target])})
    end, problem = "refused", None
    watchman.awake = True
    try:
        for array in reader.read(folder):
            assert np.isfinite(array).all(), "not finite"
        end = "read"
    except RiemhumanError as error:
        if {"MemoryError", "RecursionError"} & set(chain(error)):
            problem = f"{' from '.join(chain(error))}: {error}"
    except Exception as error:  # noqa: BLE001
        where = traceback.extract_tb(error.__traceback__)
        place = "; ".join(f"{Path(f.filename).name}:{f.lineno}" for f in where[-4:])
        problem = f"{' from '.join(chain(error))}: {error} at {place}"
    finally:
        watchman.awake = False
    if watchman.seen:
        problem = f"did what it should not: {'; '.join(watchman.seen)}"
    if Path(CANARY).exists() or (folder / CANARY).exists():
        Path(CANARY).unlink(missing_ok=True)
        problem = f"ran what the file says; {problem}"
    watchman.seen.clear()
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
    with tempfile.TemporaryDirectory(prefix="fuzz") as home:
        os.chdir(home)
        folder = Path(home) / "folder"
        watchman, files = Watchman(folder), {}
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
                end, done, problem = run_case(READERS[name], files[name], rng, folder, watchman)
                ends[name][end] += 1
                if problem:
                    problems.append(f"{name!r} --first {seed} ({done}): {problem}")
        os.chdir("/")
    sys.stdout.write(json.dumps({"ends": ends}) + "\n")
    sys.exit("\n".join(problems) or None)


if __name__ == "__main__":
    main()
