"""Files that are right but for a few fields are read as independent parsers read them, or refused.

Long runs read 100,000 of them: `python -m trust.structured_run 100000`.
"""

import os
import sys
import time

import numpy as np
import pytest
from trust import structured_run
from trust.structured_files import WRITERS, write
from trust.structured_judges import JUDGES

from riemhuman.errors import FileFormatError

EACH = 24


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_readers_agree_with_their_judges():
    counts, wrong = structured_run.run(EACH * len(WRITERS))
    assert wrong == []
    assert sum(counts.values()) == EACH * len(WRITERS)
    for kind in WRITERS:
        # Half of the files or so are legal.
        assert min(counts[kind, "accepted"], counts[kind, "refused"]) >= EACH // 8, kind


@pytest.mark.parametrize("kind", WRITERS)
def test_files_without_a_change_are_accepted(kind, tmp_path):
    legal = (files for n in range(100) for files, changed in [write(kind, 0, n)] if not changed)
    for _, files in zip(range(3), legal, strict=False):
        for name, content in files.items():
            (tmp_path / name).write_bytes(content)
        read, judge = JUDGES[kind]
        target = tmp_path / next(iter(files))
        assert structured_run.difference(read(target), judge(target)) is None


def spin(file):
    started = time.process_time()
    while time.process_time() - started < 0.3:
        pass
    raise FileFormatError


def refuse(file):
    raise FileFormatError("refused")


def judged_wrongly(file):
    return {"array": np.zeros(0), "other": np.zeros(0)}


BROKEN = {
    "untyped": lambda file: [][1],
    "slow": spin,
    "large": lambda file: {"array": np.ones(2**25)},
    "wrong": judged_wrongly,
    "ends the interpreter": lambda file: os._exit(3),
}


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
@pytest.mark.parametrize("fault", BROKEN)
def test_every_fault_is_noticed(fault, monkeypatch):
    monkeypatch.setattr(structured_run, "MOST_SECONDS", 0.2 if fault == "slow" else 2.0)
    monkeypatch.setattr(structured_run, "MOST_BYTES", 2**27)
    monkeypatch.setitem(JUDGES, "npy", (BROKEN[fault], lambda file: {"array": np.zeros(0)}))
    counts, wrong = structured_run.run(2, kinds=["npy"])
    assert counts["npy", fault] == 2
    assert [number for _, number, _ in wrong] == [0, 1]


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_files_without_a_change_must_not_be_refused(monkeypatch):
    monkeypatch.setitem(JUDGES, "npy", (refuse, lambda file: {}))
    counts, _ = structured_run.run(30, kinds=["npy"])
    assert counts["npy", "refused, though nothing is changed"] >= 3
    assert counts["npy", "refused"] >= 3


@pytest.mark.skipif(sys.platform != "linux", reason="forks")
def test_what_the_judge_refuses_must_not_be_accepted(monkeypatch):
    monkeypatch.setitem(JUDGES, "npy", (lambda file: {}, lambda file: [][1]))
    counts, _ = structured_run.run(2, kinds=["npy"])
    assert counts["npy", "accepted, but the judge refuses"] == 2
