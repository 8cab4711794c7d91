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


def built(folder, *kinds):
    """Copy the sources into a folder, and return the packages built there."""
    ignored = shutil.ignore_patterns("__pycache__", ".*_cache")
    shutil.copytree(ROOT / "riemhuman", folder / "riemhuman", ignore=ignored)
    for name in SOURCES:
        shutil.copy(ROOT / name, folder)
    calls = "".join(f"print(b.build_{kind}('dist'))\n" for kind in kinds)
    code = f"from setuptools import build_meta as b\n{calls}"
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    names = (line for line in done.stdout.splitlines() if line.endswith((".tar.gz", ".whl")))
    return [folder / "dist" / name for name in names if " " not in name and "/" not in name]


@pytest.fixture(scope="module")
def archives(tmp_path_factory):
    """Return the source archive and the wheel."""
    pytest.importorskip("setuptools", minversion="77")
    return built(tmp_path_factory.mktemp("build"), "sdist", "wheel")


@pytest.fixture(scope="module")
def packages(archives):
    """Return the names of the files of the wheel and of the source archive."""
    source, wheel = archives
    with tarfile.open(source) as archive:
        sources = {name.partition("/")[2] for name in archive.getnames()}
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist()), sources


@pytest.mark.slow  # and whatever is installed is tested
def test_packages_are_whole_and_hold_nothing_else(packages):
    package = ROOT / "riemhuman"
    needed = {
        str(file.relative_to(ROOT))
        for file in package.rglob("*")
        if file.is_file() and "__pycache__" not in file.parts and "/." not in file.as_posix()
    }
    assert any(name.endswith(".npz") for name in needed)
    for names in packages:
        assert needed - names == set()
    wheel, _ = packages
    assert {name.partition("/")[0].split("-")[0] for name in wheel} == {"riemhuman"}
