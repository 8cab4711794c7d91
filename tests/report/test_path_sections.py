"""What the report says of searches from two starts follows from the rows of its tables."""

import pytest

from riemhuman.report import _path_sections as sections


def test_searches_from_the_straight_path_that_end_lower_are_said():
    def row(name, metric, starts, energy):
        return {"name": name, "metric": metric, "starts": starts, f"energy_{metric}": energy}

    start = row(sections._ROTATING, "", "", 0.0) | {"energy_ours": 5.0}
    rows = [row("SRNF", "srnf", "rotating start", 8.0), start,
            row(sections._OURS, "ours", "rotating start, then linear", 4.0)]  # fmt: skip
    straight = [row("linear path", "", "", 0.0), row("SRNF", "srnf", "linear", 6.0),
                row(sections._OURS, "ours", "linear", 4.0)]  # fmt: skip
    found = sections._findings(rows, straight)
    assert found["lower"] == [("SRNF", pytest.approx(25.0))]
    assert found["searched"] == ["SRNF", sections._OURS]
    assert found["continued"] == [(sections._OURS, "rotating start, then linear")]
    at = {"start": 1, "ours": 2, "gain": pytest.approx(20.0), "ours_from_straight": 2}
    assert found["at"] == at
