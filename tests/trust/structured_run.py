"""Runs readers on structured files, changed a little, in a process that may be killed by them.

    PYTHONPATH=.:tests python -m trust.structured_run 100000

reads so many files and says what it found. A reader accepts what its judge accepts, with the same
numbers, or refuses it with an error of the library, though never one in which nothing is changed;
it takes neither two seconds of the processor for a small file nor a gigabyte, and it never ends the
interpreter.
"""

import argparse
import json
import multiprocessing
import resource
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
from trust.structured_files import WRITERS, write
from trust.structured_judges import JUDGES

from riemhuman.errors import RiemhumanError

MOST_SECONDS, MOST_BYTES = 2.0, 2**30
PATIENCE = 60.0


def checked(kind, seed, number, folder):
    """Return what became of a file: accepted, refused, or what is wrong."""
    files, n_changed = write(kind, seed, number)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    read, judge = JUDGES[kind]
    target = folder / next(iter(files))
    memory, started = peak(), time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            found = read(target)
        outcome = "accepted"
    except RiemhumanError as error:
        outcome = "refused" if n_changed else f"refused, though nothing is changed: {error}"
    except Exception:  # noqa: BLE001
        return "untyped: " + traceback.format_exc(limit=-2)
    finally:
        seconds, memory = time.process_time() - started, peak() - memory
    if seconds > MOST_SECONDS:
        return f"slow: {seconds:.1f} s"
    if memory > MOST_BYTES:
        return f"large: {memory / 2**20:.0f} MiB"
    if outcome == "accepted":
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                expected = judge(target)
        except Exception:  # noqa: BLE001
            return "accepted, but the judge refuses: " + traceback.format_exc(limit=-2)
        wrong = difference(found, expected)
        if wrong:
            return f"wrong: {wrong}"
    for name in files:
        (folder / name).unlink()
    return outcome


def difference(found, expected):
    if found.keys() != expected.keys():
        return f"{sorted(found)} in place of {sorted(expected)}"
    for name, array in expected.items():
        array, other = np.asarray(array), np.asarray(found[name])
        same = other.shape == array.shape and np.array_equal(
            other, array, equal_nan=array.dtype.kind in "fc" and other.dtype.kind in "fc"
        )
        if not same:
            return f"{name} is {other!r} in place of {array!r}"
    return None


def peak():
    """Return the most memory this process has had, in bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (
        1 if sys.platform == "darwin" else 1024
    )


def work(connection, kinds, seed, numbers):
    """Check files in a process of its own; each is announced before it is read."""
    with tempfile.TemporaryDirectory() as folder:
        for number in numbers:
            connection.send((number, None))
            kind = kinds[number % len(kinds)]
            outcome = checked(kind, seed, number, Path(folder))
            connection.send((number, outcome))
            if outcome.startswith("large"):
                return  # the most memory that a process has had never becomes less
            for left in Path(folder).iterdir():
                left.unlink()
    connection.send((None, None))


def run(n_files, seed=0, kinds=tuple(WRITERS), report=None):
    """Return what became of files: counts by kind and outcome, and what is wrong.

    Parameters
    ----------
    n_files : int
        How many.
    seed : int
        Where they begin.
    kinds : sequence of str
        Which kinds, in turn.
    report : callable, optional
        Takes the number of files checked, now and then.

    Returns
    -------
    counts : Counter of (str, str)
    wrong : list of (str, int, str)
        Kind, number and what is wrong.
    """
    context = multiprocessing.get_context("fork")
    counts, wrong, first, waiting = Counter(), [], 0, False

    def note(number, outcome):
        kind = kinds[number % len(kinds)]
        counts[kind, outcome.split(":")[0]] += 1
        if outcome not in ("accepted", "refused"):
            wrong.append((kind, number, outcome))

    while first < n_files:
        ours, theirs = context.Pipe(duplex=False)
        worker = context.Process(target=work, args=(theirs, kinds, seed, range(first, n_files)))
        worker.start()
        theirs.close()
        try:
            while ours.poll(PATIENCE):
                number, outcome = ours.recv()
                if number is None:
                    first = n_files
                    break
                first, waiting = number + 1, outcome is None
                if outcome is not None:
                    note(number, outcome)
                    if report is not None and number % 1000 == 999:
                        report(number + 1)
            else:
                worker.kill()
                note(first - 1, f"hangs: more than {PATIENCE:g} s")
        except EOFError:
            worker.join()
            if waiting:
                note(first - 1, f"ends the interpreter: exit code {worker.exitcode}")
        worker.join()
    return counts, wrong


def main():
    parser = argparse.ArgumentParser(description="Read structured files that are a little wrong.")
    parser.add_argument("n_files", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", action="append", choices=list(WRITERS))
    options = parser.parse_args()
    started = time.perf_counter()

    def report(number):
        seconds = time.perf_counter() - started
        sys.stderr.write(f"{number} files, {number / seconds:.0f} a second\n")

    counts, wrong = run(options.n_files, options.seed, options.kind or tuple(WRITERS), report)
    for kind in options.kind or WRITERS:
        outcomes = {name: n for (of, name), n in sorted(counts.items()) if of == kind}
        sys.stdout.write(f"{kind}: {json.dumps(outcomes)}\n")
    for kind, number, what in wrong[:50]:
        sys.stdout.write(f"\n{kind}, file {number}: {what}\n")
    sys.stdout.write(f"{sum(counts.values())} files, {len(wrong)} of them wrong\n")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
