"""Files and folders are written atomically; outputs are checked before the work begins."""

import errno
import os
import stat
import subprocess
import sys
import zlib
from pathlib import Path

import filelock
import numpy as np
import pytest

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileError, FileFormatError, OutOfMemoryError
from riemhuman.io.files import (
    atomic_file,
    file_path,
    format_errors,
    json_value,
    lock_file,
    read_bytes,
    read_text,
    short_message,
    visible_files,
    write_text,
)

HOLD = """
import sys
from pathlib import Path
from riemhuman.io.files import lock_file
with lock_file(Path(sys.argv[1]), "busy"):
    print("locked", flush=True)
    sys.stdin.read()
"""


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


def test_hidden_files_are_left_out(tmp_path):
    for name in (
        "b.npz",
        "a.NPZ",
        "a.txt",
        "._a.npz",
        "in/c.npz",
        ".git/d.npz",
        ".b.part.npz/b.npz",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    names = [file.name for file in visible_files(tmp_path, ".npz")]
    assert names == ["a.NPZ", "b.npz"]
    deep = [file.name for file in visible_files(tmp_path, ".npz", deep=True)]
    assert sorted(deep) == ["a.NPZ", "b.npz", "c.npz"]


def test_brackets_that_nest_too_deep_are_refused(tmp_path):
    """Before Python's stack ends, as in every reader of JSON."""
    text = "[" * 50_000 + "]" * 50_000
    with pytest.raises(FileFormatError, match=r"a\.json: damaged.* nest too deep") as refused:
        read_nested(tmp_path / "a.json", text)
    assert not isinstance(refused.value.__cause__.__context__, RecursionError)
    assert json_value('{"a": [1, "b"]}') == {"a": [1, "b"]}


def read_nested(file, text):
    with format_errors(file, "a document"):
        json_value(text)


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


def test_a_folder_without_locks(tmp_path, monkeypatch):
    def acquire(lock, **options):
        raise NotImplementedError("use another lock")

    monkeypatch.setattr(filelock.FileLock, "acquire", acquire)
    file = tmp_path / "a.lock"
    with pytest.raises(FileError, match="cannot be locked: use another"), lock_file(file, "busy"):
        pass


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


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (MemoryError(), "too little memory$"),
        (MemoryError("Unable to allocate 8.00 GiB"), "too little memory: Unable to allocate 8"),
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
        assert "too little memory" in found


def test_names_that_the_file_system_cannot_hold():
    with pytest.raises(FileError, match=r"found '\\ud800', a name that the file system cannot"):
        file_path("\ud800")
