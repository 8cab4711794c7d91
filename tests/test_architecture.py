"""The tour of the code: the functions that it links exist in the files that it names."""

import draw_layers
import pytest

LINKS = draw_layers.LINK.findall(draw_layers.PAGE.read_text(encoding="utf-8"))


@pytest.mark.parametrize(("name", "file"), LINKS, ids=[name for name, _ in LINKS])
def test_linked_functions_exist(name, file):
    assert draw_layers.line_of(draw_layers.ROOT / file, name) > 0


def test_layers_are_drawn_from_the_code(tmp_path):
    names = {name for row in draw_layers.floors() for name in row}
    assert {"terms", "geometry", "solvers", "plots"} <= names
    assert ("solvers", "geometry") in draw_layers.imports()
    draw_layers.draw(tmp_path / "layers.png")
    assert (tmp_path / "layers.png").stat().st_size > 10_000
