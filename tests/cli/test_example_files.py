"""The world of files that `riemhuman examples` writes, and the commands of the pages in it."""

import os
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.cli import main

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "tutorials").glob("*.md"))]

# Installs something, needs files that only the user has, or compares all metrics for minutes.
ELSEWHERE = re.compile(
    r"pip install|git clone|python3? |riemhuman (tables|report)$|--faust|examples"
)


def commands(page):
    """Return the commands in the shell blocks of a page, without comments."""
    blocks = re.findall(r"^```bash\n(.*?)^```$", page.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    lines = "".join(blocks).splitlines()
    written = [re.split(r"\s+#", line)[0].strip() for line in lines]
    return [
        line for line in written if line.startswith("riemhuman ") and not ELSEWHERE.search(line)
    ]


def expanded(command):
    """Return the arguments of a command, patterns replaced by files, as a shell does."""
    arguments = []
    for word in shlex.split(command)[1:]:
        arguments += sorted(map(str, Path().glob(word))) if "*" in word else [word]
    return arguments


def run(*arguments):
    assert main([*arguments, "--quiet"]) == 0, shlex.join(arguments)


@pytest.fixture(scope="module")
def people(tmp_path_factory):
    folder = tmp_path_factory.mktemp("world") / "people"
    run("examples", str(folder))
    return folder


def test_scans_have_a_floor_and_triangles_of_their_own(people):
    n_vertices = rh.load_mesh(people / "anna.ply")[0].shape[0]
    for name in ("anna", "ben"):
        points, faces = rh.load_mesh(people / "scans" / f"{name}.ply")
        assert len(points) != n_vertices
        assert (np.abs(points[np.unique(faces), 1]) < 0.005).sum() > 1000


def test_the_carrying_foot_of_the_walk_does_not_slide(people):
    walk = rh.datasets.load_recording(people / "walk.npz")
    joints = walk.model.joints(walk.betas, walk.pose_vectors) + walk.translations[:, None]
    ankles = joints[
        :, [walk.model.joint_names.index(f"{side}_ankle") for side in ("left", "right")]
    ]
    steps = np.linalg.norm(np.diff(ankles[..., [0, 2]], axis=0), axis=-1)
    assert steps.min(axis=1).max() < 1e-3
    seconds = len(walk) / walk.frames_per_second
    assert 0.7 < np.linalg.norm(walk.translations[-1] - walk.translations[0]) / seconds < 1.6


def test_recordings_show_the_same_walk(people):
    first, second = (rh.datasets.load_recording(people / f"walk.{end}") for end in ("bvh", "npz"))
    assert len(first) == len(second)
    assert first.frames_per_second == pytest.approx(second.frames_per_second, rel=1e-4)


def test_an_existing_folder_is_kept(people, capsys):
    before = sorted(people.iterdir())
    assert main(["examples", str(people)]) == 2
    assert "exists" in capsys.readouterr().err
    assert sorted(people.iterdir()) == before


def test_the_first_distance_of_the_readme_runs(people, monkeypatch, capsys):
    monkeypatch.chdir(people)
    assert "`riemhuman dist anna.ply ben.ply`" in (ROOT / "README.md").read_text("utf-8")
    run("dist", "anna.ply", "ben.ply")
    assert float(capsys.readouterr().out) > 0.0


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=lambda p: p.stem)
def test_commands_of_a_page_run_one_after_the_other(page, people, tmp_path, monkeypatch, capsys):
    # The files of the world, in a folder of the page's own outputs.
    for entry in people.iterdir():
        os.symlink(entry, tmp_path / entry.name)
    monkeypatch.chdir(tmp_path)
    for command in commands(page):
        run(*expanded(command))
    capsys.readouterr()
