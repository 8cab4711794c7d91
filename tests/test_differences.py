"""The page of differences from geomstats; `python .ci/jobs.py oracles` compares the two."""

import pytest
from trust.geomstats_signatures import call_of, names_in, our_class, parameters_of, rows_of

ROWS = rows_of("Other arguments")


@pytest.mark.parametrize("row", ROWS, ids=[row[2].strip("`").split("(")[0] for row in ROWS])
def test_calls_of_the_page_are_ours(row):
    (dotted,), (ours,) = names_in(row[0]), names_in(row[2])
    name = ours.split("(")[0]
    cls = our_class(dotted)
    called = cls if name == cls.__name__ else getattr(cls, name)
    assert call_of(name, parameters_of(called)) == ours


def test_names_of_the_page_are_not_here():
    for row in rows_of("Not in riemhuman"):
        for name in names_in(row[1]):
            assert not hasattr(our_class(*names_in(row[0])), name), row
