"""What benchmarks print of two commits stands side by side."""

import shutil
import subprocess
import sys

import pytest
from benchmarks import beside

COMMIT = ["-c", "user.name=a", "-c", "user.email=a@b", "commit", "--quiet", "-m"]


def test_numbers_that_differ_stand_beside_each_other():
    here = [["11 surfaces: 2.0 ms", "no number"], ["11 surfaces: 4.0 ms"], ["11 surfaces: 3.0 ms"]]
    there = [["11 surfaces: 1.5 ms"], ["11 surfaces: 9e2 ms"], ["11 surfaces: 0.5 ms"]]
    assert beside.beside(here, there) == ["11 surfaces: 3 [1.5, 2.00 times] ms"]


def test_lines_that_one_tree_alone_prints_stand_alone():
    here = [["pose: 1,200 pairs", "pose: 5 pairs", "memory 7 MiB"]]
    there = [["pose: 600 pairs", "pose: 5 pairs", "disk 3 GiB"]]
    found = beside.beside(here, there)
    assert found == ["pose: 1200 [600, 2.00 times] pairs", "pose: 5 pairs", "memory 7 MiB"]


@pytest.mark.skipif(shutil.which("git") is None, reason="needs git")
def test_a_commit_is_run_with_the_tests_of_the_tree(tmp_path):
    repository = tmp_path / "repository"
    (repository / "tests").mkdir(parents=True)

    def git(*arguments):
        command = ["git", "-C", str(repository), *arguments]
        return subprocess.run(command, check=True, capture_output=True, text=True).stdout

    git("init", "--quiet")
    for value in ("1", "2"):
        (repository / "speed.py").write_text(f"VALUE = {value}\n")
        git("add", ".")
        git(*COMMIT, "as it was")
    (repository / "tests" / "print_speed.py").write_text("import speed\nprint(speed.VALUE)\n")
    command = [sys.executable, "tests/print_speed.py"]
    with beside.checked_out(repository, "HEAD~1") as tree:
        assert (beside.run(tree, command), beside.run(repository, command)) == ("1\n", "2\n")
        with pytest.raises(SystemExit, match="failed"):
            beside.run(tree, [sys.executable, "nothing.py"])
    assert not tree.exists()
    assert git("worktree", "list").count("\n") == 1
    assert "tests/print_speed.py" not in git("ls-files")
