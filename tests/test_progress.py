"""Progress bars: interrupted at any moment, they say nothing of it."""

import contextlib
import gc
import sys
import threading

import pytest

from riemhuman.progress import ProgressBar


@pytest.mark.parametrize("disable", [False, True])
def test_interrupted_while_it_is_made(disable, monkeypatch, capsys):
    get_lock = ProgressBar.get_lock

    def interrupted():
        # The thread in which tqdm watches older bars takes the lock, too.
        if threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt
        return get_lock()

    complaints = []
    monkeypatch.setattr(sys, "unraisablehook", complaints.append)
    monkeypatch.setattr(ProgressBar, "get_lock", interrupted)
    # What it was to be is gone with the error, which `pytest.raises` would keep.
    with contextlib.suppress(KeyboardInterrupt):
        pytest.fail(f"made {ProgressBar(range(3), disable=disable)}")
    gc.collect()
    assert complaints == []
    assert capsys.readouterr().err == ""


def test_what_it_shows(capsys):
    assert list(ProgressBar(range(3), desc="Points", disable=True)) == [0, 1, 2]
    assert capsys.readouterr().err == ""
    assert list(ProgressBar(range(3), desc="Points", disable=False)) == [0, 1, 2]
    assert "Points: 100%" in capsys.readouterr().err
