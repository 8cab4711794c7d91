"""How far surfaces travel: the files and functions that a distance and an energy run through.

A reader who follows f₁ opens these, and climbs back from a subpackage to one above it at
one place at most, where the loop over blocks, tiles or chunks calls what is done with each.
"""

import sys
from pathlib import Path

import pytest
from cases import open_template, surfaces

import riemhuman
from riemhuman.geometry import AlignedSurfaces, ElasticMetric

PACKAGE = str(Path(riemhuman.__file__).parent)
FLOORS = ("memory.py", "checks.py", "kernels", "terms", "surfaces", "geometry")
POINTS = surfaces(open_template(), 4, rng=1)
METRIC = ElasticMetric(AlignedSurfaces(open_template()), 1.0, 0.1, 0.3)


def walk(call):
    """Return the functions of the library that a call runs through, and the climbs among them."""
    functions, climbs, stack = set(), set(), []

    def follow(frame, event, _):
        if event == "call":
            path, place = frame.f_code.co_filename, None
            if path.startswith(PACKAGE) and not frame.f_code.co_name.startswith("<"):
                place = (path[len(PACKAGE) + 1 :], frame.f_code.co_qualname)
                functions.add(place)
                above = next((caller for caller in reversed(stack) if caller), None)
                if above is not None and floor(place) > floor(above):
                    climbs.add(above)
            stack.append(place)
        elif event == "return" and stack:
            stack.pop()

    call()  # what is compiled, or computed once, comes first
    sys.setprofile(follow)
    try:
        call()
    finally:
        sys.setprofile(None)
    return functions, climbs


def floor(place):
    return FLOORS.index(place[0].split("/")[0])


@pytest.mark.parametrize(
    ("name", "arguments", "n_files", "n_functions", "n_climbs"),
    [
        ("dist", (POINTS[0], POINTS[1]), 7, 24, 0),
        ("dist_pairwise", (POINTS,), 9, 41, 1),
        ("energy", (POINTS,), 6, 13, 1),
    ],
)
def test_files_functions_and_climbs(name, arguments, n_files, n_functions, n_climbs):
    functions, climbs = walk(lambda: getattr(METRIC, name)(*arguments))
    listed = "\n".join(map(" ".join, sorted(functions)))
    assert len({file for file, _ in functions}) <= n_files, listed
    assert len(functions) <= n_functions, listed
    assert len(climbs) <= n_climbs, climbs


def test_points_are_checked_once():
    """The entries of each set of points are looked at once, at the public door."""
    seen = []

    def note(frame, event, _):
        is_check = frame.f_code.co_qualname == "real_array" and event == "call"
        if is_check and frame.f_locals["finite"]:
            seen.append(frame.f_locals["array"].shape)

    shape = POINTS[0].shape
    for call, expected in (
        (lambda: METRIC.dist(POINTS[0], POINTS[1]), [shape, shape]),
        (lambda: METRIC.energy(POINTS), [POINTS.shape]),
        (lambda: METRIC.inner_product(POINTS[1], POINTS[2], POINTS[0]), [shape, shape, shape]),
    ):
        seen.clear()
        sys.setprofile(note)
        try:
            call()
        finally:
            sys.setprofile(None)
        assert [shape_seen for shape_seen in seen if len(shape_seen) > 1] == expected
