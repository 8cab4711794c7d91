"""Folders of jobs: whole tables, one process at a time, and no other job."""

import os

import numpy as np
import pytest

from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.io.files import neighbour
from riemhuman.io.job_folder import JobFolder

JOB, LAYOUT = {"metric": {"a": 1.0}, "n": 3}, {"tile": 2}


@pytest.fixture
def job(tmp_path):
    """Return a folder with a job and a table."""
    job = JobFolder(tmp_path / "new" / "job")
    assert job.claim(JOB, LAYOUT) == LAYOUT
    job.make_tables({"D.npy": ((3, 4), np.float64)})
    return job


def test_tables_are_kept(job):
    job.write("D.npy", (0, 7.0), ((slice(1, 3), 1), [1.0, 2.0]))
    (job.path / ".manifest.0123abcd.part.json").touch()  # of a process that was killed
    again = JobFolder(job.path)
    assert again.claim(JOB, {"tile": 9}) == LAYOUT
    again.make_tables({"D.npy": ((3, 4), np.float64), "E.npy": ((0,), np.int64)})
    table = again.read("D.npy")
    assert table.tolist() == [[7.0] * 4, [0, 1, 0, 0], [0, 2, 0, 0]]
    assert not table.flags.writeable
    again.rename("D.npy", "F.npy")
    again.remove("E.npy", "E.npy")
    assert sorted(os.listdir(job.path)) == ["F.npy", "manifest.json"]


def test_another_job_is_refused_by_its_first_difference(job):
    with pytest.raises(ArgumentError, match=r"metric\.a is 1.0 there, 2.0 here"):
        JobFolder(job.path).claim({"metric": {"a": 2.0}, "n": 3}, LAYOUT)
    with pytest.raises(ArgumentError, match="n is 3 there, None here"):
        JobFolder(job.path).claim({"metric": {"a": 1.0}}, LAYOUT)


def test_one_process_at_a_time(job):
    with (
        job.locked(),
        pytest.raises(FileError, match="is in use: another process"),
        JobFolder(job.path).locked(),
    ):
        pass
    with job.locked():
        pass


@pytest.mark.parametrize(
    "text", ["", "[1]", '{"layout": 3}', '{"layout": {"tile": 0}}', '{"layout": {}}']
)
def test_a_damaged_manifest(job, text):
    (job.path / "manifest.json").write_text(text)
    with pytest.raises(FileFormatError, match="not the manifest of"):
        JobFolder(job.path).claim(JOB, LAYOUT)


def test_damaged_tables(job):
    file = job.path / "D.npy"
    file.write_bytes(file.read_bytes()[:-8])
    with pytest.raises(FileFormatError, match=r"D\.npy: damaged"):
        job.read("D.npy")


def test_folders_with_other_files(tmp_path):
    (tmp_path / "thesis.tex").touch()
    with pytest.raises(ArgumentError, match=r"holds thesis\.tex"):
        JobFolder(tmp_path)
    with pytest.raises(FileError, match="cannot be used as the folder of a job"):
        JobFolder(tmp_path / "thesis.tex")
    # A process that was killed before it made a manifest is no other job.
    (tmp_path / "thesis.tex").rename(tmp_path / ".manifest.1a2b.part.json")
    (tmp_path / "job.lock").touch()
    (tmp_path / ".DS_Store").touch()  # of somebody who looked into the folder
    # A command writes its table there, too.
    neighbour(tmp_path / "D.npz").mkdir()
    assert JobFolder(tmp_path).claim(JOB, LAYOUT) == LAYOUT


def test_no_space(job, monkeypatch):
    def allocate(*arguments):
        raise OSError(28, "No space left on device")

    before = set(job.path.iterdir())
    monkeypatch.setattr(os, "fsync", allocate)
    with pytest.raises(FileError, match="cannot be written: No space left"):
        job.make_tables({"E.npy": ((100,), np.float64)})
    assert set(job.path.iterdir()) == before
