"""Commands that are killed.

A file or folder that a killed process writes is absent or whole, the old or the new; the
same command then ends as if nothing had happened.
"""

import os
import shutil
import signal
import sys
import tempfile
from itertools import islice, product
from pathlib import Path

import pytest
from faults import OPERATIONS, Processes
from sockets import folder_of_sockets

SUPPORT = Path(__file__).parents[1] / "support"
ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes fork")


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
        name: file.read_bytes()
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
@pytest.mark.parametrize("operation", OPERATIONS)
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
