"""Tables of labels: rows as long as the header, and names that are compared as a whole."""

import codecs
import re
import unicodedata

import numpy as np
import pytest

from riemhuman.checks.labels import label_list
from riemhuman.errors import ArgumentError, FileFormatError
from riemhuman.io.label_tables import read_label_rows, rows_of_files

ZOE, DECOMPOSED = (unicodedata.normalize(form, "zoé") for form in ("NFC", "NFD"))


def write(folder, content):
    table = folder / "labels.csv"
    table.write_bytes(content if isinstance(content, bytes) else content.encode())
    return table


def read(folder, content, *columns):
    rows = read_label_rows(write(folder, content), columns or ("subject", "pose"))
    return [(row.line, row.file, *row.texts.values()) for row in rows]


@pytest.mark.parametrize(
    "content",
    [
        "\ufefffile;subject;pose\r\na.ply;Anna;wave\r\n\r\n;;\r\n",
        "file\tsubject\tpose\ra.ply\tAnna\twave",
        codecs.BOM_UTF16_LE + "file\tsubject\tpose\na.ply\tAnna\twave\n".encode("utf-16-le"),
        'pose,"File",note,person\nwave,a.ply,"1, 2",Anna\n',
        'pose, subject, file\n"wave", "Anna", "a.ply"\n',
        "NAME, file ,pose\n Anna\u00a0, a.ply ,\u200bwave\n",
    ],
    ids=["semicolons", "tabs and old lines", "UTF-16", "quotes", "quotes after spaces", "spaces"],
)
def test_spellings_of_a_table(tmp_path, content):
    assert read(tmp_path, content) == [(2, "a.ply", "Anna", "wave")]
    assert read(tmp_path, "sep=;\nfile;subject;pose\na;b;c\n") == [(3, "a", "b", "c")]


def test_tables_that_are_refused(tmp_path):
    for content, message in (
        ("file,subject,pose\na.ply,Smith, Anna,wave\n", "line 2: 4 fields found, 3 expected"),
        ("file,subject,pose\na,b,c\n\na.ply,wave\n", "line 4: 2 fields found, 3 expected"),
        ("file,pose,Subject,subject\n", "has the column subject more than once"),
        ("file,who,pose\n", "lacks the columns subject"),
        ("file,subject,pose\n,b,c\n", "line 2: no file given"),
        ("file,subject,pose\na,b,c\na,b,d\n", "line 3: a already has a label, on line 2"),
        (f"file,subject,pose\n{ZOE},b,c\n{DECOMPOSED},b,c\n", "already has a label, on line 2"),
        ("file,subject,pose\na,Zoë,c\n".encode("latin-1"), "is not text in UTF-8.*CSV UTF-8"),
    ):
        with pytest.raises(FileFormatError, match=re.compile(f"labels.csv.*{message}", re.S)):
            read(tmp_path, content)


def test_missing_labels_are_those_of_arrays(tmp_path):
    for missing in (" ", "NaN", "None", "n/a", "null"):
        assert read(tmp_path, f"file,subject,pose\nNA,{missing},Na\n") == [(2, "NA", "", "Na")]
        with pytest.raises(ArgumentError, match=r"people\[1\] is missing"):
            label_list(["Na", missing], "people", 2)
        with pytest.raises(ArgumentError, match=r"people\[1\] is missing"):
            label_list(np.array(["none", missing]), "people", 2)


def test_labels_in_arrays_are_in_one_form():
    assert len(set(label_list([ZOE, DECOMPOSED, np.array(DECOMPOSED)], "people", 3))) == 1
    assert len(set(label_list(np.array([ZOE, DECOMPOSED]), "people", 2))) == 1
    # Arabic and Indic scripts need joiners.
    assert len(set(label_list(["a\u200cb", "ab"], "people", 2))) == 2


@pytest.mark.parametrize(
    ("row", "file"),
    [
        ("anna", "anna.ply"),
        ("anna.PLY", "anna.ply"),
        ("anna.obj", "anna.ply"),
        ("anna.v2", "anna.v2.ply"),
        (f"{DECOMPOSED}.ply", ZOE),
        ("a b", "a\u00a0b.stl"),
    ],
)
def test_rows_and_their_files(tmp_path, row, file):
    table = write(tmp_path, f"file\n{row}\n")
    rows = read_label_rows(table, ())
    found, others = rows_of_files(table, rows, ["other.ply", file, "anna.v3.ply", "A b"])
    assert [(number, row.line) for number, row in found.items()] == [(1, 2)]
    assert others == []


@pytest.mark.parametrize(
    ("row", "file"),
    [
        ("anna.v2", "anna.ply"),
        ("anna.v2.ply", "anna.v3.ply"),
        ("a b", "A b.ply"),
        ("1", "01.ply"),
    ],
)
def test_rows_of_other_files(tmp_path, row, file):
    table = write(tmp_path, f"file\n{row}\n")
    rows = read_label_rows(table, ())
    assert rows_of_files(table, rows, [file]) == ({}, rows)


def test_files_with_several_rows_and_rows_with_several_files(tmp_path):
    def match(names, files):
        table = write(tmp_path, "\n".join(["file", *names, ""]))
        found, others = rows_of_files(table, read_label_rows(table, ()), files)
        return {files[k]: row.file for k, row in found.items()}, [row.file for row in others]

    # The row of a scan in another format is of no body that has a row of its own.
    assert match(["a.obj", "a.ply"], ["a.ply"]) == ({"a.ply": "a.ply"}, ["a.obj"])
    assert match(["b.obj", "b.ply"], ["b.ply", "b.obj"])[1] == []
    for names, files, message in (
        (["anna", "anna.ply"], ["anna.ply"], "line 2: anna already has a label, on line 3"),
        (["anna"], ["anna.ply", "anna.obj"], "line 2: anna may refer to anna.ply, anna.obj"),
        ([ZOE], [ZOE, DECOMPOSED], "may refer to"),
    ):
        with pytest.raises(FileFormatError, match=message):
            match(names, files)
