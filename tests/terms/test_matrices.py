"""Quadratic forms of single triangles, against the definitions of terms."""

import numpy as np
import pytest
from cases import open_template, sphere_template, surfaces
from oracles import elastic_blocks

from riemhuman.kernels import triangles
from riemhuman.terms import EbinTerm, NormalTerm, RootNormalTerm
from riemhuman.terms._sum import SumOfTerms

TEMPLATES = {"sphere": sphere_template(), "open": open_template()}
each_template = pytest.mark.parametrize("template", TEMPLATES.values(), ids=TEMPLATES)
WEIGHTS = [{"a": 0.5, "lam": 2.0, "c": 0.3}, {"a": 0.7, "lam": 1e-4, "b": 0.4}]


def terms_of(a=0.0, lam=0.0, c=0.0, b=0.0):
    terms = [EbinTerm(a, lam)] if a else []
    terms += [NormalTerm(c)] if c else []
    return terms + ([RootNormalTerm(b)] if b else [])


@pytest.fixture(params=[False, True], ids=["alone", "threaded"])
def threaded(request, monkeypatch):
    monkeypatch.setattr(triangles, "_WORTH_THREADS", 0 if request.param else np.inf)


@each_template
@pytest.mark.parametrize("weights", WEIGHTS, ids=str)
def test_matrices_are_means_of_triangle_matrices(template, weights, threaded):
    points = surfaces(template, 2, rng=3)
    found = SumOfTerms(terms_of(**weights), template).matrix(points).toarray()
    blocks = [elastic_blocks(f, template.faces, template.face_areas, **weights) for f in points]
    expected = template.assembler.assemble(np.mean(blocks, axis=0)).toarray()
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_allclose(found, found.T, rtol=1e-12, atol=1e-14)
