"""README.md, pages and tutorials: the Python of pages runs unedited, names and links exist."""

import re
import textwrap
from pathlib import Path

import pytest

import riemhuman
import riemhuman as rh

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "tutorials").glob("*.md"))]
TUTORIALS = sorted((ROOT / "tutorials").glob("*.ipynb"))


def text_of(page):
    return page.read_text(encoding="utf-8")


def python_blocks(text):
    """Return the Python blocks, each preceded by as many empty lines as in the text."""
    blocks = re.finditer(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    return [text[: block.start(1)].count("\n") * "\n" + block[1] for block in blocks]


def run(blocks, name):
    """Run blocks one after the other, as a reader does who types them into one session."""
    namespace = {"__name__": "page"}
    for block in blocks:
        exec(compile(block, name, "exec"), namespace)


def broken_links(page):
    """Return the links and pictures of a page that lead to no file."""
    text = re.sub(r"^```.*?^```$", "", text_of(page), flags=re.MULTILINE | re.DOTALL)
    links = re.findall(r"\]\(([^)#\s]+)[^)]*\)", text)
    local = [link for link in links if "://" not in link]
    return [link for link in local if not (page.parent / link).is_file()]


def test_the_worked_change_of_contributing_runs():
    page = text_of(ROOT / ".github" / "CONTRIBUTING.md")
    (block,) = re.findall(r"^   ```python\n(.*?)^   ```$", page, re.MULTILINE | re.DOTALL)
    namespace = {"__name__": "log_areas"}
    exec(compile(textwrap.dedent(block), "log_areas.py", "exec"), namespace)
    bodies = rh.datasets.load_open_bodies("coarse")
    metric = rh.SurfaceMetric(rh.AlignedSurfaces(bodies.template), [namespace["LogAreas"](0.7)])
    assert metric.dist(bodies[0], bodies[1]) > 0.0
    assert metric.is_rotation_invariant


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_python_blocks_run(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(python_blocks(text_of(page)), str(page))


def test_the_first_block_prints_what_is_shown(capsys):
    text = text_of(README)
    run(python_blocks(text)[:1], str(README))
    shown = re.search(r"^```python\n.*?^```\n\n```text\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    assert capsys.readouterr().out == shown[1]


def test_public_names_exist():
    names = {
        (page, dotted)
        for page in [*PAGES, *TUTORIALS]
        for dotted in re.findall(r"\brh\.([A-Za-z_][\w.]*\w)", text_of(page))
    }
    for page, dotted in names:
        found = riemhuman
        for name in dotted.split("."):
            assert not name.startswith("_"), f"{page.name} speaks of rh.{dotted}, which is private"
            assert hasattr(found, name), f"{page.name} speaks of rh.{dotted}, which does not exist"
            found = getattr(found, name)


def test_links_lead_somewhere():
    assert {page.name: links for page in PAGES if (links := broken_links(page))} == {}


@pytest.mark.parametrize(
    ("marker", "job"),
    [("run", "riemhuman tables"), ("test", "pytest -n auto --dist worksteal")],
)
def test_commands_are_marked(marker, job):
    text = text_of(README)
    blocks = re.findall(rf"<!-- {marker}-command -->\n+```bash\n(.*?)\n```\n", text, re.DOTALL)
    assert len(blocks) == 1
    assert "python3 -m venv" in blocks[0]
    assert blocks[0].endswith(job)
