"""Every term there is: its compiled forms are its definition, to rounding."""

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
from cases import sphere_template, surfaces
from every_term import TERMS, features_of_fields, quadratic_terms

import riemhuman.terms
from riemhuman.kernels import surface
from riemhuman.kernels.threads import of_one_kind
from riemhuman.terms import Term
from riemhuman.terms._quadratic import QuadraticTerm
from riemhuman.terms._sums import (
    SumOfTerms,
    add_gradient,
    fill_records,
)

TEMPLATE = sphere_template()
FACES, FRAMES, AREAS = TEMPLATE.faces, TEMPLATE.frame_coefficients, TEMPLATE.face_areas
OPERATOR = TEMPLATE.differential_operator
POINTS = surfaces(TEMPLATE, 4, rng=2)

each_term = pytest.mark.parametrize("term", TERMS, ids=repr)


def test_no_term_is_left_out():
    classes = set()
    for module in pkgutil.iter_modules(riemhuman.terms.__path__, "riemhuman.terms."):
        members = vars(importlib.import_module(module.name)).values()
        classes |= {cls for cls in members if inspect.isclass(cls) and not inspect.isabstract(cls)}
    classes = {cls for cls in classes if issubclass(cls, (Term, QuadraticTerm))}
    assert classes == {type(term) for term in [*TERMS, *quadratic_terms(TEMPLATE).values()]}


def close(found, expected, rtol=1e-11):
    np.testing.assert_allclose(found, expected, rtol=0, atol=rtol * np.abs(expected).max())


@pytest.mark.parametrize("size", [1.0, 1e-3])
@each_term
def test_segments(term, size):
    points = size * POINTS
    records = np.empty((len(POINTS), 12, len(FACES)))
    surfaces = of_one_kind(points)
    fill_records(surfaces, FACES, FRAMES, 0, len(FACES), records)
    found = []
    for add_segments in (term.add_segments, lambda *parts: Term.add_segments(term, *parts)):
        slopes, gradient = np.zeros_like(records), np.zeros_like(surfaces)
        value = add_segments(records, slopes, AREAS)
        add_gradient(records, slopes, FACES, FRAMES, 0, len(FACES), gradient)
        found.append((value, gradient))
    (value, gradient), (expected, expected_gradient) = found
    assert value == pytest.approx(expected, rel=1e-12)
    close(gradient, expected_gradient)


@pytest.mark.parametrize("size", [1.0, 1e-3])
@each_term
def test_pairs(term, size):
    points = size * POINTS
    fields = [term.fields(surface.derivatives(f, OPERATOR)) for f in points]
    expected = [[term.squared_dist(one, other) @ AREAS for other in fields] for one in fields]
    tables = SumOfTerms([term], TEMPLATE)
    together = tuple(map(np.stack, zip(*fields, strict=True)))
    for features in (
        features_of_fields(term, together, AREAS, "double"),
        tables.features(points, "double"),
    ):
        assert len(features) == tables.n_arrays
        np.testing.assert_array_equal(tables.rounding(features), 0.0)
        close(tables.squared_distances(features, features), term.weight * np.array(expected))
        pair = (of_one_kind(features[0]), of_one_kind(features[0].copy()))
        close(term.squared_distances(*pair, AREAS), expected)


@each_term
def test_forms(term):
    first = surface.derivatives(POINTS[0], OPERATOR)
    scale = first.areas[:, None, None] ** term.area_power
    close(scale * term.form(first), Term.form(term, first), 1e-10)


@each_term
def test_what_terms_say_of_what_they_see(term):
    """Of a turn, of a larger copy, and of triangles without area."""
    alone, turn = SumOfTerms([term], TEMPLATE), np.linalg.qr(POINTS[0, :3])[0]
    turn *= np.linalg.det(turn)
    f = POINTS[0]

    def changes(other):
        return alone.path_energy(np.stack([f, other]))[0] > 1e-9

    assert changes(f @ turn) != term.is_rotation_invariant
    assert changes(2.0 * f) != term.is_stretch_invariant
    flat = f.copy()
    flat[FACES[3]] = flat[FACES[3, 0]]
    assert np.isinf(alone.path_energy(np.stack([f, flat]))[0]) == term.needs_area
