"""What readers declare of the files that they read."""

import re
from dataclasses import replace

import riemhuman as rh
from riemhuman.cli._format_commands import format_table
from riemhuman.io import kinds_of_files


def test_a_reader_of_ones_own_is_in_the_table(monkeypatch):
    monkeypatch.setattr(kinds_of_files, "KINDS", dict(kinds_of_files.KINDS))
    kind = rh.io.FileKind(
        *("files of my scanner", "my_package.load", (".bin",)),
        registered="`ScanRegistration`",
        measured="once registered",
    )

    @rh.io.reads(kind)
    def load(path):
        return path

    assert load("a.bin") == "a.bin"
    (found,) = (kind for kind in rh.io.file_kinds() if kind.name == "files of my scanner")
    assert found == replace(kind, reader=load)
    assert re.search(r"files of my scanner +\.bin +", format_table())
