"""Styles and scripts of pages, which ship with the package."""

from __future__ import annotations

from functools import cache
from importlib.resources import files


@cache
def web_file(name: str, package: str = "riemhuman.plots") -> str:
    """Return a text file of pages that ships with the package.

    Parameters
    ----------
    name : str
        Name of the file.
    package : str
        Package whose folder ``web`` contains it.

    Returns
    -------
    str
    """
    return (files(package) / "web" / name).read_text(encoding="utf-8")


def styles() -> str:
    """Return the styles of viewers, as an element for the head of a page.

    Returns
    -------
    str
    """
    return f"<style>{web_file('viewer.css')}</style>"


def viewer_script() -> str:
    """Return the script of viewers, which needs three.js.

    Returns
    -------
    str
    """
    own = "".join(web_file(f"viewer{part}.js") for part in ("_body", "_gestures", ""))
    return f"(() => {{\n{own}}})();\n"


def scripts() -> str:
    """Return the scripts of viewers, as elements for the end of a page.

    Returns
    -------
    str
    """
    return (
        "<script>/* three.js 0.187.0, MIT licence, Copyright 2010-2026 three.js authors */\n"
        f"{web_file('three.min.js')}</script>\n<script>{viewer_script()}</script>"
    )
