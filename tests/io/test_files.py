"""Files and folders are written atomically; outputs are checked before the work begins."""

import errno
import json
import os
import re
import stat
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileError, FileFormatError, OutOfMemoryError
from riemhuman.io.files import (
    atomic_file,
    format_errors,
    lock_file,
    read_bytes,
    read_text,
    short_message,
    write_text,
)
from riemhuman.io.outputs import (
    atomic_folder,
    check_output_file,
    check_output_folder,
)
from riemhuman.io.text_tables import csv_cell, read_named_rows, read_rows

HOLD = """
import sys
from pathlib import Path
from riemhuman.io.files import lock_file
with lock_file(Path(sys.argv[1]), "busy"):
    print("locked", flush=True)
    sys.stdin.read()
"""


def is_ours(name):
    return name.startswith("time_")


def write_half(file, error):
    """Begin to write a file, and fail."""
    with atomic_file(file) as temporary:
        temporary.write_text("half")
        raise error


def test_a_file_is_replaced(tmp_path):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with atomic_file(file) as temporary:
        assert temporary.suffix == ".txt"
        temporary.write_text("new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("error", "expected", "message"),
    [
        (ArgumentError("wrong"), ArgumentError, "wrong"),
        (KeyboardInterrupt(), KeyboardInterrupt, None),
        (BrokenPipeError(), BrokenPipeError, None),
        (FileError("another file"), FileError, "^another file"),
        (OSError(28, "No space left on device"), FileError, r"a\.txt cannot be written: No space"),
        (OSError("4 written"), FileError, r"a\.txt cannot be written: 4 written"),
    ],
)
def test_what_fails_leaves_the_old_file(tmp_path, error, expected, message):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(expected, match=message):
        write_half(file, error)
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_places_where_no_file_can_be_written(tmp_path):
    for place in (tmp_path / "b" / "a", tmp_path, Path(os.devnull)):
        with pytest.raises(FileError, match="cannot be written"):
            write_text(place, "text")


@pytest.mark.skipif(os.name == "nt", reason="permissions are others there")
def test_permissions_and_links(tmp_path):
    file, link = tmp_path / "a.txt", tmp_path / "link.txt"
    for mode in (0o600, 0o644, 0o400):
        file.unlink(missing_ok=True)
        file.touch()
        file.chmod(mode)
        write_text(file, "new")
        assert stat.S_IMODE(file.stat().st_mode) == mode
    (tmp_path / "plain").touch()
    write_text(tmp_path / "new.txt", "text")
    assert (tmp_path / "new.txt").stat().st_mode == (tmp_path / "plain").stat().st_mode
    link.symlink_to(file)
    write_text(link, "through the link")
    assert link.is_symlink()
    assert file.read_text() == "through the link"


def test_only_regular_files_are_read(tmp_path):
    (tmp_path / "text").write_bytes(b"\xef\xbb\xbfZo\xc3\xab")
    assert read_text(tmp_path / "text") == "Zoë"
    (tmp_path / "latin").write_bytes(b"Zo\xeb")
    with pytest.raises(FileFormatError, match="is not text in UTF-8"):
        read_text(tmp_path / "latin")
    os.mkfifo(tmp_path / "pipe")
    for place, message in [
        (tmp_path, "it is a folder"),
        (tmp_path / "pipe", "it is a device or a pipe"),
        (Path("/dev/zero"), "it is a device or a pipe"),
        (tmp_path / "none", "there is no file .*none"),
    ]:
        with pytest.raises(FileError, match=message):
            read_bytes(place)
    os.mkfifo(tmp_path / "pipe.ply")  # opening it would wait for a writer
    with pytest.raises(FileError, match="it is a device or a pipe"):
        rh.io.is_registered_scan(tmp_path / "pipe.ply")
    assert len(short_message(ValueError("x" * 9999))) == 300


