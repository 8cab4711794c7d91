"""What cannot be done is refused in one line, with code 2, and nothing is written."""

import sys

import numpy as np
import pytest

from riemhuman.io import save_mesh
from riemhuman.surfaces import DeformationBasis

# Command lines with the files of the fixture, and what the message says.
REFUSALS = """
dist body_0.ply other.ply                                   | other.ply is not registered to
dist body_0.ply body_1.ply -a 0 -c 0                        | must not both be 0
matrix .                                                    | nothing to write
matrix . -o D.txt                                           | ending must be .npz
matrix . --csv - --json                                     | standard output
matrix . -o basis.npz                                       | exists; --force
matrix . -o D.npz --basis basis.npz                         | --basis needs --paths
matrix . -o D.npz --precision single --paths                | --precision single cannot
retrieve alone/other.ply alone                              | no mesh other than the query
retrieve body_0.ply . -k 0                                  | -k must be at least 1
mean body_0.ply scan.xyz -o m.ply                           | register it first: riemhuman register
dist body_0.ply body_1.ply --unit millimetres                | --unit millimetres is wrong
mean body_0.ply -o m.ply --picture m.gif                    | must be .png or .html
geodesic body_0.ply body_1.ply -o path.gif                  | .npz, / (a folder)
geodesic body_0.ply body_1.ply -o alone -f                  | holds something else (other.ply)
align mine/frame_0000.ply -o mine -f                         | so it is no earlier result
geodesic body_0.ply body_1.ply -o p --basis basis.npz       | belongs to another template
components body_0.ply body_1.ply -o out -n 2                 | -n 2 must be below the number
components alone -o out --shape                             | λ of --shape is too small
components body_0.ply body_0.ply -o out -n 1                | all points of X coincide
disentangle body_0.ply body_0.ply -o b.ply --pose-weight -1 | pose_weight must be
align other.ply alone/other.ply -o aligned                  | the same name
fit tetrahedron.ply -o fit.npz                              | --model FILE
basis -o b.npz                                              | or --open
basis empty -o b.npz                                        | holds no motion
basis alone -o b.npz --sequences knees                      | choose from HDF5
basis --open -o b.npz --subjects nobody                     | lean runner
measure body_0.ply --only statur                            | did you mean 'stature'
measure body_0.ply --definitions d.json                     | needs --model
measure body_0.ply --seated --model model.npz               | leave out --model
measure mine --same-person --as-is                          | leave out --as-is
measure tetrahedron.ply                                     | unlike the open body model
measure mm.ply --as-is                                      | a body in millimetres
motions dist a.npz b.npz --up z                             | --unit and --up are for folders
register scan.xyz -o body.ply --sequence                    | --sequence is for a folder
register scan.xyz -o body.ply --landmarks none.csv          | there is no file none.csv
register alone -o out --untrusted                           | --untrusted is for one scan
view path.npz body_0.ply -o page.html                       | either one .npz file
view body_0.ply -o a.glb                                    | must be one of .html, .png
mean anna.ply -o m.ply --picture m.png                      | there is no file anna.ply
info absent.ply                                             | no file or folder
info bad.npz                                                | not an .npz archive
tables --labels labels.csv                                  | --labels needs --bodies FOLDER
tables --bodies alone                                       | labels.csv; write one with the columns
report --bodies . --people 1                                | --people SEED is for
report --dfaust alone -o r                                  | neither
"""


@pytest.fixture(scope="module")
def place(bodies, tmp_path_factory):
    folder = tmp_path_factory.mktemp("refused")
    faces = bodies.template.faces
    for number in (0, 1):
        save_mesh(folder / f"body_{number}.ply", bodies.points[number], faces)
    for name in ("empty", "alone", "mine"):
        (folder / name).mkdir()
    for name in ("mine/frame_0000.ply", "mine/frame_0001.ply"):
        save_mesh(folder / name, bodies.points[0], faces)
    for name in ("other.ply", "alone/other.ply"):
        save_mesh(folder / name, bodies.points[0], faces[::-1])
    save_mesh(folder / "mm.ply", 1000.0 * bodies.points[0], faces)
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    save_mesh(folder / "tetrahedron.ply", corners, [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    np.savetxt(folder / "scan.xyz", np.zeros((3, 3)))
    np.savez(folder / "path.npz", path=bodies.points[:2], faces=faces)
    DeformationBasis(np.ones((1, 2, 3)), orthonormalize=True).save(folder / "basis.npz")
    (folder / "bad.npz").write_text("text", encoding="utf-8")
    return folder


@pytest.mark.everyday
@pytest.mark.parametrize("line", REFUSALS.strip().splitlines(), ids=lambda line: line[:50].strip())
def test_refused_in_one_line_with_nothing_written(refused, place, monkeypatch, line):
    monkeypatch.chdir(place)
    before = sorted(place.rglob("*"))
    arguments, message = (part.strip() for part in line.split("|"))
    assert message in refused(*arguments.split())
    assert sorted(place.rglob("*")) == before


def test_pictures_without_matplotlib_are_refused_before_the_work(refused, place, monkeypatch):
    monkeypatch.chdir(place)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert "[plot]'" in refused("geodesic", "body_0.ply", "body_1.ply", "-o", "path/")
    assert "there is no file sit.ply" in refused("geodesic", "sit.ply", "up.ply", "-o", "path/")


def test_a_name_that_no_file_system_allows_is_no_fault_of_the_output(refused):
    name = 300 * "a" + ".ply"
    for arguments in (["info", name], ["dist", name, name], ["view", name, "-o", "page.html"]):
        said = refused(*arguments)
        assert "File name too long" in said
        assert "unexpected" not in said


def test_a_name_does_nothing_to_the_terminal(refused):
    said = refused("info", "a\x1b[31m\u202eb.ply")
    assert said.endswith(r"a\x1b[31m\u202eb.ply")


def test_an_empty_text_is_no_path(refused, place):
    for arguments in (["info", ""], ["view", place / "body_0.ply", "-o", ""]):
        assert "a path is missing" in refused(*arguments)
