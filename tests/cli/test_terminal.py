"""What is said on a terminal, in a log file, and when quiet is asked for."""

import re
import sys

import pytest

from riemhuman.cli.terminal import Reporter


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


def test_quiet(capsys, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    reporter = Reporter(quiet=True)
    assert not reporter.bars
    with reporter.task("Reading"):
        pass
    assert capsys.readouterr().err == ""