def test_a_lock_is_for_one_process(tmp_path):
    file = tmp_path / "a.lock"
    with lock_file(file, "busy with it"):
        with pytest.raises(FileError, match="^busy with it$"), lock_file(file, "busy with it"):
            pass
        assert file.exists()
    assert not file.exists()
    with subprocess.Popen(
        [sys.executable, "-c", HOLD, str(file)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        cwd=Path(__file__).parents[2],
    ) as process:
        assert process.stdout.readline() == b"locked\n"
        with pytest.raises(FileError, match="busy"), lock_file(file, "busy"):
            pass
        process.kill()
    # The lock of a process that was killed is free, although its file is left.
    assert file.exists()
    with lock_file(file, "busy"):
        pass
    assert not file.exists()


def test_files_that_can_be_written(tmp_path, monkeypatch):
    check_output_file(tmp_path / "new.npz", [".npz"], force=False)
    (tmp_path / "old.NPZ").touch()
    check_output_file(tmp_path / "old.NPZ", [".npz"], force=True)
    monkeypatch.chdir(tmp_path)
    check_output_file(Path("here.npz"), [".npz"], force=False)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(FileError, match="no permission in .*; name another place"):
        check_output_file(tmp_path / "new.npz", [".npz"], force=True)
    with pytest.raises(FileError, match="no permission in"):
        check_output_folder(tmp_path / "new", is_ours, force=True)


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("new", FileFormatError, "ending must be .npz; found none"),
        ("new.txt", FileFormatError, "ending must be .npz; found '.txt'"),
        ("old.npz", FileError, "exists; --force replaces it"),
        ("link.npz", FileError, "exists; --force replaces it"),
        ("folder.npz", FileError, "is a folder"),
        ("absent/new.npz", FileError, "make it first: mkdir -p '.*absent'"),
        ("old.npz/new.npz", FileError, "old.npz is a file, not a folder"),
    ],
)
def test_files_that_cannot_be_written(tmp_path, name, error, message):
    (tmp_path / "old.npz").touch()
    (tmp_path / "folder.npz").mkdir()
    os.symlink(tmp_path / "nowhere", tmp_path / "link.npz")
    with pytest.raises(error, match=message):
        check_output_file(tmp_path / name, [".npz"], force=False)


def test_folders(tmp_path):
    old = tmp_path / "old"
    check_output_folder(tmp_path / "new", is_ours, force=False)
    old.mkdir()
    check_output_folder(old, is_ours, force=False)
    (old / "time_0.ply").touch()
    check_output_folder(old, is_ours, force=True)
    with pytest.raises(FileError, match="holds an earlier result; --force"):
        check_output_folder(old, is_ours, force=False)
    with pytest.raises(FileError, match="is a file; name a folder"):
        check_output_folder(old / "time_0.ply", is_ours, force=True)
    for add in (
        lambda: (old / "thesis.tex").touch(),
        lambda: (old / "time_1.ply").mkdir(),
        lambda: (old / "time_1.ply").symlink_to(old / "time_0.ply"),
    ):
        add()
        with pytest.raises(FileError, match=r"holds something else"):
            check_output_folder(old, is_ours, force=True)
        for entry in old.iterdir():
            entry.rmdir() if entry.is_dir() else entry.unlink()
    (tmp_path / "link").symlink_to(old)
    with pytest.raises(FileError, match="link is a link"):
        check_output_folder(tmp_path / "link", is_ours, force=True)


def test_a_folder_is_replaced_as_a_whole(tmp_path):
    path = tmp_path / "path"
    for content in ("first", "second"):
        with atomic_folder(path, is_ours) as temporary:
            (temporary / "time_0").write_text(content)
            assert content == "first" or (path / "time_0").read_text() == "first"
        assert (path / "time_0").read_text() == content
        path.chmod(0o700)

    def fail(error):
        with atomic_folder(path, is_ours) as temporary:
            (temporary / "time_0").write_text("half")
            raise error

    for error, expected in (
        (KeyboardInterrupt(), KeyboardInterrupt),
        (BrokenPipeError(), BrokenPipeError),
        (OSError(28, "No space left on device"), FileError),
    ):
        with pytest.raises(expected):
            fail(error)
        assert (path / "time_0").read_text() == "second"
        assert list(tmp_path.iterdir()) == [path]
    with atomic_folder(path, is_ours) as temporary:
        (temporary / "time_1").touch()
    assert os.listdir(path) == ["time_1"]
    with pytest.raises(FileError, match=r"something else \(thesis"), atomic_folder(path, is_ours):
        (path / "thesis.tex").touch()  # by somebody else, meanwhile
    assert sorted(os.listdir(path)) == ["thesis.tex", "time_1"]
    assert stat.S_IMODE(path.stat().st_mode) == 0o700


