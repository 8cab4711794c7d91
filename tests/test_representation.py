"""Every public object shows itself in a line: how it was constructed."""

import pickle

import numpy as np
import pytest
from cases import CASES, name_of, sphere_template

import riemhuman as rh
from riemhuman.representation import constructed


class Recipe:
    def __init__(self, amount, name=None, how=None, secret=3):
        self.amount, self.name, self._how = amount, name, how


def test_calls_are_shown_without_what_is_as_by_default():
    assert constructed(Recipe(2.0)) == "Recipe(amount=2.0)"
    assert constructed(Recipe(np.zeros(2), "soup", len)) == (
        "Recipe(amount=array([0., 0.]), name='soup', how=len)"
    )
    assert constructed(Recipe(1, "soup"), leave_out=("amount",)) == "Recipe(name='soup')"


def test_copies_show_themselves_alike():
    for space in (rh.AlignedSurfaces(sphere_template()), rh.VectorSpace((2,))):
        assert repr(pickle.loads(pickle.dumps(space))) == repr(space)


def test_long_values_are_cut():
    assert constructed(Recipe("x" * 1000)) == f"Recipe(amount='{'x' * 76}...)"
    assert "\n" not in constructed(Recipe(np.zeros((9, 9))))


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_spaces_and_metrics_fit_in_a_line(case):
    for shown in (case.metric, case.metric.space):
        assert repr(shown).startswith(f"{type(shown).__name__}(")
        assert "\n" not in repr(shown)
        assert len(repr(shown)) < 300


def test_parameters_are_seen():
    bodies = rh.datasets.load_open_bodies("coarse")
    space = rh.AlignedSurfaces(bodies.template)
    assert repr(rh.ElasticMetric(space, 2.0, 0.5, 0.1)) == "ElasticMetric(a=2.0, lam=0.5, c=0.1)"
    assert repr(2 * space.metric).startswith("ScalarProductMetric(")
    assert repr(rh.terms.EbinTerm(1.0, lam=0.5)) == "EbinTerm(weight=1.0, lam=0.5)"
    assert repr(bodies.model) == ("<BodyModel: 23 joints, 16 shape coefficients, 1,202 vertices>")
    assert repr(rh.NearestNeighbors(space.metric)).startswith("NearestNeighbors(metric=Elastic")
    assert repr(rh.TangentPCA(space, n_components=3)).endswith("n_components=3)")
    for solver in (rh.solvers.LinearPath(), rh.solvers.Disentangling()):
        assert len(repr(solver)) < 300
