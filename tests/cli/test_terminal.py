"""What is said on a terminal, in a log file, and when quiet is asked for."""

import re
import sys

import pytest

from riemhuman.cli.terminal import Reporter, note
from riemhuman.progress import ProgressBar


def test_a_log_file_gets_one_line_a_task(capsys):
    reporter = Reporter(quiet=False)
    assert not reporter.bars
    with reporter.task("Reading"):
        assert capsys.readouterr().err == ""
    assert re.fullmatch(r"Reading: \d\.\d s\n", capsys.readouterr().err)


def test_a_terminal_is_told_at_once(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    reporter = Reporter(quiet=False)
    assert reporter.bars
    with reporter.task("Reading"):
        assert capsys.readouterr().err == "Reading ..."
    assert re.fullmatch(r"\rReading: \d\.\d s\n", capsys.readouterr().err)
    with pytest.raises(ZeroDivisionError), reporter.task("Reading"):
        raise ZeroDivisionError
    assert capsys.readouterr().err == "Reading ...\n"


def test_notes_stand_above_bars(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with Reporter(quiet=False).task("Reading"), ProgressBar(range(3)) as bar:
        bar.update()
        note("one is unreadable")
    written = capsys.readouterr().err
    # The bar is wiped out first, the note has a line of its own, and the bar is drawn again.
    before, after = written.split("\r\x1b[Kriemhuman: one is unreadable\n")
    assert before.endswith("\r")
    assert "1/3" in after


def test_notes_in_a_log_file_have_no_signs_of_a_terminal(capsys):
    note("one is unreadable")
    assert capsys.readouterr().err == "riemhuman: one is unreadable\n"


def test_quiet(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    reporter = Reporter(quiet=True)
    assert not reporter.bars
    with reporter.task("Reading"):
        pass
    assert capsys.readouterr().err == ""
