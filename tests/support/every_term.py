"""The one registry of terms: every class of them, with weights that are not 1."""

import numpy as np

from riemhuman.surfaces import Template
from riemhuman.terms import ConeTerm, EbinTerm, NormalTerm, RootNormalTerm, RotationTerm
from riemhuman.terms._quadratic import (
    FirstOrderTerm,
    FirstOrderWeights,
    NormalPartTerm,
    QuadraticTerm,
    SecondOrderTerm,
    ZerothOrderTerm,
)
from riemhuman.terms._sums import SumOfFields

TERMS = [
    EbinTerm(0.7, 1e-3),
    EbinTerm(0.7, 2.0),
    NormalTerm(0.3),
    RootNormalTerm(1.1),
    RotationTerm(0.6),
    ConeTerm(0.8, 1.0, 0.3, 0.7),
    ConeTerm(1.0, 0.0, 0.2, 4.0),
]
"""Terms with distances in closed form; of cones those of each law."""

QUADRATIC_TERMS = ["zeroth", "first", "second", "normal part"]
"""The names of `quadratic_terms`."""


def quadratic_terms(template: Template) -> dict[str, QuadraticTerm]:
    """Return the terms over a template that are given by their inner products, by name."""
    first = FirstOrderTerm(template, FirstOrderWeights(0.7, 0.3, 1.1, 0.9, 0.4))
    terms = [
        ZerothOrderTerm(template, 0.7),
        first,
        SecondOrderTerm(template, 1.3),
        NormalPartTerm(template, first),
    ]
    return dict(zip(QUADRATIC_TERMS, terms, strict=True))


def features_of_fields(term, fields, areas: np.ndarray, precision: str) -> tuple[np.ndarray, ...]:
    """Return the features of points with these fields of one term."""
    return SumOfFields(term, areas, lambda points: fields).features(np.empty(0), precision)
