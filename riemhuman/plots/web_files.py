"""Styles and scripts that ship with the package, for pages that hold them."""

from __future__ import annotations

from functools import cache
from importlib.resources import files


@cache
def web_file(name: str, package: str = "riemhuman.plots") -> str:
    """Return a text file for pages that ships with the package.

    Parameters
    ----------
    name : str
        Its name.
    package : str
        The package whose folder ``web`` holds it.

    Returns
    -------
    str
    """
    return (files(package) / "web" / name).read_text(encoding="utf-8")


def styles() -> str:
    """Return the styles that viewers need, as an element of the page's head.

    Returns
    -------
    str
    """
    return f"<style>{web_file('viewer.css')}</style>"


def viewer_script() -> str:
    """Return the script of the viewers, which needs three.js.

    Returns
    -------
    str
    """
    own = "".join(web_file(f"viewer{part}.js") for part in ("_body", "_gestures", ""))
    return f"(() => {{\n{own}}})();\n"


def scripts() -> str:
    """Return the scripts that viewers need, as elements at the end of a page.

    Returns
    -------
    str
    """
    return (
        "<script>/* three.js 0.187.0, MIT licence, Copyright 2010-2026 three.js authors */\n"
        f"{web_file('three.min.js')}</script>\n<script>{viewer_script()}</script>"
    )
