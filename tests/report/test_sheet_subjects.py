"""Who is on a sheet: labels of people, and visits in their order."""

import pytest

import riemhuman as rh
from riemhuman.errors import FileFormatError
from riemhuman.report._sheet_subjects import find_subjects, people_of_files


def test_labels_of_people(tmp_path):
    table = tmp_path / "labels.csv"
    rows = "File,Subject,Gender,Height\na.ply,Ann,Female,1.7\nb,Bo,m,\n"
    rows += "c.ply,NA,NaN,\na.v2.ply,Eve,w,\n"
    table.write_text(rows, encoding="utf-8")
    people = people_of_files(table, ["a.ply", "b.ply", "c.ply", "a.v2.ply"])
    assert (people["a.ply"].person, people["a.ply"].sex, people["b.ply"].sex) == (
        "Ann",
        "woman",
        "man",
    )
    assert (people["c.ply"].person, people["c.ply"].sex) == ("", "adult")
    assert people["a.v2.ply"].person == "Eve"
    assert people["a.ply"].stature == 1.7
    for text, message in (
        ("name,sex\na,woman\n", "lacks the columns file"),
        ("file,person,sex\na,Smith, Ann,woman\n", "line 2: 4 fields found, 3 expected"),
        ("file,sex\na,robot\n", "line 2: sex must be woman, man or empty; found 'robot'"),
        ("file,date\na,01.02.2026\n", "line 2: date must be written as 2026-03-31"),
        ("file,stature\na,170\n", "line 2: stature must be .* is it in centimetres"),
        ("file,stature\na,tall\n", "line 2: stature must be a number of metres: found 'tall'"),
        ("file,sex\na,man\na,woman\n", "line 3: a already has a label, on line 2"),
    ):
        table.write_text(text, encoding="utf-8")
        with pytest.raises(FileFormatError, match=message):
            people_of_files(table, ["a"])


def test_the_visits_before(bodies, tmp_path):
    for name in "abcd":
        rh.save_mesh(tmp_path / f"{name}.ply", bodies[0], bodies.template.faces)
    table = tmp_path / "labels.csv"
    table.write_text("file,person,visit\na,x,10\nb,x,9\nc,x,2\nd,y,1\n", encoding="utf-8")
    found = find_subjects([tmp_path], None)
    assert [found.visits_until(number) for number in range(4)] == [[2, 1, 0], [2, 1], [2], [3]]
    assert found.subjects[0].visit == "visit 10"
    assert not any(found.is_without_order(number) for number in range(4))
    # Bodies of one visit are scans of it; visits that are not told apart are not compared.
    table.write_text("file,person,visit\na,x,1\nb,x,1\nc,x,\nd,,\n", encoding="utf-8")
    found = find_subjects([tmp_path], None)
    assert [subject.name for subject in found.subjects] == ["a", "c", "d"]
    assert [scan.name for scan in found.subjects[0].further_scans] == ["b"]
    assert [found.visits_until(number) for number in range(3)] == [[0], [1], [2]]
    assert [found.is_without_order(number) for number in range(3)] == [True, True, False]
    # Names with dots, and names in the two forms of a letter, are those of their own files.
    table.write_text("file,person\na,x\na.v2,z\nz,y\n", encoding="utf-8")
    with pytest.warns(UserWarning, match=r"labels\.csv names 1 of the 4 bodies, not b\.ply, c"):
        find_subjects([tmp_path], None)
