"""Setuptools, with source archives that are the same bytes from the same files, tests included."""

from __future__ import annotations

import gzip
import io
import os
import tarfile
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403, the functions of a build backend

# Folders that tests need beside the package: they run from the archive as from the repository.
_MORE = ("tests", "tutorials", ".ci")
_PASSED_OVER = ("__pycache__", ".ipynb_checkpoints", ".benchmarks")
# 1980-01-01: zip files, such as wheels, cannot store earlier times.
_EARLIEST = 315532800


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """Build the source archive; its times are `SOURCE_DATE_EPOCH`, and nobody owns its files."""
    name = build_meta.build_sdist(sdist_directory, config_settings)
    archive = Path(sdist_directory) / name
    folder = name.removesuffix(".tar.gz")
    with tarfile.open(archive) as built:
        files = {
            member.name: built.extractfile(member).read()
            for member in built.getmembers()
            if member.isfile()
        }
    for file in (file for top in _MORE for file in Path(top).rglob("*")):
        if file.is_file() and not set(file.parts) & set(_PASSED_OVER):
            files[f"{folder}/{file.as_posix()}"] = file.read_bytes()
    seconds = int(os.environ.get("SOURCE_DATE_EPOCH", _EARLIEST))
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w", format=tarfile.PAX_FORMAT) as rebuilt:
        for path in sorted(files):
            member = tarfile.TarInfo(path)
            member.size, member.mtime, member.mode = len(files[path]), seconds, 0o644
            rebuilt.addfile(member, io.BytesIO(files[path]))
    with (
        archive.open("wb") as stream,
        gzip.GzipFile("", "wb", fileobj=stream, mtime=seconds) as packed,
    ):
        packed.write(content.getvalue())
    return name
