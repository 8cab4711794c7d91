"""Settings shared by all tests, and the one browser of the session."""

import pytest
from headless_browser import opened_browser
from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def browser():
    """Return a headless browser, which all tests share."""
    with opened_browser() as one:
        yield one
