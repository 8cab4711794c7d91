"""Every public name has an example in its docstring, and it prints what it says.

They run in `python .ci/jobs.py pages`.
"""

import doctest
import inspect
import os
import warnings

import numpy as np
import pytest
from public_names import public_objects

import riemhuman as rh

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
IMPORTS = {"np": np, "rh": rh}  # which examples leave out, as those of NumPy do


OBJECTS = public_objects()
PACKAGES = sorted({name.rpartition(".")[0] for name in OBJECTS})


def failures(text, name, folder):
    """Run the examples in a docstring in a new folder and return what they print wrong."""
    report = []
    folder.mkdir()
    os.chdir(folder)
    test = doctest.DocTestParser().get_doctest(text, IMPORTS.copy(), name, None, 0)
    with warnings.catch_warnings():
        doctest.DocTestRunner(optionflags=OPTIONS, verbose=False).run(test, out=report.append)
    return "".join(report)


def test_every_name_has_an_example():
    texts = {name: inspect.getdoc(one) for name, one in OBJECTS.items()}
    assert [name for name in texts if "\nExamples\n--------\n" not in texts[name]] == []


@pytest.mark.slow
@pytest.mark.parametrize("package", PACKAGES)
def test_examples(package, monkeypatch, tmp_path):
    monkeypatch.setenv("MPLBACKEND", "agg")  # draw on no screen
    monkeypatch.chdir(tmp_path)  # and come back afterwards
    names = [name for name in OBJECTS if name.rpartition(".")[0] == package]
    found = [failures(inspect.getdoc(OBJECTS[name]), name, tmp_path / name) for name in names]
    assert not "".join(found)
