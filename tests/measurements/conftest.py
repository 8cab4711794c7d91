"""The measurements of the open model."""

import pytest

from riemhuman.measurements import Measurements


@pytest.fixture(scope="session")
def measurements(model):
    return Measurements(model)
