"""The page of the report: sections, figures and tables in one self-contained HTML file."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from importlib.resources import files

from riemhuman.plots import page_scripts, page_styles


@cache
def web_file(name: str) -> str:
    """Return a text file of the folder ``web``."""
    return (files("riemhuman.report") / "web" / name).read_text(encoding="utf-8")


@dataclass(frozen=True)
class Picture:
    """A figure of the report: the name of its files, a description, and its SVG."""

    name: str
    alt: str
    svg: str


@dataclass(frozen=True)
class Section:
    """A section of the page.

    Attributes
    ----------
    identifier : str
        Anchor, unique in the page.
    title : str
        Heading.
    short : str
        Heading in the table of contents.
    parts : sequence of str
        HTML of its paragraphs, figures and tables.
    """

    identifier: str
    title: str
    short: str
    parts: Sequence[str]

    def html(self) -> str:
        """Return the section as HTML.

        Returns
        -------
        str
        """
        return (
            f'<section id="{self.identifier}" aria-labelledby="{self.identifier}-title">'
            f'<h2 id="{self.identifier}-title">{escape(self.title)}</h2>'
            f"{''.join(self.parts)}</section>"
        )


def page(
    title: str, lead: str, facts: Sequence[tuple[str, str]], sections: Sequence[Section], end: str
) -> str:
    """Return the page.

    Parameters
    ----------
    title : str
        Heading of the first level.
    lead : str
        HTML of the introduction.
    facts : sequence of (str, str)
        HTML of the sizes of the data, and their names.
    sections : sequence of Section
        Sections.
    end : str
        HTML of the foot.

    Returns
    -------
    str
    """
    contents = "".join(
        f'<li><a href="#{section.identifier}">{escape(section.short)}</a></li>'
        for section in sections
    )
    numbers = "".join(
        f"<div><dt>{escape(what)}</dt><dd>{number}</dd></div>" for number, what in facts
    )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f'<title>{escape(title)}</title>\n<link rel="icon" href="data:,">\n'
        f"<style>{web_file('page.css')}</style>\n{page_styles()}\n</head>\n<body>\n"
        '<a class="skip" href="#main">Skip to the content</a>\n'
        f'<header><h1>{escape(title)}</h1><p class="lead">{lead}</p>'
        f'<dl class="facts">{numbers}</dl>'
        f'<nav aria-label="Contents"><ol>{contents}</ol></nav></header>\n'
        f'<main id="main">{"".join(section.html() for section in sections)}</main>\n'
        f"<footer>{end}</footer>\n{page_scripts()}\n</body>\n</html>\n"
    )


def paragraph(text: str) -> str:
    """Return a paragraph.

    Parameters
    ----------
    text : str
        HTML of its content.

    Returns
    -------
    str
    """
    return f"<p>{text}</p>"


def heading(text: str) -> str:
    """Return a heading within a section.

    Parameters
    ----------
    text : str
        The heading.

    Returns
    -------
    str
    """
    return f"<h3>{escape(text)}</h3>"


def figure(picture: Picture, caption: str, *, wide: bool = False) -> str:
    """Return a figure with its caption and links to its files.

    Parameters
    ----------
    picture : Picture
        The figure.
    caption : str
        HTML of the caption.
    wide : bool
        Whether a narrow window scrolls the figure instead of shrinking it.

    Returns
    -------
    str
    """
    data = base64.b64encode(picture.svg.encode("utf-8")).decode("ascii")
    # With a known size, nothing below moves when the figure is loaded.
    *_, width, height = re.findall(r"[\d.]+", picture.svg.split('viewBox="')[1].split('"')[0])
    image = (
        f'<img alt="{escape(picture.alt, quote=True)}" src="data:image/svg+xml;base64,{data}" '
        f'width="{float(width):.0f}" height="{float(height):.0f}" loading="lazy" decoding="async">'
    )
    if wide:
        label = escape(picture.alt, quote=True)
        image = f'<div class="scroll" role="region" tabindex="0" aria-label="{label}">{image}</div>'
    links = " ".join(
        f'<a href="figures/{picture.name}.{ending}" download '
        f'aria-label="{ending.upper()} of the figure {picture.name}">{ending.upper()}</a>'
        for ending in ("svg", "png")
    )
    return f"<figure>{image}<figcaption>{caption} {links}</figcaption></figure>"


def viewer_figure(fragment: str, caption: str) -> str:
    """Return a viewer with its caption.

    Parameters
    ----------
    fragment : str
        HTML of the viewer.
    caption : str
        HTML of the caption.

    Returns
    -------
    str
    """
    return f'<figure class="live">{fragment}<figcaption>{caption}</figcaption></figure>'


def side_by_side(*parts: str) -> str:
    """Return parts that stand beside each other if the window is wide enough.

    Parameters
    ----------
    *parts : str
        HTML of each.

    Returns
    -------
    str
    """
    return f'<div class="pair">{"".join(f"<div>{part}</div>" for part in parts)}</div>'
