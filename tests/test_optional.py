"""Optional dependencies: how to install them, and matplotlib whatever backend is asked for."""

import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib.metadata import metadata, requires

import pytest
from matplotlib.image import imread

from riemhuman.errors import MissingDependencyError
from riemhuman.optional import import_optional

BACKENDS = (
    "module://matplotlib_inline.backend_inline",  # Jupyter sets it for all processes it starts
    "module://nowhere.backend",
    "nonsense",
    "template",
)
SCRIPT = """
import sys
import numpy as np
import riemhuman as rh
with rh.plots.figure_style():
    ax = rh.plots.plot_energy([3.0, 2.0, 1.0])
for ending in ("png", "svg", "pdf"):
    rh.plots.figures.save_figure(ax.figure, f"{sys.argv[1]}/figure.{ending}")
"""


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


@pytest.mark.slow
@pytest.mark.everyday("nonsense")
@pytest.mark.parametrize("backend", BACKENDS)
def test_files_are_written_whatever_backend_is_asked_for(backend, tmp_path):
    environment = {**os.environ, "MPLBACKEND": backend}
    command = [sys.executable, "-c", SCRIPT, str(tmp_path)]
    subprocess.run(command, env=environment, check=True, timeout=600)
    assert imread(tmp_path / "figure.png").std() > 0
    assert (tmp_path / "figure.pdf").read_bytes().startswith(b"%PDF")
    ElementTree.fromstring((tmp_path / "figure.svg").read_text(encoding="utf-8"))
