"""Every public name has an example in its docstring, and it prints what it says.

One of two runs every day, without those that take seconds, and all where the documentation is
built, in `python .ci/jobs.py docs`.
"""

import doctest
import inspect
import warnings

import numpy as np
import pytest
from public_names import public_objects

import riemhuman as rh

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
IMPORTS = {"np": np, "rh": rh}  # which examples leave out, as those of NumPy do


OBJECTS = public_objects()
SLOW = {
    "riemhuman.measurements.model_from_measurements",
    "riemhuman.plots.plot_difference",
    "riemhuman.plots.view_difference",
    "riemhuman.registration.TemplateRegistration",
}
EVERYDAY = [name for name in list(OBJECTS)[::2] if name not in SLOW]


@pytest.fixture
def quick(monkeypatch, tmp_path):
    """Write files to a folder of the test, and draw on no screen."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    monkeypatch.chdir(tmp_path)


def failures(text, name):
    """Run the examples in a docstring and return what they print wrong."""
    report = []
    test = doctest.DocTestParser().get_doctest(text, IMPORTS.copy(), name, None, 0)
    with warnings.catch_warnings():
        doctest.DocTestRunner(optionflags=OPTIONS, verbose=False).run(test, out=report.append)
    return "".join(report)


def test_every_name_has_an_example():
    texts = {name: inspect.getdoc(one) for name, one in OBJECTS.items()}
    assert [name for name in texts if "\nExamples\n--------\n" not in texts[name]] == []


@pytest.mark.everyday(*EVERYDAY)
@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.usefixtures("quick")
def test_examples(name):
    assert not failures(inspect.getdoc(OBJECTS[name]), name)
