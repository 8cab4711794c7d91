"""README.md: its Python runs unedited, its names exist and its commands can be found."""

import re
from pathlib import Path

import pytest

import riemhuman

README = Path(__file__).parents[1] / "README.md"
TEXT = README.read_text(encoding="utf-8")


def python_blocks(text):
    """Return the Python blocks, each preceded by as many empty lines as in the text."""
    blocks = re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [text[: block.start(1)].count("\n") * "\n" + block[1] for block in blocks]


def run(blocks):
    """Run blocks one after the other, as a reader does who types them into one session."""
    namespace = {"__name__": "readme"}
    for block in blocks:
        exec(compile(block, str(README), "exec"), namespace)


def test_python_blocks_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(python_blocks(TEXT))


def test_python_blocks_can_fail():
    text = "# Title\n\n```python\nx = 1\n```\n\nText\n\n```python\nassert x == 2\n```\n"
    with pytest.raises(AssertionError) as failure:
        run(python_blocks(text))
    assert failure.traceback[-1].lineno + 1 == 10


def test_public_names_exist():
    for dotted in set(re.findall(r"\brh\.([A-Za-z_][\w.]*\w)", TEXT)):
        found = riemhuman
        for name in dotted.split("."):
            assert hasattr(found, name), f"README.md speaks of rh.{dotted}, which does not exist"
            found = getattr(found, name)


@pytest.mark.parametrize(
    ("marker", "job"), [("run", "python -m riemhuman"), ("test", "pytest -n auto")]
)
def test_commands_are_marked(marker, job):
    blocks = re.findall(rf"<!-- {marker}-command -->\n+```bash\n(.*?)\n```\n", TEXT, re.DOTALL)
    assert len(blocks) == 1
    assert "python3 -m venv" in blocks[0]
    assert blocks[0].endswith(job)
