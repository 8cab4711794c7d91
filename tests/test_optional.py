"""Optional dependencies say how they are installed."""

import re
from importlib.metadata import metadata, requires

import pytest

from riemhuman.errors import MissingDependencyError
from riemhuman.optional import import_optional


def test_what_is_missing_says_how_to_install_it():
    with pytest.raises(
        MissingDependencyError, match=r"absent is needed .* pip install '\.\[video\]'"
    ):
        import_optional("absent", "video")


def test_extras_name_extras_that_exist():
    """The installer only warns of others, and leaves them out."""
    known = set(metadata("riemhuman").get_all("Provides-Extra"))
    named = [
        name
        for requirement in requires("riemhuman")
        for names in re.findall(r"^riemhuman\[([^]]*)\]", requirement)
        for name in names.split(",")
    ]
    assert named
    assert set(named) <= known
