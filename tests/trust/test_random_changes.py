"""What sabotage may change, and the lists of what it passes over."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
from random_changes import changed_at, lost

PACKAGE = Path(__file__).parents[2] / "riemhuman"


def changes(tmp_path, text):
    file = tmp_path / "terms" / "some.py"
    file.parent.mkdir(exist_ok=True)
    file.write_text(text, encoding="utf-8")
    return [changed_at(file, number)[1] for number in range(changed_at(file)[0].count)]


def test_every_listed_place_is_in_the_package():
    assert lost(PACKAGE) == []


def test_places_that_are_gone_are_found(tmp_path):
    (tmp_path / "terms").mkdir()
    (tmp_path / "terms" / "half_angle_fit.py").write_text("x = 1\n", encoding="utf-8")
    found = lost(tmp_path)
    assert "terms/half_angle_fit.py: _DEGREES" in found
    assert "terms/sum.py" in found


@pytest.mark.parametrize(
    ("text", "changed"),
    [
        ("x = a + b", ["x = a - b"]),
        ("x = a if a < b else c", ["x = a if a <= b else c"]),
        ("x = a if a < b else b", []),
        ("x = b if not a < b else a", ["x = b if a < b else a", "x = b if not a <= b else a"]),
        ("def f():\n    x = np.empty(3)", ["def f():\n    x = np.empty(4)"]),
        ("@compiled\ndef f():\n    x = np.empty(3)", []),
        (
            "y = np.where(c, 1, f(np.where(c, 2, x)))",
            ["y = np.where(c, 2, f(np.where(c, 2, x)))"],
        ),
        ("@abstractmethod\ndef f(x=1): pass", []),
        ("def f(a, b=1, n_threads=1): pass", ["def f(a, b=2, n_threads=1):\n    pass"]),
        ("@compiled\ndef f():\n    x = np.zeros(3)", ["@compiled\ndef f():\n    x = np.zeros(4)"]),
    ],
)
def test_changes(tmp_path, text, changed):
    assert sorted(changes(tmp_path, text)) == sorted(changed)
