"""Commands that are killed, run twice at once, out of space, or beside what never ends.

A file or folder that a killed process writes is absent or whole, the old or the new; the
same command then ends as if nothing had happened.
"""

import os
import re
import shutil
import signal
import sys
import tempfile
import time
from contextlib import ExitStack
from itertools import islice, product
from pathlib import Path

import numpy as np
import pytest
from faults import OPERATIONS, Processes, small_disk
from sockets import folder_of_sockets

SUPPORT = Path(__file__).parents[1] / "support"
ROOT = Path(__file__).parents[2]

# Others write their files by the same functions; they are tried at night.
EVERYDAY = ("resumable_matrix", "align")
each_operation = pytest.mark.parametrize(
    "operation",
    [
        name if name in EVERYDAY else pytest.param(name, marks=pytest.mark.slow)
        for name in OPERATIONS
    ],
)

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="processes fork, and the sizes of files are limited"
)


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patches:
        # The server imports the tests and the library by itself.
        patches.setenv("PYTHONPATH", os.pathsep.join([str(SUPPORT), str(ROOT)]))
        for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
            patches.setenv(name, "1")
        patches.setattr(tempfile, "tempdir", folder_of_sockets())
        yield Processes(tmp_path_factory.mktemp("server"))


@pytest.fixture(scope="module")
def undisturbed(server, tmp_path_factory):
    """Return a function for what an operation writes without faults, and its number of changes."""
    known = {}

    def run(operation, inputs):
        if (operation, inputs) not in known:
            outputs = tmp_path_factory.mktemp(operation)
            code, said, n_changes = server.run(operation, outputs, inputs=inputs)
            assert code == 0, said
            known[operation, inputs] = content(outputs), n_changes
        return known[operation, inputs]

    return run


def content(folder):
    """Return what a user sees: files by name, without hidden ones and those of a job."""
    files = (file for file in sorted(folder.rglob("*")) if file.is_file())
    names = {str(file.relative_to(folder)): file for file in files}
    return {
        # A geodesic says how long it took.
        name: re.sub(rb'"seconds": [0-9.e-]+', b'"seconds": 0', file.read_bytes())
        for name, file in names.items()
        if not any(part.startswith(".") for part in name.split("/"))
        and not name.startswith("work/")
    }


def is_old_or_new(found, old, new):
    """Return whether files are whole, and those below one folder all old or all new."""
    groups = {}
    for name in {*found, *old, *new}:
        groups.setdefault(name.split("/")[0], []).append(name)
    return all(
        any(all(found.get(name) == state.get(name) for name in names) for state in (old, new))
        for names in groups.values()
    )


@pytest.mark.slow
@pytest.mark.everyday("resumable_matrix-19")
@pytest.mark.parametrize("step", [19, 1])
@each_operation
def test_killed_before_every_change_of_a_file(server, undisturbed, operation, step, tmp_path):
    new, n_changes = undisturbed(operation, server.inputs)
    old, _ = undisturbed(operation, server.others)
    assert n_changes >= 4
    assert server.run(operation, tmp_path / "old", inputs=server.others)[0] == 0
    shutil.rmtree(tmp_path / "old" / "work", ignore_errors=True)
    # Replacing a result takes a few changes more.
    # An odd step: changes of new files and of old ones in turn.
    kills = islice(product(range(1, n_changes + 6), ({}, old)), n_changes % step, None, step)
    for change, before in kills:
        outputs = tmp_path / f"{change} {len(before)}"
        if before:
            shutil.copytree(tmp_path / "old", outputs)
        code, *_ = server.run(operation, outputs, kill_at=change)
        assert code == -signal.SIGKILL or change > n_changes
        found = content(outputs)
        # Between two renames, an old folder is there under a hidden name alone.
        is_between = not found and list(outputs.glob(".*/*"))
        assert is_old_or_new(found, before, new) or is_between, change
        code, said, _ = server.run(operation, outputs)
        assert code == 0, said
        assert content(outputs) == new
        shutil.rmtree(outputs)


@pytest.mark.slow
@each_operation
def test_two_at_once(server, undisturbed, operation, tmp_path):
    answers = server.race(operation, tmp_path, 2)
    winner, loser = sorted(answers)
    assert winner[0] == 0, answers
    if operation == "resumable_matrix":
        assert re.search(rf"{re.escape(str(tmp_path))}\S* is in use: another process", loser[1])
    assert content(tmp_path) == undisturbed(operation, server.inputs)[0]