WRITE = """
import sys
from pathlib import Path
from riemhuman.io.outputs import atomic_folder
with atomic_folder(Path(sys.argv[1]), lambda name: True) as temporary:
    (temporary / "time_0").touch()
    print("begun", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("other", ["path", "other"])
def test_what_a_killed_writer_left_is_removed(tmp_path, other):
    """By the next writer of this folder or of one beside it, and not while the writer lives."""
    command = [sys.executable, "-c", WRITE, str(tmp_path / "path")]
    writer = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert writer.stdout.readline() == "begun\n"
    (hidden,) = (place for place in tmp_path.iterdir() if place.is_dir())
    with atomic_folder(tmp_path / "first", is_ours) as temporary:
        (temporary / "time_0").touch()
    assert (hidden / "time_0").exists()
    writer.kill()
    writer.communicate()
    assert hidden.exists()
    with (
        pytest.warns(UserWarning, match=f"killed process had left: {re.escape(hidden.name)}"),
        atomic_folder(tmp_path / other, is_ours) as temporary,
    ):
        (temporary / "time_0").touch()
    assert {place.name for place in tmp_path.iterdir()} == {"first", other}


def test_a_folder_that_was_to_be_replaced_is_put_back(tmp_path):
    """Where the writer was killed between two renames."""
    path, hidden = tmp_path / "path", tmp_path / ".path.0123abcd.part"
    for place in (hidden, tmp_path / f"{hidden.name}.replaced"):
        place.mkdir()
        (place / "time_0").write_text(place.suffix)
    (tmp_path / f"{hidden.name}.lock").touch()
    thesis = tmp_path / ".thesis.part.lock"
    thesis.touch()
    with (
        pytest.raises(KeyboardInterrupt),
        pytest.warns(UserWarning, match="killed"),
        atomic_folder(path, is_ours),
    ):
        raise KeyboardInterrupt
    assert {place.name for place in tmp_path.iterdir()} == {"path", thesis.name}
    assert (path / "time_0").read_text() == ".replaced"


def test_a_folder_that_cannot_be_renamed_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "path"
    path.mkdir()
    (path / "time_0").touch()
    rename = os.rename

    def refuse_new(source, target):
        if target == path and (source / "time_1").exists():
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refuse_new)
    with pytest.raises(FileError, match="No space left"), atomic_folder(path, is_ours) as temporary:
        (temporary / "time_1").touch()
    assert os.listdir(path) == ["time_0"]
    assert list(tmp_path.iterdir()) == [path]


def test_cells_are_one_line_and_no_formulas():
    for text, expected in [
        ("Zoë 1.ply", "Zoë 1.ply"),
        ("=cmd|'/c calc'!A1", "'=cmd|'/c calc'!A1"),
        ("-1", "'-1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        ("\t=1", "' =1"),
        ("two\nlines\r\n", "two lines  "),
        ("two\u2028lines", "two lines"),
        ("\udcff.ply", "\\udcff.ply"),
        ("", ""),
    ]:
        assert csv_cell(text) == expected


def test_named_rows(tmp_path):
    file = tmp_path / "rows.csv"
    file.write_text("Name, x, y\nanna, 1, 2\n\nbert,3,-4e1\n")
    rows = read_named_rows(file, "name")
    assert {name: row.tolist() for name, row in rows.items()} == {"anna": [1, 2], "bert": [3, -40]}
    for text, message in [
        ("", "holds no rows"),
        ("a,1\na,2\n", "line 2: the name 'a' is repeated"),
        ("a,1\n,2\n", "line 2: the name is missing"),
        ("a,1\nb,2,3\n", "line 2: 2 numbers found, 1 expected"),
        ("a,1\nb,two\n", "line 2: 'two' is not a number"),
        ('a,"1\n', "line 1"),
    ]:
        file.write_text(text)
        with pytest.raises(FileFormatError, match=message):
            read_named_rows(file, "name")


@pytest.mark.parametrize(
    ("name", "message"), [("a" * 300, "300 bytes"), ("ä" * 150, "300 bytes"), ("a\0b", "null char")]
)
def test_names_that_no_file_has_are_refused(tmp_path, name, message):
    place = str(tmp_path / name)
    bodies = rh.datasets.load_open_bodies("coarse")
    for function in (
        lambda: rh.load_mesh(f"{place}.ply"),
        lambda: rh.save_mesh(f"{place}.ply", bodies[0], bodies.template.faces),
        lambda: rh.save_glb(f"{place}.glb", bodies.points[:1], bodies.template.faces),
        lambda: rh.datasets.load_bodies(place),
        lambda: rh.datasets.load_faust(place),
        lambda: rh.datasets.read_labels(place, ["a"]),
        lambda: rh.datasets.load_amass(place),
        lambda: rh.datasets.load_mesh_motions(place),
        lambda: bodies.save(f"{place}.npz"),
    ):
        with pytest.raises(FileError, match=message.replace("300", r"\d+")):
            function()


def test_nested_brackets_in_measurements_are_refused(tmp_path):
    file = tmp_path / "set.json"
    file.write_text("[" * 50_000 + "]" * 50_000, encoding="utf-8")
    model = rh.datasets.load_open_model("coarse")
    with pytest.raises(FileFormatError, match=r"set\.json does not hold measurements"):
        rh.measurements.MeasurementSet.load(file, model)


def test_cells_longer_than_readers_take_are_refused(tmp_path):
    file = tmp_path / "labels.csv"
    file.write_text(f"file,subject,pose\na.ply,{'x' * 200_000},b\n")
    for read in (read_rows, lambda file: read_named_rows(file, "name")):
        with pytest.raises(FileFormatError, match=r"labels\.csv, line 2: field larger than"):
            read(file)


@pytest.mark.parametrize("digits", ["1e400", "9" * 400, "-1" + "0" * 30])
def test_absurd_numbers_in_measurements_are_refused(tmp_path, digits):
    model = rh.datasets.load_open_model("coarse")
    definitions = rh.measurements.Measurements(model).definitions
    definitions.with_measurements(["stature"]).save(tmp_path / "set.json")
    record = json.loads((tmp_path / "set.json").read_text())
    record["parts"] = {"arm": [["absurd", "absurd"]]}
    text = json.dumps(record).replace('"absurd"', digits)
    (tmp_path / "set.json").write_text(text)
    with pytest.raises(FileFormatError, match=r"set\.json does not hold measurements"):
        rh.measurements.MeasurementSet.load(tmp_path / "set.json", model)


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (MemoryError(), "memory is short$"),
        (MemoryError("Unable to allocate 8.00 GiB"), "memory is short: Unable to allocate 8"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "Cannot allocate memory"),
        (ImportError("x.so: failed to map segment from shared object"), "failed to map"),
        (zlib.error("Error -4 while decompressing data"), "Error -4"),
    ],
)
def test_too_little_memory_is_no_damage(tmp_path, error, message):
    file = tmp_path / "a.ply"
    file.write_bytes(bytes(2000))

    def parse(caught):
        with format_errors(file, "a mesh"):
            raise FileFormatError("a parser calls it damaged") from caught

    def fail(error):
        with format_errors(file, "a mesh"):
            raise error

    with pytest.raises(OutOfMemoryError, match=f"a.ply of 2,000 bytes .*{message}"):
        fail(error)
    with pytest.raises(OutOfMemoryError, match=message):
        parse(error)
    with pytest.raises(FileFormatError, match="damaged, or not a mesh"):
        fail(ValueError("'out of memory' is what the file says"))


_LITTLE_MEMORY = """
import resource, sys, zipfile
from pathlib import Path
import riemhuman as rh

