"""Odd names of files, and tables with any line end, in any encoding."""

import os
import sys

import numpy as np
import pytest

from riemhuman.datasets import load_bodies
from riemhuman.datasets.shrec import read_classes
from riemhuman.descriptors.latent_vectors import LatentVectors
from riemhuman.errors import FileFormatError
from riemhuman.io.meshes import load_mesh, save_mesh

MESH = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]), np.array([[0, 1, 2], [1, 2, 3]])


@pytest.mark.skipif(sys.platform != "linux", reason="names are bytes on Linux alone")
@pytest.mark.parametrize("name", ["~anna.ply", "~.ply", os.fsdecode(b"\xff.ply"), "a\nb.ply"])
def test_names_of_every_kind_are_read(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    save_mesh(name, *MESH)
    assert os.listdir() == [name]
    np.testing.assert_array_equal(load_mesh(name)[1], MESH[1])


def labelled(folder, table, n=3):
    for number in range(n):
        save_mesh(folder / f"b_{number}.off", MESH[0] + number, MESH[1])
    (folder / "labels.csv").write_bytes(table)
    return load_bodies(folder)


@pytest.mark.parametrize("line_end", [b"\n", b"\r\n", b"\r"])
def test_labels_with_any_line_end_and_lines_within_quotes(tmp_path, line_end):
    table = 'file,subject,pose\nb_0,Ann\u2028a,sit\nb_1,"Bo\nb",run\x0cfast\nb_2,Cy\x85,run\n'
    bodies = labelled(tmp_path, table.encode().replace(b"\n", line_end))
    quoted = f"Bo{line_end.decode()}b"
    assert bodies.subject_names == ("Ann\u2028a", quoted, "Cy")
    assert bodies.pose_names == ("run", "run\x0cfast", "sit")


def test_a_quote_that_is_never_closed_is_named(tmp_path):
    with pytest.raises(FileFormatError, match="line 4: unexpected end of data"):
        labelled(tmp_path, b'file,subject,pose\nb_0,"Ann,sit\nb_1,Bob,run\nb_2,Cy,run\n')


@pytest.mark.parametrize("number", ["1_0", "\u0661\u0662", "0x1", "1,5", "True", ""])
def test_vectors_hold_numbers_of_ascii(tmp_path, number):
    (tmp_path / "v.csv").write_text(f'id,x,y\nann,"{number}",2\n', encoding="utf-8")
    with pytest.raises(FileFormatError, match="line 2: .* is not a number"):
        LatentVectors.from_file(tmp_path / "v.csv")


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_words_of_a_class_file_end_at_ascii_blanks(tmp_path, line_end):
    text = line_end.join(["PSB 1", "1 2", "", "Ann\u2028a\u00a0b 0 2", "0", "1\x85"])
    (tmp_path / "x.cla").write_bytes(text.encode())
    assert read_classes(tmp_path / "x.cla") == {"Ann\u2028a\u00a0b": ("0", "1\x85")}
    (tmp_path / "x.cla").write_bytes((text + line_end + "2").encode())
    with pytest.raises(FileFormatError, match="line 7: '2' found"):
        read_classes(tmp_path / "x.cla")


@pytest.mark.parametrize("name", ["labels.csv", "v.csv", "x.cla"])
def test_tables_in_another_encoding_are_refused_by_name(tmp_path, name):
    content = {
        "labels.csv": "file,subject,pose\nb_0,Jörg,sit\n",
        "v.csv": "id,x\nJörg,1\n",
        "x.cla": "PSB 1\n1 1\nJörg 0 1\n0\n",
    }[name]
    save_mesh(tmp_path / "b_0.off", *MESH)
    (tmp_path / name).write_bytes(content.encode("latin-1"))
    read = {"labels.csv": lambda file: load_bodies(file.parent), "x.cla": read_classes}
    with pytest.raises(FileFormatError, match=f"{name} is not text in UTF-8"):
        read.get(name, LatentVectors.from_file)(tmp_path / name)
