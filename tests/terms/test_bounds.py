"""Compiled loops of terms stay inside their arrays."""

import pytest
from cases import deformations, open_template, surfaces
from interpreted import check_bounds

from riemhuman.kernels import moving_frames, triangles
from riemhuman.kernels.moving_frames import by_vertex
from riemhuman.terms import (
    EbinTerm,
    NormalTerm,
    RootNormalTerm,
    ebin,
    first_order,
    flat,
    normal_projection,
    normals,
    root_normals,
    second_order,
    zeroth_order,
)
from riemhuman.terms.sum import SumOfTerms

TEMPLATE = open_template()
FACES, FRAMES, AREAS = TEMPLATE.faces, TEMPLATE.frame_coefficients, TEMPLATE.face_areas
TERMS = [EbinTerm(1.0, 0.3), NormalTerm(0.2), RootNormalTerm(0.7)]
FIRST_ORDER = first_order.FirstOrderTerm(
    TEMPLATE, first_order.FirstOrderWeights(1.0, 0.7, 0.4, 0.2, 0.3)
)
QUADRATIC = [FIRST_ORDER, normal_projection.NormalPartTerm(TEMPLATE, FIRST_ORDER)]
QUADRATIC += [zeroth_order.ZerothOrderTerm(TEMPLATE, 0.4)]
QUADRATIC += [second_order.SecondOrderTerm(TEMPLATE, 0.1)]
MODULES = (triangles, ebin, flat, normals, root_normals)


def collapsed(points):
    """Return surfaces, a triangle of one of them without area."""
    points = points.copy()
    points[1, FACES[5]] = points[1, FACES[5, 0]]
    return points


def test_path_energy(monkeypatch):
    path = surfaces(TEMPLATE, 3, rng=1)
    path[2] = path[1] + 1e-3 * path[0]
    calls = [
        lambda: SumOfTerms(TERMS, TEMPLATE).path_energy(path),
        lambda: SumOfTerms(TERMS[::2], TEMPLATE).path_energy(collapsed(path)),
    ]
    check_bounds(monkeypatch, MODULES, calls)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_features(monkeypatch, precision):
    points = surfaces(TEMPLATE, 2, rng=2)
    calls = [
        lambda: SumOfTerms(TERMS, TEMPLATE).features(points, precision),
        lambda: SumOfTerms(TERMS[::2], TEMPLATE).features(collapsed(points), precision),
    ]
    check_bounds(monkeypatch, MODULES, calls)


@pytest.mark.parametrize("quadratic", QUADRATIC, ids=lambda term: type(term).__name__)
def test_squared_norms(monkeypatch, quadratic):
    h, f = (by_vertex(make(TEMPLATE, 2, rng=6)) for make in (deformations, surfaces))
    modules = (first_order, moving_frames, normal_projection, second_order, zeroth_order)
    calls = [
        lambda: quadratic.squared_norms_and_slopes(h, f),
        lambda: [quadratic.squared_norms(h, f)],
    ]
    check_bounds(monkeypatch, modules, calls)
