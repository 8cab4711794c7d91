"""What a user gets: packages with all data in them, and a main job that needs no network."""

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = ("setup.cfg", "pyproject.toml", "README.md", "LICENSE")

REFUSE_NETWORK = """
import sys

def refuse_network(event, arguments):
    if event.startswith("socket."):
        raise RuntimeError(f"network used: {event} {arguments}")

sys.addaudithook(refuse_network)
"""


def run(code, cwd):
    return subprocess.run(
        [sys.executable, "-c", code], cwd=cwd, capture_output=True, text=True, check=False
    )


def test_the_main_job_needs_no_network():
    code = "from riemhuman.__main__ import main\nsys.exit(main(['--resolution', 'coarse']))"
    done = run(REFUSE_NETWORK + code, ROOT)
    assert done.returncode == 0, done.stderr
    assert "pose metric (0, 0, 1)" in done.stdout
    done = run(REFUSE_NETWORK + "import socket\nsocket.socket()", ROOT)
    assert "network used" in done.stderr


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Return the names of the files of the wheel and of the source archive."""
    pytest.importorskip("setuptools", minversion="77")
    folder = tmp_path_factory.mktemp("build")
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "riemhuman", folder / "riemhuman", ignore=ignored)
    for name in SOURCES:
        shutil.copy(ROOT / name, folder)
    code = (
        "from setuptools import build_meta as b\n"
        "print(b.build_sdist('dist'), b.build_wheel('dist'), sep='\\n')"
    )
    done = run(code, folder)
    assert done.returncode == 0, done.stderr
    source, wheel = done.stdout.split()[-2:]
    with tarfile.open(folder / "dist" / source) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    with zipfile.ZipFile(folder / "dist" / wheel) as archive:
        return set(archive.namelist()), sources


@pytest.mark.slow
def test_packages_are_whole(packages):
    package = ROOT / "riemhuman"
    needed = {
        str(file.relative_to(ROOT))
        for file in package.rglob("*")
        if file.is_file() and "__pycache__" not in file.parts and "/." not in file.as_posix()
    }
    assert any(name.endswith(".npz") for name in needed)
    for names in packages:
        assert needed - names == set()


@pytest.mark.slow
def test_packages_hold_nothing_else(packages):
    wheel, _ = packages
    assert {name.partition("/")[0].split("-")[0] for name in wheel} == {"riemhuman"}
