"""Sheets that matplotlib draws: every text has its place."""

from itertools import combinations

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.transforms import Affine2D

import riemhuman as rh
from riemhuman.report import _sheet_figure

POINTS = Affine2D().scale(0.1)


def boxes_of(side):
    """Return the words of a page and where they are, from its lower left corner, points."""
    side.figure.set_dpi(720)  # so that letters are not moved to whole pixels
    renderer = FigureCanvasAgg(side.figure).get_renderer()
    texts = [text for text in side.axes.texts if text.get_text().strip()]
    return [
        (text.get_text(), text.get_window_extent(renderer).transformed(POINTS)) for text in texts
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("units", "name"), [("cm", ""), ("in", "WILHELMINA MWMWMWMWMWMWMWMWM"), ("cm", 30 * "$1 more ")]
)
def test_no_text_covers_another_or_leaves_the_page(bodies, units, name):
    content = rh.report.sheet(bodies[3], sex="woman", name=name, units=units).content
    for draw in (_sheet_figure._first_side, _sheet_figure._second_side):
        boxes = boxes_of(draw(content))
        assert len(boxes) > 30
        for words, box in boxes:
            assert box.x0 > 0, words
            assert box.x1 < 595, words
        for (words, box), (others, other) in combinations(boxes, 2):
            across = min(box.x1, other.x1) - max(box.x0, other.x0)
            upward = min(box.y1, other.y1) - max(box.y0, other.y0)
            # Boxes hold room above and below the letters, which lines may share.
            assert across < 0.3 or upward < 2.0, (words, others)
