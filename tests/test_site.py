"""The documentation site: built without a warning, links lead somewhere, pages fit a telephone."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parents[1]

pytestmark = pytest.mark.slow

# The theme scrolls an article that is too wide within the page.
WIDEST = """
const parts = [...document.querySelectorAll("main > .bd-content")];
return parts.map((part) => Math.max(
  (parts.length > 1 ? part : document.documentElement).scrollWidth,
  part.querySelector(".bd-article-container").scrollWidth));
"""
MAIN = re.compile(r'(<main id="main-content"[^>]*>)(.*)(</main>)', re.DOTALL)
TELEPHONE = 400  # pixels


class Links(HTMLParser):
    """The links, pictures, scripts and styles of a page."""

    def __init__(self):
        super().__init__()
        self.addresses = []

    def handle_starttag(self, tag, attributes):
        self.addresses += [text for name, text in attributes if name in ("href", "src") and text]


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """Return the folder of the site."""
    pytest.importorskip("sphinx")
    folder = tmp_path_factory.mktemp("site")
    subprocess.run([sys.executable, ROOT / "tutorials" / "build_site.py", folder], check=True)
    return folder


def pages_of(site):
    """Return the pages; the theme leaves a template of its own among the static files."""
    return sorted(page for page in site.rglob("*.html") if "_static" not in page.parts)


def test_links_lead_somewhere(site):
    broken = []
    for page in pages_of(site):
        links = Links()
        links.feed(page.read_text(encoding="utf-8"))
        for link in links.addresses:
            parts = urlsplit(link)
            file = page.parent / unquote(parts.path)
            if not parts.scheme and parts.path and not file.exists():
                broken.append(f"{page.relative_to(site)}: {link}")
    assert broken == []


def groups_of(site):
    """Return pages in groups: those of a folder that is generated are laid out as one, quickly."""
    generated = [site / "names", site / "_modules"]
    pages = pages_of(site)
    groups = [[page] for page in pages if not set(generated) & set(page.parents)]
    return groups + [[page for page in pages if folder in page.parents] for folder in generated]


def opened_as_one(pages: list[Path]) -> Path:
    """Write a page with the articles of all pages."""
    texts = [page.read_text(encoding="utf-8") for page in pages]
    joined = "".join(MAIN.search(text)[2] for text in texts)
    opened = pages[0].with_name(f"joined_{pages[0].name}")
    whole = MAIN.sub(lambda main: main[1] + joined + main[3], texts[0])
    opened.write_text(whole, encoding="utf-8")
    return opened


def test_pages_fit_a_telephone(site, browser):
    wide = []
    for pages in groups_of(site):
        browser.open(opened_as_one(pages), TELEPHONE, 900)
        widths = browser.run(WIDEST)
        assert len(widths) == len(pages)
        wide += [page.name for page, width in zip(pages, widths, strict=True) if width > TELEPHONE]
    assert wide == []


def test_search_works_from_a_file(site, browser):
    browser.open(site / "names" / "riemhuman.EbinMetric.html", 1200, 900)
    action = browser.run("return document.querySelector('form.bd-search').action")
    assert Path(unquote(urlsplit(action).path)) == site / "search.html"
    (site / "query.html").write_text(
        '<meta http-equiv="refresh" content="0; url=search.html?q=geodesic">', encoding="utf-8"
    )
    browser.open(site / "query.html", 1200, 900)
    found = "return document.querySelectorAll('#search-results li a').length"
    browser.wait_for(f"{found} > 10")  # they come one by one
