"""Of tests marked `sampled`, so many run every day, and all in the long job."""

from types import SimpleNamespace

import lengths
import pytest


class Test:
    """A test as pytest collects it."""

    __test__ = False

    def __init__(self, nodeid, *arguments):
        self.nodeid, self.arguments = nodeid, arguments

    def get_closest_marker(self, name):
        return SimpleNamespace(args=self.arguments) if self.arguments else None


CASES = [Test(f"a.py::test[{k}]", 5) for k in range(12)]
KIND = [Test(f"{name}.py::test", 3, "scans") for name in "abcdef"]
PLAIN = [Test("a.py::other"), Test("b.py::other")]


@pytest.mark.parametrize(("tests", "step"), [(CASES, 5), (KIND, 3), (PLAIN, 1)])
def test_one_of_so_many_runs(monkeypatch, tests, step):
    monkeypatch.setattr(lengths, "FULL", False)
    n_run = len(tests) - len(lengths.deselected(tests))
    assert len(tests) // step <= n_run <= -(-len(tests) // step)
    monkeypatch.setattr(lengths, "FULL", True)
    assert lengths.deselected(tests) == set()
