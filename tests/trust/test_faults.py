"""No lost work: killed, without room, on read-only folders, twice at once, with a mad clock.

What a killed or failing process leaves under the name it writes to is absent or whole, the old or
the new; the same command then ends as if nothing had happened, and clears away what was left.
"""

import csv
import io
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from lengths import FULL, sample
from trust.faults import Server

from riemhuman.report._storage import open_folder

pytestmark = pytest.mark.skipif(
    sys.platform != "linux", reason="processes fork, and the sizes of files are limited"
)

# One of every kind of writer; the report, which takes seconds, has tests of its own.
WRITERS = (
    *("matrix", "basis", "geodesic", "components", "mean", "transfer"),
    *("convert_model", "neighbors"),
)
# Where a run takes long, one change of three will do.
STRIDES = {"components": 3}
_TIMES = re.compile(r'"(\w*seconds\w*|started|finished|reused)": [^,\n}]+')


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    server = Server(tmp_path_factory.mktemp("server"))
    yield server
    server.close()
    n_killed = sum(number for code, number in server.ends.items() if code < 0)
    sys.stdout.write(
        f"\n{server.ends.total()} runs: {n_killed} killed, {server.ends[0]} finished, "
        f"{server.ends[2]} refused\n"
    )


def content(folder):
    """Return the content of all files below a folder by their names, without times."""
    files = (file for file in sorted(folder.rglob("*")) if file.is_file())
    return {str(file.relative_to(folder)): _timeless(file) for file in files}


def _timeless(file):
    data = file.read_bytes()
    if file.suffix == ".json":
        return _TIMES.sub("", data.decode())
    if file.name == "index.html":
        return re.sub(rb"[\d.]+", b"", data)  # its numbers are those of the tables
    if file.suffix == ".csv" and b"seconds" in data:
        rows = list(csv.DictReader(io.StringIO(data.decode())))
        return [{key: row[key] for key in row if "seconds" not in key} for row in rows]
    if file.suffix == ".npz" and b"about.npy" in data:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            about = _TIMES.sub("", str(archive["about"]))
            arrays = {name: archive[name].tobytes() for name in archive.files if name != "about"}
        return about, arrays
    return data


def visible(found):
    """Return what somebody sees who looks at the results: neither hidden files nor a job's."""
    return {
        name: data
        for name, data in found.items()
        if not any(part.startswith(".") for part in name.split("/"))
        and not name.startswith("work/")
    }


@pytest.fixture(scope="module")
def undisturbed(server, tmp_path_factory):
    """Return a function that gives what an operation writes if all is well, from either inputs."""
    known = {}

    def run(operation, inputs):
        if (operation, inputs) not in known:
            outputs = tmp_path_factory.mktemp(operation)
            finished = server.run(operation, outputs, inputs=inputs)
            assert finished["code"] == 0, finished
            known[operation, inputs] = content(outputs), finished["changes"]
        return known[operation, inputs]

    return run


def is_old_or_new(found, old, new):
    """Tell whether files are whole, and those below one folder all old or all new."""
    groups = {}
    for name in {*found, *old, *new}:
        groups.setdefault(name.split("/")[0], []).append(name)
    return all(
        any(all(found.get(name) == state.get(name) for name in names) for state in (old, new))
        for names in groups.values()
    )


def hidden(found):
    return [name for name in found if any(part.startswith(".") for part in name.split("/"))]


@pytest.mark.parametrize("operation", WRITERS)
def test_killed_before_every_change_of_a_file(server, undisturbed, operation, tmp_path):
    expected = {inputs: undisturbed(operation, inputs) for inputs in (server.inputs, server.others)}
    old = {}
    n_changes = max(n_changes for _, n_changes in expected.values())
    assert n_changes >= 4
    # Replacing what is there takes a few changes more.
    for change in sample(range(1, n_changes + 6, STRIDES.get(operation, 1)), 8, first=2):
        inputs = (server.inputs, server.others)[change % 2]
        new = expected[inputs][0]
        states = {tmp_path / "old": old}
        if change % 3 == 0:
            states[tmp_path / f"new {change}"] = {}
        for outputs, before in states.items():
            killed = server.run(operation, outputs, inputs=inputs, kill_at=change)
            assert killed["code"] == -signal.SIGKILL or change > n_changes
            assert is_old_or_new(visible(content(outputs)), before, new), change
            assert len({name.split("/")[0] for name in hidden(content(outputs))}) <= 2
        outputs = tmp_path / "old"
        again = server.run(operation, outputs, inputs=inputs)
        assert again["code"] == 0, again
        assert content(outputs) == new
        old = new