@pytest.mark.slow
@pytest.mark.parametrize("operation", OPERATIONS)
def test_killed_at_random_moments(server, undisturbed, operation, tmp_path):
    new, _ = undisturbed(operation, server.inputs)
    moments, n_killed = np.random.default_rng(52).uniform(0.0, 1.0, 15), 0
    start = time.perf_counter()
    assert server.run(operation, tmp_path / "whole")[0] == 0
    duration = time.perf_counter() - start
    for number, moment in enumerate(moments):
        outputs = tmp_path / str(number)
        code, said, _ = server.run(operation, outputs, kill_after=moment * duration)
        assert code in (0, -signal.SIGKILL), said
        n_killed += code != 0
        assert is_old_or_new(content(outputs), {}, new), moment
        code, said, _ = server.run(operation, outputs)
        assert code == 0, said
        assert content(outputs) == new
    sys.stdout.write(f"{operation}: {n_killed} of {len(moments)} runs killed; whole or no files\n")


@pytest.mark.slow
@pytest.mark.parametrize("operation", OPERATIONS)
def test_full_disks(server, undisturbed, operation, tmp_path):
    new, _ = undisturbed(operation, server.inputs)
    largest, n_refused = max(map(len, new.values())), 0
    # What the process says is in a file, too, of less than a thousand bytes.
    limits = {1000, *(max(1000, int(share * largest)) for share in (0.5, 0.9)), largest - 1}
    for limit in limits:
        outputs = tmp_path / str(limit)
        code, said, _ = server.run(operation, outputs, largest_file=limit)
        assert code in (0, 2), said
        n_refused += code != 0
        assert content(outputs) == (new if code == 0 else {}), (limit, said)
        assert code == 0 or "File too large" in said, said
        assert "Traceback" not in said
        assert "unexpected" not in said
        code, said, _ = server.run(operation, outputs)
        assert code == 0, said
        assert content(outputs) == new
    assert n_refused > 0
    sys.stdout.write(
        f"{operation}: {n_refused} of {len(limits)} full disks said; no partial files\n"
    )


@pytest.mark.slow
@pytest.mark.parametrize("operation", OPERATIONS)
def test_small_disks(server, undisturbed, operation, tmp_path):
    """Where this process may mount one; the sizes of files are limited everywhere, see above."""
    new, _ = undisturbed(operation, server.inputs)
    needed, n_refused, place = sum(map(len, new.values())), 0, tmp_path / "disk"
    for n_bytes in (0, needed // 2, needed):
        try:
            disk = ExitStack()
            enlarge = disk.enter_context(small_disk(place, n_bytes + 4096))
        except OSError as error:
            pytest.skip(str(error))
        with disk:
            (place / "another").write_bytes(bytes(4096))  # the smallest disk is full
            code, said, _ = server.run(operation, place / "out")
            assert code in (0, 2), said
            n_refused += code != 0
            assert content(place / "out") == (new if code == 0 else {}), (n_bytes, said)
            assert code == 0 or "No space left on device" in said, said
            assert "unexpected" not in said
            enlarge(2**26)
            code, said, _ = server.run(operation, place / "out")
            assert code == 0, said
            assert content(place / "out") == new
    assert n_refused > 0
    sys.stdout.write(f"{operation}: {n_refused} of 3 small disks said; no partial files\n")


# Operations take less than a second; what takes longer waits for something that does not come.
_HANGS = 300


@pytest.mark.slow
@pytest.mark.parametrize("operation", OPERATIONS)
def test_nothing_waits_for_a_process_that_stands_still(server, undisturbed, operation, tmp_path):
    new, n_changes = undisturbed(operation, server.inputs)
    n_refused = 0
    for stop_at in sorted({1, 2, n_changes // 2, n_changes - 1, n_changes}):
        outputs = tmp_path / str(stop_at)
        second, first = server.run_beside_stopped(operation, outputs, stop_at, _HANGS)
        for code, said, _ in (second, first):
            assert code in (0, 2), (stop_at, code, said)
            assert "Traceback" not in said
            assert "unexpected" not in said
        assert 0 in (first[0], second[0]), (first, second)
        n_refused += second[0] != 0
        assert content(outputs) == new, stop_at
    sys.stdout.write(f"{operation}: nothing hangs, {n_refused} runs refused what was in use\n")


@pytest.mark.slow
@pytest.mark.parametrize("operation", OPERATIONS)
def test_files_that_never_end_are_refused(server, operation, tmp_path):
    inputs = tmp_path / "inputs"
    shutil.copytree(server.inputs, inputs)
    (inputs / "body_1.ply").unlink()
    os.mkfifo(inputs / "body_1.ply")
    code, said, _ = server.run(operation, tmp_path / "out", inputs=inputs, kill_after=_HANGS)
    assert code == 2, said
    assert "body_1.ply cannot be read: it is a device or a pipe" in said
    assert content(tmp_path / "out") == {}
