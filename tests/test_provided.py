"""What lower layers use from higher ones is loaded when it is first used."""

import pytest

from riemhuman.provided import Provided


def test_it_is_loaded_when_it_is_asked_for():
    provided, loaded = Provided(), []
    with pytest.raises(RuntimeError, match="__init__.py provides this"):
        provided()
    provided.load_by(lambda: loaded.append(1) or "solvers")
    assert loaded == []
    assert provided() == "solvers"
