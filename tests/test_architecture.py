"""The tour of the code: the functions that it links exist in the files that it names."""

import re

import draw_layers
import pytest

LINES_OF_A_SCREEN = 40
LINKS = draw_layers.LINK.findall(draw_layers.PAGE.read_text(encoding="utf-8"))


def test_linked_functions_exist():
    for name, file in LINKS:
        assert draw_layers.line_of(draw_layers.ROOT / file, name) > 0, name


@pytest.mark.slow
def test_links_land_where_the_function_is_seen():
    """Within a screen: `python tutorials/remake/draw_layers.py` sets the lines anew."""
    text = draw_layers.PAGE.read_text(encoding="utf-8")
    stored, current = (
        [int(line) for line in re.findall(r"\.py#L(\d+)", page)]
        for page in (text, draw_layers.with_lines(text))
    )
    away = {
        name: abs(before - now)
        for (name, _), before, now in zip(LINKS, stored, current, strict=True)
    }
    assert {name: lines for name, lines in away.items() if lines > LINES_OF_A_SCREEN} == {}
