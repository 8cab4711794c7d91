"""Who is on a sheet: labels of people, and visits in their order."""

import pytest

import riemhuman as rh
from riemhuman.errors import FileFormatError
from riemhuman.report._sheet_subjects import find_subjects, read_people


def test_labels_of_people(tmp_path):
    table = tmp_path / "labels.csv"
    table.write_text("File,Subject,Gender\nA.PLY,Ann,Female\nb,Bo,m\nc.ply,,\n", encoding="utf-8")
    people = read_people(table)
    assert (people["a.ply"].person, people["a"].sex, people["b"].sex) == ("Ann", "woman", "man")
    assert people["c.ply"].sex == "adult"
    for text, message in (
        ("name,sex\na,woman\n", "has no column file"),
        ("file,sex\na,robot\n", "line 2: sex must be woman, man or empty; found 'robot'"),
        ("file,date\na,01.02.2026\n", "line 2: date must be written as 2026-03-31"),
        ("file,sex\na,man\nA,woman\n", "line 3: A has another line above"),
    ):
        table.write_text(text, encoding="utf-8")
        with pytest.raises(FileFormatError, match=message):
            read_people(table)


def test_the_visit_before(bodies, tmp_path):
    for name in "abcd":
        rh.save_mesh(tmp_path / f"{name}.ply", bodies[0], bodies.template.faces)
    table = tmp_path / "labels.csv"
    table.write_text("file,person,visit\na,x,10\nb,x,9\nc,x,2\nd,y,1\n", encoding="utf-8")
    found = find_subjects([tmp_path], None)
    assert [found.earlier(number) for number in range(4)] == [1, 2, None, None]
    assert found.subjects[0].visit == "visit 10"
    assert not any(found.is_without_order(number) for number in range(4))
    # Several bodies of one visit, or visits that are not told apart, are not compared.
    table.write_text("file,person,visit\na,x,1\nb,x,1\nc,x,\nd,,\n", encoding="utf-8")
    found = find_subjects([tmp_path], None)
    assert [found.earlier(number) for number in range(4)] == [None] * 4
    assert [found.is_without_order(number) for number in range(4)] == [True, True, True, False]
    table.write_text("file,person\na,x\nz,y\n", encoding="utf-8")
    with pytest.warns(UserWarning, match=r"labels\.csv names 1 of the 4 bodies"):
        find_subjects([tmp_path], None)
