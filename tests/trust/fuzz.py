"""Runs readers on damaged files in a process that has little memory and time and a watchman.

Called by the tests, or by hand: ``PYTHONPATH=tests:. python tests/trust/fuzz.py "ply text" --first
17 --count 1`` repeats one case, ``all --count 2000`` in place of the rest looks for more. The last
line printed is a report in JSON.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from trust.fuzzed_readers import READERS
from trust.fuzzing import CANARY, damage

from riemhuman.errors import RiemhumanError

MEMORY = 2**30
"""Bytes of address space beyond what the process has before the first case."""

SECONDS = 2.0
"""Processor time of a case."""

_WALL_SECONDS = 10
# Nothing of this is any reader's business.
_FORBIDDEN = (
    *("os.system", "os.exec", "os.posix_spawn", "os.spawn", "os.fork", "subprocess.Popen"),
    *("pickle.find_class", "socket.connect", "socket.bind", "ctypes.dlopen", "webbrowser.open"),
    *("code.__new__", "shutil.rmtree", "shutil.move", "os.putenv", "os.kill"),
)
_WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


class Watchman:
    """Notes what a reader does that it should not, told by Python's audit events."""

    def __init__(self, room: Path) -> None:
        self.room = str(room)
        self.seen: list[str] = []
        self.awake = False
        sys.addaudithook(self._look)

    def _look(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.awake:
            return
        if event == "pickle.find_class" and _compiler_at_work():
            return
        if event in _FORBIDDEN:
            self.seen.append(f"{event} {arguments!r}"[:200])
        elif (event == "open" and arguments[2] & _WRITING) or event in (
            "os.remove",
            "os.mkdir",
            "os.rmdir",
            "os.truncate",
            "os.chmod",
        ):
            self._inside(event, arguments[0])
        elif event in ("os.rename", "os.link", "os.symlink"):
            self._inside(event, arguments[0])
            self._inside(event, arguments[1])

    def _inside(self, event: str, path: Any) -> None:
        if isinstance(path, int):
            return
        if not os.path.abspath(os.fsdecode(path)).startswith(self.room + os.sep):
            self.seen.append(f"{event} {path!r}")


def _compiler_at_work() -> bool:
    """Return whether Numba is reading its own cache of compiled functions."""
    frame = sys._getframe(2)
    while frame is not None:
        if f"{os.sep}numba{os.sep}" in frame.f_code.co_filename:
            return True
        frame = frame.f_back
    return False


class HangError(BaseException):
    """A case waits for something that does not come."""


def _hang(signum: int, frame: Any) -> None:
    raise HangError(f"no end after {_WALL_SECONDS} s")


def chain(error: BaseException | None) -> list[str]:
    """Return the names of an error and of those it came from."""
    names = []
    while error is not None:
        names.append(type(error).__name__)
        error = error.__cause__ or error.__context__
    return names


def run_case(name: str, seed: int, room: Path, watchman: Watchman) -> tuple[str, str | None]:
    """Return how a case ended, "read" or "refused", and what is wrong with that."""
    reader = READERS[name]
    rng = np.random.default_rng([seed, *name.encode()])
    target = reader.targets[int(rng.integers(len(reader.targets)))]
    for file, content in FILES[name].items():
        (room / file).parent.mkdir(exist_ok=True)
        if file != target:
            (room / file).write_bytes(content)
    content, done = damage(rng, FILES[name][target], reader.mutations)
    (room / target).write_bytes(content)
    end, problem = "refused", None
    began = time.process_time()
    watchman.awake = True
    try:
        signal.alarm(_WALL_SECONDS)
        reader.read(room)
        end = "read"
    except RiemhumanError as error:
        signal.alarm(0)
        if {"MemoryError", "RecursionError"} & set(chain(error)):
            problem = f"{' from '.join(chain(error))}: {error}"
        elif len(str(error)) > 2000:
            problem = f"a message of {len(str(error))} characters: {str(error)[:300]}"
    except (Exception, HangError) as error:  # noqa: BLE001
        signal.alarm(0)
        where = traceback.extract_tb(error.__traceback__)
        place = "; ".join(f"{Path(f.filename).name}:{f.lineno}" for f in where[-4:])
        problem = f"{' from '.join(chain(error))}: {error} at {place}"[:600]
    finally:
        signal.alarm(0)
        watchman.awake = False
    seconds = time.process_time() - began
    if problem is None and seconds > SECONDS:
        problem = f"took {seconds:.2f} s"
    if problem is None and watchman.seen:
        problem = f"did what it should not: {'; '.join(watchman.seen)}"
    if problem is None and (Path(CANARY).exists() or (room / CANARY).exists()):
        problem = "ran what the file says"
    watchman.seen.clear()
    Path(CANARY).unlink(missing_ok=True)
    return end, problem and f"{name!r} --first {seed} ({target}: {done}): {problem}"


def _room_to_grow() -> None:
    """Bound the address space of the process by what it has now and `MEMORY`."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    size = pages * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MEMORY, size + MEMORY))


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("readers", nargs="+", choices=[*READERS, "all"])
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--current", help="file that names the case at work")
    options = parser.parse_args(arguments)
    names = options.readers
    if names == ["all"]:
        names = [name for name in READERS if name != "careless"]

    current = Path(options.current).open("w") if options.current else None  # noqa: SIM115
    home = Path(tempfile.mkdtemp(prefix="fuzz"))
    os.chdir(home)
    room = home / "room"
    watchman = Watchman(room)
    warnings.simplefilter("error")
    signal.signal(signal.SIGALRM, _hang)
    for name in names:
        # A valid file first: it must be read, and what loads at first use is loaded.
        FILES[name] = READERS[name].files()
        room.mkdir()
        for file, content in FILES[name].items():
            (room / file).parent.mkdir(exist_ok=True)
            (room / file).write_bytes(content)
        READERS[name].read(room)
        shutil.rmtree(room)
    _room_to_grow()

    ends = {name: {"read": 0, "refused": 0} for name in names}
    problems, slowest = [], 0.0
    began = time.process_time()
    for name in names:
        for seed in range(options.first, options.first + options.count):
            if current:
                current.seek(0)
                current.write(f"{name!r} --first {seed}".ljust(60))
                current.flush()
            room.mkdir()
            start = time.process_time()
            end, problem = run_case(name, seed, room, watchman)
            slowest = max(slowest, time.process_time() - start)
            shutil.rmtree(room)
            ends[name][end] += 1
            if problem:
                problems.append(problem)
    seconds = time.process_time() - began
    # Not `ru_maxrss`, which a process inherits from the one that started it.
    status = Path("/proc/self/status").read_text().split()
    peak = 1024 * int(status[status.index("VmHWM:") + 1])
    shutil.rmtree(home)
    report = {"seconds": seconds, "slowest": slowest, "peak": peak}
    sys.stdout.write(json.dumps(report | {"ends": ends, "problems": problems}) + "\n")


FILES: dict[str, dict[str, bytes]] = {}

if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        main(sys.argv[1:])
