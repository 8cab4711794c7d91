"""Registered meshes on disk, and the command line run in this process."""

from dataclasses import dataclass

import pytest

from riemhuman.cli import main
from riemhuman.io import save_mesh

# Two people in three poses, in files whose natural order is not the alphabetical one.
NUMBERS = (0, 1, 2, 20, 21, 22)


@dataclass
class Finished:
    """What a command has printed and returned."""

    code: int
    out: str
    err: str


@pytest.fixture(scope="session")
def scans(bodies, tmp_path_factory):
    """Return a folder of registered meshes with a table of labels."""
    folder = tmp_path_factory.mktemp("scans")
    rows = ["file,subject,pose,remark"]
    for number in NUMBERS:
        save_mesh(folder / f"body_{number}.ply", bodies.points[number], bodies.template.faces)
        subject = bodies.subject_names[bodies.subject[number]]
        rows.append(f"body_{number}.ply,{subject},pose {bodies.pose[number]},none")
    (folder / "labels.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder


@pytest.fixture
def run(capsys):
    """Return a function that runs the command line on arguments."""

    def run_arguments(*arguments):
        capsys.readouterr()
        code = main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return Finished(code, captured.out, captured.err)

    return run_arguments


@pytest.fixture
def refused(run):
    """Return a function that runs arguments which must be refused in one line."""

    def run_arguments(*arguments, code=2):
        finished = run(*arguments)
        assert finished.code == code, finished
        assert finished.out == ""
        last = finished.err.splitlines()[-1]
        assert last.startswith("riemhuman: ")
        return last

    return run_arguments
