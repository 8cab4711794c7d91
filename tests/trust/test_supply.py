"""What a user gets: packages with all data in them."""

import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = ("setup.cfg", "pyproject.toml", "README.md", "LICENSE")
BUILD = """
from setuptools import build_meta
build_meta.build_sdist("dist")
build_meta.build_wheel("dist")
"""


@pytest.mark.slow  # and whatever is installed is tested
def test_packages_are_whole_and_hold_nothing_else(tmp_path):
    pytest.importorskip("setuptools", minversion="77")
    ignored = shutil.ignore_patterns("__pycache__", ".*_cache")
    shutil.copytree(ROOT / "riemhuman", tmp_path / "riemhuman", ignore=ignored)
    for name in SOURCES:
        shutil.copy(ROOT / name, tmp_path)
    command = [sys.executable, "-c", BUILD]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (source,), (wheel,) = (list(tmp_path.glob(f"dist/*{end}")) for end in (".tar.gz", ".whl"))
    with tarfile.open(source) as archive:
        in_source = {name.partition("/")[2] for name in archive.getnames()}
    with zipfile.ZipFile(wheel) as archive:
        in_wheel = set(archive.namelist())
    needed = {
        str(file.relative_to(ROOT))
        for file in (ROOT / "riemhuman").rglob("*")
        if file.is_file() and "__pycache__" not in file.parts and "/." not in file.as_posix()
    }
    assert any(name.endswith(".npz") for name in needed)
    assert needed - in_source == needed - in_wheel == set()
    assert {name.partition("/")[0].split("-")[0] for name in in_wheel} == {"riemhuman"}
