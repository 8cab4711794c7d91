"""Commands that are killed.

A file or folder that a killed process writes is absent or whole, the old or the new; the
same command then ends as if nothing had happened.
"""

import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.io import save_mesh

ROOT = Path(__file__).parents[2]

# Before the change of a file with a number, the process is killed: changes are counted as Python's
# audit events tell of files opened for writing, renamed or removed, and of folders made or removed.
COMMAND = """
import os, signal, sys
from riemhuman.cli import main

folder, fatal, count = sys.argv[1], int(sys.argv[2]), 0
CHANGES = ("os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate")

def hook(event, arguments):
    global count
    is_write = event == "open" and isinstance(arguments[2], int) and arguments[2] & (
        os.O_WRONLY | os.O_RDWR | os.O_CREAT
    )
    if (is_write or event in CHANGES) and not isinstance(arguments[0], int):
        if os.fsdecode(arguments[0]).startswith(folder):
            count += 1
            if count == fatal:
                os.kill(os.getpid(), signal.SIGKILL)

sys.addaudithook(hook)
code = main(sys.argv[3:])
print(count, file=sys.__stderr__)
sys.exit(code)
"""
FILES = ("matrix", "-o", "D.npz", "--csv", "D.csv", "--resume", "work", "--pose")
OPERATIONS = {"files": FILES, "a folder": ("align", "-o", "aligned")}

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="processes are killed by signals")


def make_inputs(folder, seed):
    """Write meshes of three people in two poses, with their labels."""
    folder.mkdir()
    rows = ["file,subject,pose"]
    for number, points in enumerate(surfaces(sphere_template(), 6, rng=seed, size=0.1)):
        save_mesh(folder / f"body_{number}.ply", points, sphere_template().faces)
        rows.append(f"body_{number}.ply,person {number // 2},pose {number % 2}")
    (folder / "labels.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder


def run(operation, inputs, outputs, fatal=0):
    """Return the exit code, or minus the signal, and the number of changes of files."""
    outputs.mkdir(parents=True, exist_ok=True)
    command, *options = OPERATIONS[operation]
    arguments = [sys.executable, "-c", COMMAND, str(outputs), str(fatal), command, str(inputs)]
    done = subprocess.run(
        [*arguments, *options, "--force", "-q"],
        env=os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"},
        cwd=outputs,
        capture_output=True,
        text=True,
        check=False,
    )
    return done.returncode, int(done.stderr.split()[-1]) if done.returncode == 0 else 0


def content(folder):
    """Return what a user sees: files by name, without hidden ones and those of a job."""
    names = {str(file.relative_to(folder)): file for file in folder.rglob("*") if file.is_file()}
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
@pytest.mark.parametrize("operation", OPERATIONS)
def test_killed_before_changes_of_files(operation, tmp_path):
    inputs = make_inputs(tmp_path / "inputs", 0)
    others = make_inputs(tmp_path / "others", 1)
    code, n_changes = run(operation, inputs, tmp_path / "new")
    assert (code, n_changes >= 4) == (0, True)
    assert run(operation, others, tmp_path / "old")[0] == 0
    shutil.rmtree(tmp_path / "old" / "work", ignore_errors=True)
    old, new = content(tmp_path / "old"), content(tmp_path / "new")
    kills = np.linspace(1, n_changes, 8).astype(int)
    for number, before in zip(kills, 4 * ({}, old), strict=True):
        outputs = tmp_path / f"{number} {len(before)}"
        if before:
            shutil.copytree(tmp_path / "old", outputs)
        assert run(operation, inputs, outputs, fatal=number)[0] == -signal.SIGKILL
        found = content(outputs)
        # Between two renames, an old folder is there under a hidden name alone.
        is_between = not found and list(outputs.glob(".*/*"))
        assert is_old_or_new(found, before, new) or is_between, number
        assert run(operation, inputs, outputs)[0] == 0
        assert content(outputs) == new
