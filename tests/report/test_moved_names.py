"""Names of pictures that were part of the report."""

import pytest

import riemhuman as rh


@pytest.mark.parametrize("name", ["plot_body", "view_path", "precision_recall"])
def test_old_names_lead_to_the_new(name):
    with pytest.warns(
        DeprecationWarning, match=f"report.{name} has moved to riemhuman.(plots|ret)"
    ):
        found = getattr(rh.report, name)
    assert found in (getattr(rh.plots, name, None), getattr(rh.retrieval, name, None))


def test_other_names_are_unknown():
    with pytest.raises(AttributeError, match="no attribute 'plot_nothing'"):
        rh.report.plot_nothing  # noqa: B018