@pytest.mark.sampled(3)
@pytest.mark.parametrize("operation", WRITERS)
def test_no_room_for_a_file(server, undisturbed, operation, tmp_path):
    old, _ = undisturbed(operation, server.others)
    new, _ = undisturbed(operation, server.inputs)
    largest = max(len(data) for data in new.values())
    assert server.run(operation, tmp_path, inputs=server.others)["code"] == 0
    for room in sample((1, largest // 2, largest - 1), 3, first=1):
        # Killed in the middle of a write.
        killed = server.run(operation, tmp_path, room=room, fatal_room=True)
        assert killed["code"] == -signal.SIGXFSZ
        assert is_old_or_new(visible(content(tmp_path)), old, new)
        # Told that there is no room.
        refused = server.run(operation, tmp_path, room=room)
        assert_refused(refused, tmp_path, "File too large")
        assert is_old_or_new(content(tmp_path), old, new)
    assert server.run(operation, tmp_path)["code"] == 0
    assert content(tmp_path) == new


def assert_refused(finished, outputs, reason):
    """See that a command ended with one line that names what it could not write, and why."""
    assert finished["code"] == 2, finished
    (line,) = finished["err"].splitlines()
    assert re.match(rf"riemhuman: {re.escape(str(outputs))}.*{reason}", line)
    assert "None" not in line
    assert "unexpected" not in line


@pytest.fixture
def small_disk(tmp_path):
    """Return a file system of a megabyte, and a function that fills it."""
    disk = tmp_path / "disk"
    disk.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "riemhuman", str(disk)]
    if shutil.which("mount") is None or subprocess.run(command, capture_output=True).returncode:
        pytest.skip("file systems may not be mounted here")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


def fill(disk, n_free):
    """Leave so many bytes of a small disk."""
    with (disk / "filler").open("wb") as stream:
        stream.truncate(0)
        stream.write(bytes(shutil.disk_usage(disk).free - n_free))


@pytest.mark.parametrize("operation", [*WRITERS, "resumable_matrix", "report"])
def test_a_full_disk(server, undisturbed, small_disk, operation):
    outputs = small_disk / "outputs"
    new, _ = undisturbed(operation, server.inputs)
    for n_free in (0, 4096) if operation != "report" else (0, 65536):
        (small_disk / "filler").unlink(missing_ok=True)
        outputs.mkdir(exist_ok=True)
        fill(small_disk, n_free)
        refused = server.run(operation, outputs)
        if refused["code"] != 0:
            assert_refused(refused, outputs, "(No space left|no room)")
            left = content(outputs)
            if operation != "report":
                assert is_old_or_new(
                    {name: left[name] for name in left if not name.startswith("work/")},
                    {},
                    visible(new),
                )
        else:
            assert n_free > 0
    if operation != "report":
        (small_disk / "filler").unlink()
        assert server.run(operation, outputs)["code"] == 0
        assert visible(content(outputs)) == visible(new)


@pytest.fixture
def read_only(tmp_path):
    """Return a folder with something in it, and a function that makes it read-only."""
    folder = tmp_path / "read-only"
    folder.mkdir()
    undo = []

    def protect():
        if os.geteuid() != 0:
            for each in (folder, *(file for file in folder.rglob("*") if file.is_dir())):
                each.chmod(0o500)
                undo.append(lambda each=each: each.chmod(0o700))
            return
        bind = ["mount", "--bind", str(folder), str(folder)]
        if shutil.which("mount") is None or subprocess.run(bind, capture_output=True).returncode:
            pytest.skip("root may write everywhere, and not mount here")
        undo.append(lambda: subprocess.run(["umount", str(folder)], check=True))
        subprocess.run(["mount", "-o", "remount,bind,ro", str(folder)], check=True)

    yield folder, protect
    for action in undo:
        action()


@pytest.mark.parametrize("operation", [*WRITERS, "resumable_matrix"])
def test_a_read_only_folder(server, undisturbed, read_only, operation):
    folder, protect = read_only
    old, _ = undisturbed(operation, server.others)
    assert server.run(operation, folder, inputs=server.others)["code"] == 0
    protect()
    refused = server.run(operation, folder)
    assert_refused(refused, folder, "(no permission|cannot be written|cannot be locked)")
    assert visible(content(folder)) == visible(old)


def test_a_job_is_killed_before_changes_of_its_files(server, undisturbed, tmp_path):
    expected, n_changes = undisturbed("resumable_matrix", server.inputs)
    assert n_changes > 30
    for change in sample(range(1, n_changes + 1, 3), 5):
        outputs = tmp_path / str(change)
        killed = server.run("resumable_matrix", outputs, kill_at=change)
        assert killed["code"] == -signal.SIGKILL
        assert is_old_or_new(visible(content(outputs)), {}, visible(expected))
        assert server.run("resumable_matrix", outputs)["code"] == 0
        assert content(outputs) == expected


def test_a_report_is_killed_time_and_again(server, undisturbed, tmp_path):
    expected, n_changes = undisturbed("report", server.inputs)
    assert n_changes > 250
    # Before every change until the folder is marked and made; then on the way, which gets shorter.
    for change in sample((*range(1, 12), *range(20, 140, 20)), 6, first=3):
        killed = server.run("report", tmp_path, kill_at=change)
        assert killed["code"] == -signal.SIGKILL
        found = visible(content(tmp_path))
        unfinished = {"report/provenance.json"}
        assert all(found[name] == expected[name] for name in {*found} - unfinished), change
    # To the end, while the clock runs backwards.
    finished = server.run("report", tmp_path, clock=3600.0)
    assert finished["code"] == 0, finished
    assert content(tmp_path) == expected
    provenance = json.loads((tmp_path / "report" / "provenance.json").read_text())
    assert provenance["status"] == "finished"
    assert sum(step["reused"] for step in provenance["steps"]) > 3

    # Files from the future, and from long ago, are as good as any.
    for k, file in enumerate(file for file in tmp_path.rglob("*") if file.is_file()):
        os.utime(file, (4e9, 4e9) if k % 2 else (0, 0))
    assert server.run("report", tmp_path)["code"] == 0
    assert content(tmp_path) == expected
    provenance = json.loads((tmp_path / "report" / "provenance.json").read_text())
    assert all(step["reused"] for step in provenance["steps"])


@pytest.mark.parametrize("operation", sample([*WRITERS, "resumable_matrix"], 4))
def test_the_clock_runs_backwards(server, undisturbed, operation, tmp_path):
    expected, _ = undisturbed(operation, server.inputs)
    for _ in range(2):
        assert server.run(operation, tmp_path, clock=86400.0)["code"] == 0
        assert content(tmp_path) == expected
        for file in tmp_path.rglob("*"):
            os.utime(file, (4e9, 4e9))


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    "operation", ["matrix", "basis", "geodesic", "components", "resumable_matrix"]
)
def test_two_at_once_one_wins_and_the_other_says_so(server, undisturbed, operation, tmp_path):
    answers = server.race(operation, tmp_path, 2, pause=0.1)
    loser, winner = sorted(answers, key=lambda answer: -answer["code"])
    assert (winner["code"], loser["code"]) == (0, 2), answers
    assert re.search(rf"{re.escape(str(tmp_path))}\S* is in use: another process", loser["err"])
    assert content(tmp_path) == undisturbed(operation, server.inputs)[0]


