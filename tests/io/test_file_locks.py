"""Locks last as long as their holder, and are taken over from the dead."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from riemhuman.errors import FileError
from riemhuman.io.files import is_at, lock, lock_file

HOLD = """
import sys
from pathlib import Path
from riemhuman.io.files import lock_file
with lock_file(Path(sys.argv[1]), "busy"):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_one_holds_it_and_nothing_is_left(tmp_path):
    file = tmp_path / "a.lock"
    with lock_file(file, "busy with it"):
        with pytest.raises(FileError, match="^busy with it$"), lock_file(file, "busy with it"):
            pass
        assert file.exists()
    assert not file.exists()
    with lock_file(file, "busy"):
        pass


def test_a_dead_process_holds_nothing(tmp_path):
    file = tmp_path / "a.lock"
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(file)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    ) as process:
        assert process.stdout.readline() == b"held\n"
        with pytest.raises(FileError, match="busy"), lock_file(file, "busy"):
            pass
        process.kill()
    assert file.exists()
    with lock_file(file, "busy"):
        pass
    assert not file.exists()


def test_a_lock_that_its_holder_removed_is_made_anew(tmp_path, monkeypatch):
    file = tmp_path / "a.lock"
    opened = []

    def removed_meanwhile(descriptor):
        if not opened:
            file.unlink()
        opened.append(descriptor)
        lock(descriptor)

    monkeypatch.setattr("riemhuman.io.files.lock", removed_meanwhile)
    with lock_file(file, "busy"):
        assert len(opened) == 2
        assert file.exists()


def test_the_file_at_a_path(tmp_path):
    file = tmp_path / "a"
    file.touch()
    found = file.stat()
    assert is_at(found, file)
    os.rename(file, tmp_path / "b")
    assert not is_at(found, file)
    file.symlink_to(tmp_path / "b")
    assert not is_at(found, file)


def test_no_place_for_a_lock(tmp_path):
    with pytest.raises(FileNotFoundError), lock_file(tmp_path / "absent" / "a.lock", "busy"):
        pass