folder, left = Path(sys.argv[1]), 2**22
readers = {
    "ply": rh.load_mesh, "obj": rh.load_mesh, "off": rh.load_mesh, "glb": rh.load_mesh,
    "npz": lambda file: rh.io.load_arrays(file, ["a"]), "csv": rh.registration.load_landmarks,
}
for name in ("small", "large"):
    for suffix, read in readers.items():
        if name == "large":
            used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
            resource.setrlimit(resource.RLIMIT_AS, (used + left, -1))
        try:
            read(folder / f"{name}.{suffix}")
            found = "read"
        except Exception as error:
            found = f"{type(error).__name__}: {error}"
        resource.setrlimit(resource.RLIMIT_AS, (-1, -1))
        print(name, suffix, found)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="needs a limit of memory")
def test_sound_files_with_little_memory_left(tmp_path):
    rng = np.random.default_rng(0)
    for name, size in (("small", 100), ("large", 100_000)):
        mesh = rng.standard_normal((size, 3)), rng.integers(0, size, (2 * size, 3))
        for suffix in ("ply", "obj", "off", "glb"):
            rh.save_mesh(tmp_path / f"{name}.{suffix}", *mesh)
        rh.io.save_arrays(tmp_path / f"{name}.npz", {"a": rng.standard_normal((10 * size, 3))})
        rows = "".join(f"a{k},{k},1.5,2.5\n" for k in range(2 * size))
        (tmp_path / f"{name}.csv").write_text(rows)
    command = [sys.executable, "-c", _LITTLE_MEMORY, str(tmp_path)]
    finished = subprocess.run(command, capture_output=True, text=True)
    assert finished.returncode == 0, finished.stderr
    lines = finished.stdout.splitlines()
    assert [line.split()[-1] for line in lines[:6]] == ["read"] * 6
    for line in lines[6:]:
        _, suffix, found = line.split(" ", 2)
        assert found.startswith("OutOfMemoryError: "), line
        assert f"large.{suffix} of " in found
        assert "memory is short" in found