def test_two_at_once_may_both_write_a_file(server, undisturbed, tmp_path):
    answers = server.race("neighbors", tmp_path, 3, pause=0.02)
    assert [answer["code"] for answer in answers] == [0, 0, 0], answers
    assert content(tmp_path) == undisturbed("neighbors", server.inputs)[0]


def test_a_report_has_its_folder_to_itself(server, tmp_path):
    with open_folder(tmp_path / "report"):
        before = content(tmp_path)
        refused = server.run("report", tmp_path)
        assert_refused(refused, tmp_path, "report is in use: another process")
        assert content(tmp_path) == before
    with open_folder(tmp_path / "report"):
        pass


@pytest.mark.parametrize(
    "operation", sample(["resumable_matrix", "geodesic", "matrix", "report"], 4)
)
def test_killed_at_random_moments(server, undisturbed, operation, tmp_path):
    expected, _ = undisturbed(operation, server.inputs)
    begun = time.monotonic()
    assert server.run(operation, tmp_path / "timed")["code"] == 0
    longest = 0.9 * (time.monotonic() - begun)
    moments = random.Random(5)
    outputs = tmp_path / "outputs"
    n_runs, n_killed = 0, 0
    while n_runs < (8 if FULL else 2) or n_killed == 0:
        finished = server.run(operation, outputs, alarm=moments.uniform(0.2, 1.0) * longest)
        assert finished["code"] in (0, -signal.SIGALRM), finished
        n_runs += 1
        n_killed += finished["code"] < 0
        # One that was faster than the first may have come to its end.
        longest *= 0.9 if finished["code"] == 0 else 1.0
        found = visible(content(outputs))
        found.pop("report/provenance.json", None)
        assert all(found[name] == expected[name] for name in found)
    assert server.run(operation, outputs)["code"] == 0
    assert content(outputs) == expected
